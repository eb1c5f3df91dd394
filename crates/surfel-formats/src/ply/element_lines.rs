//! Skips over the lines of ascii elements.

use surfel_core::progress::Progress;

use super::header::Element;
use crate::error::Result;
use crate::file::Input;

/// Returns the first byte after the ascii elements of kind `element`, which begin at `start` and have a line each.
///
/// Empty lines do not count; elements without properties have no lines.
pub(super) fn end_of_lines(
    input: &Input,
    start: usize,
    element: &Element,
    progress: &dyn Progress,
) -> Result<usize> {
    let mut at = start;
    let mut n_left = if element.properties.is_empty() { 0 } else { element.count };
    let mut n_lines = 0u64;
    while 0 < n_left {
        if n_lines.is_multiple_of(65536) {
            progress.check()?;
        }
        n_lines += 1;
        let rest = &input[at..];
        if rest.is_empty() {
            return Err(element.ends_early(input));
        }
        let length = memchr::memchr(b'\n', rest).map_or(rest.len(), |end| end + 1);
        // Most lines begin with a number, so the whole line is seldom searched.
        let is_empty = rest[0].is_ascii_whitespace() && rest[..length].trim_ascii().is_empty();
        n_left -= u64::from(!is_empty);
        at += length;
    }
    Ok(at)
}
