//! Text cut into pieces that threads parse side by side.

use rayon::prelude::*;
use surfel::progress::Progress;

use crate::error::{Error, Place, Result};
use crate::input::Input;
use crate::lines::LineError;

/// Bytes of text that a thread parses before it looks for cancellation.
const BYTES_PER_PIECE: usize = 1 << 18;

/// A part of a file's text.
#[derive(Clone, Copy)]
pub(crate) struct Piece<'a> {
    pub text: &'a [u8],
    /// Its first byte in the file.
    pub start: usize,
}

/// What is wrong at a byte of the file.
pub(crate) struct Fault {
    pub at: usize,
    pub error: LineError,
}

/// Finds the first byte behind what ends there, a line or more, if it ends at all.
pub(crate) type FindEnd = fn(&[u8]) -> Option<usize>;

impl<'a> Piece<'a> {
    /// Trimmed lines that are not empty, with their first bytes in the file.
    pub fn lines(self, find_end: FindEnd) -> impl Iterator<Item = (usize, &'a [u8])> {
        let mut at = 0;
        let lines = std::iter::from_fn(move || {
            let rest = self.text.get(at..).filter(|rest| !rest.is_empty())?;
            let start = self.start + at;
            let length = find_end(rest).unwrap_or(rest.len());
            at += length;
            Some((start, rest[..length].trim_ascii()))
        });
        lines.filter(|(_, line)| !line.is_empty())
    }

    /// Pieces that end where `find_end` lets them.
    pub fn cut(self, find_end: FindEnd) -> Vec<Self> {
        let mut pieces = Vec::new();
        let mut start = 0;
        while start < self.text.len() {
            let rest = &self.text[start..];
            let near = rest.len().min(BYTES_PER_PIECE);
            // Whether a line ends may depend on what is before its end: that is not to be cut off.
            let ends = rest[near..].iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
            let near = near + ends.count();
            let end = find_end(&rest[near..]).map_or(rest.len(), |length| near + length);
            pieces.push(Self { text: &rest[..end], start: self.start + start });
            start += end;
        }
        pieces
    }
}

impl Fault {
    pub fn new(at: usize, error: LineError) -> Self {
        Self { at, error }
    }

    pub fn told_of(self, input: &Input) -> Error {
        let LineError { found, expected } = self.error;
        input.malformed(line_of(input, self.at), found, expected, "mend or remove the line")
    }
}

/// Parses all pieces; of several faults the first in the file is told.
pub(crate) fn parse_pieces<'a, T: Send>(
    input: &Input,
    pieces: &[Piece<'a>],
    parse: impl Fn(usize, Piece<'a>) -> std::result::Result<T, Fault> + Sync,
    progress: &dyn Progress,
) -> Result<Vec<T>> {
    let parsed = pieces.par_iter().enumerate().map(|(i, piece)| {
        progress.check()?;
        let parsed = parse(i, *piece).map_err(|fault| fault.told_of(input));
        progress.advance(piece.text.len() as u64);
        parsed
    });
    parsed.collect::<Vec<Result<T>>>().into_iter().collect()
}

/// The line that holds byte `at`.
pub(crate) fn line_of(input: &Input, at: usize) -> Place {
    Place::Line(1 + memchr::memchr_iter(b'\n', &input[..at]).count() as u64)
}

/// A line as most files have it.
pub(crate) fn plain_line(text: &[u8]) -> Option<usize> {
    memchr::memchr(b'\n', text).map(|at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_end_with_lines_and_leave_nothing_out() {
        let text: Vec<u8> = (0..200_000).flat_map(|i| format!(" {i}\r\n\n").into_bytes()).collect();
        let whole = Piece { text: &text, start: 7 };
        let pieces = whole.cut(plain_line);
        assert!(2 < pieces.len());
        let mut lines = pieces.iter().flat_map(|piece| piece.lines(plain_line));
        for (i, (start, line)) in whole.lines(plain_line).enumerate() {
            assert_eq!(line, i.to_string().as_bytes());
            assert_eq!(lines.next(), Some((start, line)));
        }
        assert_eq!(lines.next(), None);
        assert_eq!(Piece { text: b"", start: 0 }.cut(plain_line).len(), 0);
    }
}
