//! ESRI ASCII grid: elevations in rows from north to south, after a header of lines with a key and a number.

use rayon::prelude::*;
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::table::{
    CloudBuilder, ColumnField, ColumnRole, Field, NumberType, ParseFault, RecordLayout, TextChunk,
    find_line_end, parse_chunks, parse_number, parse_numbers, words_of,
};

/// Number of chunks of text whose cells are in memory at a time.
const CHUNKS_PER_BATCH: usize = 32;
/// Number of cells that a thread turns into points at a time.
const CELLS_PER_TASK: usize = 1 << 14;
/// Maximum number of lines of a header.
const MAX_HEADER_LINES: usize = 16;

/// The header of a grid.
#[derive(Debug, PartialEq)]
struct Header {
    n_columns: u64,
    n_rows: u64,
    /// Coordinates of the middle of the south-western cell.
    first: [f64; 2],
    /// Distances between the middles of cells along x and y.
    step: [f64; 2],
    /// Value of cells without an elevation.
    no_data: f64,
    /// First byte of the cells.
    data: usize,
}

/// Returns true if an input begins with the number of columns or rows.
pub(crate) fn is_grid(input: &Input) -> bool {
    let start = &input[..input.len().min(5)];
    start.eq_ignore_ascii_case(b"ncols") || start.eq_ignore_ascii_case(b"nrows")
}

/// Reads the header.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    Ok(file_info(&read_header(input)?))
}

/// Reads the middles of the cells that have an elevation.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let header = read_header(input)?;
    let layout_of = |_: &[u8]| layout(options);
    let mut builder = CloudBuilder::new(input, layout_of, options.origin, options.filter.as_ref());
    let mut salvage = Salvage::new(input, options.salvage);
    progress.begin(&format!("read {}", input.name), (input.len() - header.data) as u64);
    let text = TextChunk { text: &input[header.data..], start: header.data };
    let n_claimed = header.n_columns.saturating_mul(header.n_rows);
    let mut n_cells = 0;
    // What is whole before damage is kept.
    let n_chunks = if options.salvage { 1 } else { CHUNKS_PER_BATCH };
    for chunks in text.split(find_line_end).chunks(n_chunks) {
        let parsed = parse_chunks(input, chunks, |_, chunk| parse_cells(chunk), progress);
        let cells = match parsed {
            Ok(cells) => cells.concat(),
            Err(error) => {
                salvage.accept(error)?;
                break;
            }
        };
        let n_before = n_cells;
        n_cells += cells.len() as u64;
        if n_claimed < n_cells {
            let found = format!("more than {}", counted(n_claimed, "cell"));
            let expected = format!("{} in {}", header.n_columns, counted(header.n_rows, "row"));
            let advice = "correct ncols and nrows, or write the file again";
            return Err(input.malformed(Location::Byte(0), found, expected, advice));
        }
        let tasks = cells.par_chunks(CELLS_PER_TASK).enumerate();
        let to_records = |(i, cells): (usize, &[f64])| {
            header.records(n_before + (i * CELLS_PER_TASK) as u64, cells)
        };
        builder.append(&tasks.map(to_records).collect::<Vec<_>>())?;
    }
    if n_cells < n_claimed && !salvage.is_damaged() {
        salvage.accept(input.truncated(Location::Byte(input.len() as u64), n_cells, n_claimed))?;
    }
    let n_points = builder.n_read();
    salvage.report("cell", n_cells, Some(n_claimed), progress)?;
    if n_points < n_cells {
        let n_empty = n_cells - n_points;
        let cells = counted(n_cells, "cell");
        progress.note(&format!("{}: skipped {n_empty} of {cells}: no elevation", input.name));
    }
    let info = FileInfo { n_points: Some(n_points), ..file_info(&header) };
    Ok(Loaded { cloud: builder.finish(), info })
}

fn file_info(header: &Header) -> FileInfo {
    FileInfo {
        format: format!("ESRI ASCII grid, {} x {} cells", header.n_columns, header.n_rows),
        columns: ["x", "y", "z"].map(String::from).into(),
        ..FileInfo::default()
    }
}

/// Returns the layout of records of x, y and z.
fn layout(options: &LoadOptions) -> RecordLayout {
    let columns = (0..3).map(|axis| ColumnField {
        role: ColumnRole::Position(axis),
        field: Field::new(8 * axis, NumberType::F64),
    });
    RecordLayout::new(24, false, columns.collect(), &options.columns)
        .expect("the columns are x, y and z")
}

/// Reads the lines up to the first one that begins with a number.
fn read_header(input: &Input) -> Result<Header> {
    let mut values: Vec<(String, f64)> = Vec::new();
    let mut data = 0;
    let lines = input.split_inclusive(|byte| *byte == b'\n').take(MAX_HEADER_LINES);
    for (i, line) in lines.enumerate() {
        let mut words = words_of(line.trim_ascii());
        let key = words.next().unwrap_or_default();
        if !key.is_empty() && parse_number(key).is_ok() {
            break;
        }
        data += line.len();
        let Some(value) = words.next() else { continue };
        let value = parse_number(value).map_err(|error| {
            let location = Location::Line(i as u64 + 1);
            input.malformed(location, error.found, error.expected, "correct the header")
        })?;
        values.push((String::from_utf8_lossy(key).to_lowercase(), value));
    }
    let find = |names: [&str; 2]| values.iter().find(|(key, _)| names.contains(&key.as_str()));
    let required = |names: [&str; 2], expected: &str, is_valid: fn(f64) -> bool| match find(names) {
        Some((_, value)) if is_valid(*value) => Ok(*value),
        Some((key, value)) => {
            let found = format!("{key} {value}");
            Err(input.malformed(Location::Line(1), found, expected, "correct the header"))
        }
        None => {
            let found = format!("a header without {}", names[0]);
            Err(input.malformed(Location::Line(1), found, expected, "add the line to the header"))
        }
    };
    let is_count =
        |value: f64| value.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&value);
    let is_length = |value: f64| value.is_finite() && 0.0 < value;
    let count = |name: &'static str| required([name, ""], "a whole number of cells", is_count);
    let (n_columns, n_rows) = (count("ncols")? as u64, count("nrows")? as u64);
    let step = |name| required(["cellsize", name], "a positive size of the cells", is_length);
    let step = [step("dx")?, step("dy")?];
    let first = |corner: &'static str, center: &'static str, step: f64| {
        let names = [corner, center];
        let found = required(names, "a coordinate of the lower left cell", f64::is_finite)?;
        let is_corner = find([corner, ""]).is_some();
        Ok::<f64, Error>(if is_corner { found + 0.5 * step } else { found })
    };
    Ok(Header {
        n_columns,
        n_rows,
        first: [
            first("xllcorner", "xllcenter", step[0])?,
            first("yllcorner", "yllcenter", step[1])?,
        ],
        step,
        no_data: find(["nodata_value", "nodata"]).map_or(-9999.0, |(_, value)| *value),
        data,
    })
}

impl Header {
    /// Returns the records of the cells that have an elevation; `first` is the index of the first cell.
    fn records(&self, first: u64, elevations: &[f64]) -> Vec<u8> {
        let mut records = Vec::new();
        for (i, elevation) in elevations.iter().enumerate() {
            if *elevation == self.no_data || !elevation.is_finite() {
                continue;
            }
            let cell = first + i as u64;
            let (column, row_from_north) = (cell % self.n_columns, cell / self.n_columns);
            let row = self.n_rows - 1 - row_from_north;
            let x = self.first[0] + self.step[0] * column as f64;
            let y = self.first[1] + self.step[1] * row as f64;
            records.extend([x, y, *elevation].iter().flat_map(|value| value.to_le_bytes()));
        }
        records
    }
}

/// Returns the values of the cells in lines of text.
fn parse_cells(chunk: TextChunk) -> std::result::Result<Vec<f64>, ParseFault> {
    let mut cells = Vec::new();
    for (byte, line) in chunk.lines(find_line_end) {
        parse_numbers(line, &mut cells).map_err(|error| ParseFault::new(byte, error))?;
    }
    Ok(cells)
}
