//! The scans of a PTX file: their grids, poses and lines.

use surfel_core::math::{DMat3, DVec3};
use surfel_core::progress::Progress;

use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;
use crate::stations::MAX_STATIONS;
use crate::table::{MAX_LINE_LENGTH, parse_numbers};

/// Number of lines before the points of a scan: columns, rows, scanner position, its three axes, and the four rows of
/// the transform.
const N_HEADER_LINES: usize = 10;

/// Bytes in which lines are counted between two checks for cancellation.
const BYTES_PER_CHECK: usize = 1 << 22;

/// A scan: a grid of cells, one to a line.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    /// Number of columns and rows of the grid.
    pub grid: [u64; 2],
    /// World position of the scanner.
    pub position: DVec3,
    /// Linear part of the transform to world coordinates.
    pub rotation: DMat3,
    /// Translation of the transform.
    pub translation: DVec3,
    /// First byte of the cells.
    pub start: usize,
    /// First byte after them.
    pub end: usize,
    /// Number of the line at `start`.
    pub line: u64,
    /// Number of whole lines: that of the cells, unless the file ends early.
    pub n_lines: u64,
    /// Number of fields in the first cell's line.
    pub n_fields: usize,
}

impl Scan {
    /// Returns the number of cells.
    pub fn n_cells(&self) -> u64 {
        self.grid[0] * self.grid[1]
    }
}

/// Reads the headers of all scans and finds their lines. Salvage ends with the last whole line.
pub(super) fn find_scans(salvage: &mut Salvage, progress: &dyn Progress) -> Result<Vec<Scan>> {
    let input = salvage.input;
    let mut scans: Vec<Scan> = Vec::new();
    let mut lines = Lines { input, at: 0, number: 0 };
    loop {
        lines.skip_empty();
        if lines.at == input.len() && !scans.is_empty() {
            return Ok(scans);
        }
        if scans.len() == MAX_STATIONS {
            let location = Location::Line(lines.number + 1);
            let advice = "divide the file into several";
            return Err(input.malformed(
                location,
                "a further scan",
                format!("at most {MAX_STATIONS}"),
                advice,
            ));
        }
        let mut scan = match read_scan_header(&mut lines) {
            Ok(scan) => scan,
            Err(error) if scans.is_empty() => return Err(error),
            Err(error) => {
                salvage.accept(error)?;
                return Ok(scans);
            }
        };
        let end = end_of_cells(&lines, &scan, progress);
        let is_whole = end.is_ok();
        match end {
            Ok(end) => (scan.end, scan.n_lines) = (end, scan.n_cells()),
            Err(error) => {
                salvage.accept(error)?;
                let cells = &input[scan.start..];
                scan.end = scan.start + memchr::memrchr(b'\n', cells).map_or(0, |at| at + 1);
                scan.n_lines = memchr::memchr_iter(b'\n', cells).count() as u64;
            }
        }
        let first = input[scan.start..scan.end].split(|byte| *byte == b'\n').next();
        scan.n_fields = first
            .unwrap_or_default()
            .trim_ascii()
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty())
            .count();
        lines.at = scan.end;
        lines.number += scan.n_lines;
        scans.push(scan);
        if !is_whole {
            return Ok(scans);
        }
    }
}

/// Returns true if an input begins with the lines before a scan.
pub(crate) fn is_ptx(input: &Input) -> bool {
    first_header(input).is_ok()
}

/// Reads the header of the first scan.
pub(super) fn first_header(input: &Input) -> Result<Scan> {
    read_scan_header(&mut Lines { input, at: 0, number: 0 })
}

/// Reads the lines before the cells of a scan.
fn read_scan_header(lines: &mut Lines) -> Result<Scan> {
    let mut grid = [0; 2];
    for (count, name) in grid.iter_mut().zip(["columns", "rows"]) {
        let line = lines.next()?;
        let parsed = str::from_utf8(line).ok().and_then(|line| line.parse::<u64>().ok());
        *count = parsed.ok_or_else(|| {
            lines.malformed(line, &format!("the number of {name} of a scan's grid"))
        })?;
    }
    if grid[0].checked_mul(grid[1]).is_none() {
        return Err(lines.malformed(b"a grid beyond counting", "rows and columns of a scan"));
    }
    let position = DVec3::from_array(lines.numbers("the position of the scanner, x y z")?);
    for axis in ["x", "y", "z"] {
        lines.numbers::<3>(&format!("the {axis} axis of the scanner, x y z"))?;
    }
    // Each line is the image of an axis, since the file multiplies rows by the matrix.
    let mut images = [[0.0; 4]; 4];
    for image in &mut images {
        *image = lines.numbers("four numbers of the transform")?;
    }
    let [x, y, z, translation] = images.map(|[x, y, z, _]| DVec3::new(x, y, z));
    Ok(Scan {
        grid,
        position,
        rotation: DMat3::from_cols(x, y, z),
        translation,
        start: lines.at,
        end: lines.at,
        line: lines.number + 1,
        n_lines: 0,
        n_fields: 0,
    })
}

/// Returns the first byte after the cells of a scan.
fn end_of_cells(lines: &Lines, scan: &Scan, progress: &dyn Progress) -> Result<usize> {
    let mut at = scan.start;
    let mut n_left = scan.n_cells();
    while 0 < n_left {
        progress.check()?;
        let piece = &lines.input[at..lines.input.len().min(at + BYTES_PER_CHECK)];
        let is_last = at + piece.len() == lines.input.len();
        let has_unended_line = is_last && piece.last().is_some_and(|last| *last != b'\n');
        let ends = memchr::memchr_iter(b'\n', piece);
        let n_lines = ends.clone().count() as u64 + u64::from(has_unended_line);
        if n_left <= n_lines {
            let last = ends.clone().nth(n_left as usize - 1);
            return Ok(at + last.map_or(piece.len(), |end| end + 1));
        }
        n_left -= n_lines;
        at += piece.len();
        if is_last {
            let n_found = scan.n_cells() - n_left;
            let location = Location::Line(scan.line + n_found);
            return Err(lines.input.truncated(location, n_found, scan.n_cells()));
        }
    }
    Ok(at)
}

/// The lines of the headers.
struct Lines<'a> {
    input: &'a Input<'a>,
    at: usize,
    /// Number of lines read.
    number: u64,
}

impl<'a> Lines<'a> {
    /// Skips empty lines.
    fn skip_empty(&mut self) {
        while let Some(length) = memchr::memchr(b'\n', &self.input[self.at..])
            && self.input[self.at..self.at + length].trim_ascii().is_empty()
        {
            self.at += length + 1;
            self.number += 1;
        }
        if self.input[self.at..].len() <= MAX_LINE_LENGTH
            && self.input[self.at..].trim_ascii().is_empty()
        {
            self.at = self.input.len();
        }
    }

    /// Returns the next line without the spaces about it.
    fn next(&mut self) -> Result<&'a [u8]> {
        let rest = &self.input[self.at..];
        self.number += 1;
        let near = &rest[..rest.len().min(MAX_LINE_LENGTH)];
        let Some(length) = memchr::memchr(b'\n', near) else {
            let found: &[u8] = if near.len() == MAX_LINE_LENGTH {
                b"a longer line"
            } else {
                b"the end of the file"
            };
            return Err(self.malformed(found, &format!("the {N_HEADER_LINES} lines before a scan")));
        };
        self.at += length + 1;
        Ok(rest[..length].trim_ascii())
    }

    /// Returns the numbers of the next line.
    fn numbers<const N: usize>(&mut self, expected: &str) -> Result<[f64; N]> {
        let line = self.next()?;
        let mut numbers = Vec::new();
        let is_number = parse_numbers(line, &mut numbers).is_ok();
        match <[f64; N]>::try_from(numbers) {
            Ok(numbers) if is_number && numbers.iter().all(|number| number.is_finite()) => {
                Ok(numbers)
            }
            _ => Err(self.malformed(line, expected)),
        }
    }

    /// Returns the error of the line that was read last.
    fn malformed(&self, line: &[u8], expected: &str) -> Error {
        let found = format!("`{}`", line[..line.len().min(60)].escape_ascii());
        let advice = "the lines before a scan are broken; write the file again";
        self.input.malformed(Location::Line(self.number), found, expected, advice)
    }
}
