//! The lines of OBJ and MTL files: a keyword and its arguments.

use crate::table::{LineError, parse_number};
use surfel_core::words::counted;

/// Returns the length of the line at the start of `text`, which a backslash continues; `None` if it does not end.
pub(super) fn line_end(text: &[u8]) -> Option<usize> {
    memchr::memchr_iter(b'\n', text).map(|at| at + 1).find(|end| {
        let line = &text[..end - 1];
        !line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
    })
}

/// Splits a trimmed line into its keyword and the rest.
pub(super) fn split_keyword(line: &[u8]) -> (&[u8], &[u8]) {
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii())
}

/// Returns the words of `rest` up to a comment.
pub(super) fn words(rest: &[u8]) -> impl Iterator<Item = &[u8]> {
    let words = rest.split(|byte| byte.is_ascii_whitespace() || *byte == b'\\');
    words.filter(|word| !word.is_empty()).take_while(|word| word[0] != b'#')
}

/// Parses the numbers in `rest`, from `MIN` to `MAX` of them; returns them and their count.
pub(super) fn numbers<const MIN: usize, const MAX: usize>(
    rest: &[u8],
) -> Result<([f64; MAX], usize), LineError> {
    let mut numbers = [0.0; MAX];
    let mut count = 0;
    for (slot, word) in numbers.iter_mut().zip(words(rest)) {
        *slot = parse_number(word)?;
        count += 1;
    }
    if count < MIN {
        let expected = format!("at least {MIN}");
        return Err(LineError { found: counted(count, "number"), expected });
    }
    Ok((numbers, count))
}

/// Returns `rest` as a name, which may contain spaces.
pub(super) fn name(rest: &[u8]) -> String {
    String::from_utf8_lossy(rest).into_owned()
}
