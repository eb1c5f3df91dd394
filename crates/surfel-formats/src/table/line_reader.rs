//! Reads lines of numbers in parallel, as records of f64.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, PointFilter};
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::cloud_builder::CloudBuilder;
use super::layout::RecordLayout;
use super::line_end::{FindEnd, find_line_end};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;

/// Bytes of text that a task parses.
const BYTES_PER_TASK: usize = 1 << 18;
/// Number of tasks whose rows are in memory at a time.
const TASKS_PER_BATCH: usize = 32;

/// Maximum bytes of a line. Longer ones are rejected before memory is allocated for them: they are no text that holds
/// points.
pub(crate) const MAX_LINE_LENGTH: usize = 1 << 20;
/// Maximum number of fields in a line.
pub(crate) const MAX_FIELDS: usize = 1000;

/// Advice for a broken line.
const LINE_ADVICE: &str = "repair or remove the line";

/// The lines of a file to read.
#[derive(Clone, Copy)]
pub(crate) struct RowRange {
    /// First byte.
    pub start: usize,
    /// First byte after them; the end of the file if absent.
    pub end: Option<usize>,
    /// Number of the line that begins there, for messages.
    pub line: u64,
    /// Number of values in each row.
    pub n_columns: usize,
    /// Maximum number of rows; the lines after them are ignored.
    pub limit: Option<u64>,
    /// Function that finds the ends of lines which may go on after a line feed; if absent, none do.
    pub line_end: Option<FindEnd>,
}

/// The error of a line.
pub(crate) struct LineError {
    /// Text that was found.
    pub found: String,
    /// Text that was expected.
    pub expected: String,
}

/// Appends the values of a line of this number to a row; a line without values is no row.
pub(crate) type ParseLine<'a> =
    &'a (dyn Fn(u64, &[u8], &mut Vec<f64>) -> std::result::Result<(), LineError> + Sync);

/// Reads lines to a cloud of the points that `filter` keeps; also returns the number of rows, kept or not. `layout_of`
/// is called once, with the first rows as records of f64. A broken line is damage: it is left out, or ends rows whose
/// number is stated. So is a file that ends before as many rows as its limit says.
pub(crate) fn read_rows(
    salvage: &mut Salvage,
    rows: RowRange,
    parse: ParseLine,
    layout_of: impl Fn(&[u8]) -> RecordLayout,
    origin: Option<DVec3>,
    filter: Option<&PointFilter>,
    progress: &dyn Progress,
) -> Result<(PointCloud, u64)> {
    let input = salvage.input;
    let mut builder = CloudBuilder::new(input, layout_of, origin, filter);
    let claimed = rows.limit;
    let (whole, last) = match claimed {
        Some(_) if salvage.is_on => rows.split_unfinished_line(input),
        _ => (rows, None),
    };
    let broken = BrokenLines::default();
    let leave_out = |number: u64, line: &[u8], row: &mut Vec<f64>| {
        parse(number, line, row).or_else(|error| {
            row.clear();
            broken.add(number, error);
            Ok(())
        })
    };
    // Where the number of rows is stated, other data follow, which must not be taken for rows.
    let leaves_out = salvage.is_on && claimed.is_none();
    let parse_whole = if leaves_out { &leave_out } else { parse };
    if let Err(error) = append_rows(&mut builder, whole, parse_whole, progress) {
        salvage.accept(error)?;
    } else if let (Some(last), Some(claimed)) = (last, claimed)
        && builder.n_read() + 1 == claimed
        && let Err(error) = append_rows(&mut builder, last, parse, progress)
    {
        salvage.accept(error)?;
    }
    broken.report(salvage, progress)?;
    let n_rows = builder.n_read();
    if let Some(claimed) = claimed.filter(|claimed| n_rows < *claimed) {
        salvage.accept(input.truncated(Location::Byte(input.len() as u64), n_rows, claimed))?;
    }
    Ok((builder.finish(), n_rows))
}

/// The broken lines that were left out.
#[derive(Default)]
struct BrokenLines {
    /// Their number.
    count: AtomicUsize,
    /// The first of them, by its number.
    first: Mutex<Option<(u64, LineError)>>,
}

impl BrokenLines {
    fn add(&self, number: u64, error: LineError) {
        self.count.fetch_add(1, Ordering::Relaxed);
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        if first.as_ref().is_none_or(|(before, _)| number < *before) {
            *first = Some((number, error));
        }
    }

    /// Reports the number of lines, the first of which is damage of the file.
    fn report(self, salvage: &mut Salvage, progress: &dyn Progress) -> Result<()> {
        let first = self.first.into_inner().unwrap_or_else(PoisonError::into_inner);
        let Some((number, LineError { found, expected })) = first else { return Ok(()) };
        let input = salvage.input;
        let lines = counted(self.count.into_inner(), "broken line");
        progress.note(&format!("{}: {lines} left out", input.name));
        salvage.accept(input.malformed(Location::Line(number), found, expected, LINE_ADVICE))
    }
}

impl RowRange {
    /// Splits off a last line without an end, which may be cut within a number.
    fn split_unfinished_line(self, input: &Input) -> (Self, Option<Self>) {
        let text = &input[self.start..self.end.unwrap_or(input.len())];
        let end = self.start + memchr::memrchr(b'\n', text).map_or(0, |at| at + 1);
        let n_lines = memchr::memchr_iter(b'\n', text).count() as u64;
        let last = Self { start: end, line: self.line + n_lines, ..self };
        (Self { end: Some(end), ..self }, Some(last))
    }
}

/// Reads lines to the end of a cloud. If one is broken, those before it are appended.
pub(crate) fn append_rows(
    builder: &mut CloudBuilder<impl Fn(&[u8]) -> RecordLayout>,
    rows: RowRange,
    parse: ParseLine,
    progress: &dyn Progress,
) -> Result<()> {
    let input = builder.input;
    let mut rest = &input[rows.start..rows.end.unwrap_or(input.len())];
    let mut line = rows.line;
    let mut left = rows.limit.unwrap_or(u64::MAX);
    while !rest.is_empty() && 0 < left {
        progress.check()?;
        let tasks = take_tasks(&mut rest, rows.line_end.unwrap_or(find_line_end));
        let n_bytes: usize = tasks.iter().map(|task| task.len()).sum();
        let firsts = first_lines(&tasks, line);
        let parse_task = |(text, first)| parse_text(text, first, parse, rows);
        let parsed: Vec<Parsed> = tasks.into_par_iter().zip(firsts).map(parse_task).collect();

        let mut batch: Vec<Vec<u8>> = Vec::new();
        for mut parsed in parsed {
            let n_rows = (parsed.records.len() / (8 * rows.n_columns)) as u64;
            if left <= n_rows {
                parsed.records.truncate(left as usize * 8 * rows.n_columns);
            } else if let Some((number, LineError { found, expected })) = parsed.error {
                batch.push(parsed.records);
                builder.append(&batch)?;
                let location = Location::Line(number);
                return Err(input.malformed(location, found, expected, LINE_ADVICE));
            }
            left = left.saturating_sub(n_rows);
            line += parsed.n_lines;
            batch.push(parsed.records);
        }
        builder.append(&batch)?;
        progress.advance(n_bytes as u64);
    }
    Ok(())
}

/// Returns the words of a line between blanks.
pub(crate) fn words_of(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Appends the numbers of a line between blanks.
pub(crate) fn parse_numbers(line: &[u8], row: &mut Vec<f64>) -> std::result::Result<(), LineError> {
    let mut rest = line.trim_ascii_start();
    while !rest.is_empty() {
        let is_word_end = |end| rest.get(end).is_none_or(u8::is_ascii_whitespace);
        let (number, end) = match fast_float2::parse_partial(rest) {
            Ok((number, end)) if is_word_end(end) => (number, end),
            _ => {
                let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
                (parse_number(&rest[..end])?, end)
            }
        };
        row.push(number);
        rest = rest[end..].trim_ascii_start();
    }
    Ok(())
}

/// Words that programs write for a missing number, in upper case; that of the C library of Windows is `-nan(ind)`.
const MISSING: [&[u8]; 7] =
    [b"NA", b"N/A", b"NULL", b"NONE", b"-NAN(IND)", b"NAN(IND)", b"-NAN(SNAN)"];

/// Parses a number in any of the usual spellings, `nan`, `inf` and those of a missing number among them.
pub(crate) fn parse_number(word: &[u8]) -> std::result::Result<f64, LineError> {
    fast_float2::parse(word).or_else(|_| {
        if MISSING.iter().any(|missing| missing.eq_ignore_ascii_case(word)) {
            return Ok(f64::NAN);
        }
        let text = word[..word.len().min(40)].escape_ascii();
        let has_comma = word.contains(&b',');
        let expected =
            if has_comma { "a number with a decimal point, not a comma" } else { "a number" };
        Err(LineError { found: format!("`{text}`"), expected: expected.into() })
    })
}

fn check_length(line: &[u8]) -> std::result::Result<(), LineError> {
    if line.len() <= MAX_LINE_LENGTH {
        return Ok(());
    }
    let expected = format!("lines of at most {MAX_LINE_LENGTH} bytes");
    Err(LineError { found: format!("a line of {} bytes", line.len()), expected })
}

struct Parsed {
    /// Rows of little-endian f64.
    records: Vec<u8>,
    /// Number of lines parsed, the broken one included.
    n_lines: u64,
    /// The number of the broken line and its error.
    error: Option<(u64, LineError)>,
}

/// Takes whole lines from the front of `rest`, one part for each task.
fn take_tasks<'a>(rest: &mut &'a [u8], line_end: FindEnd) -> Vec<&'a [u8]> {
    let mut tasks = Vec::new();
    while !rest.is_empty() && tasks.len() < TASKS_PER_BATCH {
        let near = rest.len().min(BYTES_PER_TASK);
        let start = memchr::memrchr(b'\n', &rest[..near]).map_or(0, |at| at + 1);
        let end = line_end(&rest[start..]).map_or(rest.len(), |length| start + length);
        let (task, after) = rest.split_at(end);
        tasks.push(task);
        *rest = after;
    }
    tasks
}

/// Returns the number of the first line of each task; that of the first task is `line`.
fn first_lines(tasks: &[&[u8]], line: u64) -> Vec<u64> {
    let count = |task: &&[u8]| memchr::memchr_iter(b'\n', task).count() as u64;
    let counts: Vec<u64> = tasks.par_iter().map(count).collect();
    let start = |next: &mut u64, count: u64| {
        *next += count;
        Some(*next - count)
    };
    counts.into_iter().scan(line, start).collect()
}

/// Parses lines, the first of which has the number `first`.
fn parse_text(text: &[u8], first: u64, parse: ParseLine, rows: RowRange) -> Parsed {
    let RowRange { n_columns, line_end, .. } = rows;
    let mut parsed = Parsed { records: Vec::new(), n_lines: 0, error: None };
    let mut row = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let end = line_end.unwrap_or(find_line_end)(rest).unwrap_or(rest.len());
        let (whole, after) = rest.split_at(end);
        let line = whole.trim_ascii();
        rest = after;
        let number = first + parsed.n_lines;
        let before_end = &whole[..end - 1];
        let n_continued = line_end.map_or(0, |_| memchr::memchr_iter(b'\n', before_end).count());
        parsed.n_lines += 1 + n_continued as u64;
        if line.is_empty() {
            continue;
        }
        row.clear();
        if let Err(error) = check_length(line).and_then(|()| parse(number, line, &mut row)) {
            parsed.error = Some((number, error));
            break;
        }
        debug_assert!(row.is_empty() || row.len() == n_columns, "a row is complete or empty");
        for value in &row {
            parsed.records.extend_from_slice(&value.to_le_bytes());
        }
    }
    parsed
}
