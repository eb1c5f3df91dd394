//! The lines of ascii elements.

use surfel::progress::Progress;

use super::header::Element;
use super::walk::ends_early;
use crate::error::Result;
use crate::input::Input;

/// The first byte behind the lines of `element`, one for each, the first of which begins at `start`.
///
/// Empty lines do not count; elements without properties have none.
pub(super) fn end_of_lines(
    input: &Input,
    start: usize,
    element: &Element,
    progress: &dyn Progress,
) -> Result<usize> {
    let mut at = start;
    let mut left = if element.properties.is_empty() { 0 } else { element.count };
    let mut n_lines = 0u64;
    while 0 < left {
        if n_lines.is_multiple_of(65536) {
            progress.check()?;
        }
        n_lines += 1;
        let rest = &input[at..];
        if rest.is_empty() {
            return Err(ends_early(input, element));
        }
        let length = memchr::memchr(b'\n', rest).map_or(rest.len(), |end| end + 1);
        // Most lines begin with their first number.
        let is_empty = rest[0].is_ascii_whitespace() && rest[..length].trim_ascii().is_empty();
        left -= u64::from(!is_empty);
        at += length;
    }
    Ok(at)
}
