//! The lines of OBJ and MTL files: a keyword and what follows it.

use crate::lines::{LineError, parse_number};

/// A line ends where no backslash says that it goes on behind.
pub(super) fn line_end(text: &[u8]) -> Option<usize> {
    memchr::memchr_iter(b'\n', text).map(|at| at + 1).find(|end| {
        let line = &text[..end - 1];
        !line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
    })
}

/// The keyword of a trimmed line, and the rest.
pub(super) fn keyword(line: &[u8]) -> (&[u8], &[u8]) {
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii())
}

/// The words of a rest; a comment may stand behind them.
pub(super) fn words(rest: &[u8]) -> impl Iterator<Item = &[u8]> {
    let words = rest.split(|byte| byte.is_ascii_whitespace() || *byte == b'\\');
    words.filter(|word| !word.is_empty()).take_while(|word| word[0] != b'#')
}

/// As many numbers as there are, at least `LEAST` of them, at most `MOST`.
pub(super) fn numbers<const LEAST: usize, const MOST: usize>(
    rest: &[u8],
) -> Result<([f64; MOST], usize), LineError> {
    let mut numbers = [0.0; MOST];
    let mut count = 0;
    for (slot, word) in numbers.iter_mut().zip(words(rest)) {
        *slot = parse_number(word)?;
        count += 1;
    }
    if count < LEAST {
        let expected = format!("at least {LEAST}");
        return Err(LineError { found: format!("{count} numbers"), expected });
    }
    Ok((numbers, count))
}

/// A name, which may have spaces in it.
pub(super) fn name(rest: &[u8]) -> String {
    String::from_utf8_lossy(rest).into_owned()
}
