//! Ends of the lines and records of a text.

/// Returns the length of the record, a line or more, at the start of a text; `None` if it does not end.
pub(crate) type FindEnd = fn(&[u8]) -> Option<usize>;

/// Returns the length of the line at the start of `text`, its line feed included; `None` if it does not end.
pub(crate) fn find_line_end(text: &[u8]) -> Option<usize> {
    memchr::memchr(b'\n', text).map(|at| at + 1)
}
