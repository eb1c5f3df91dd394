//! Text split into chunks that threads parse in parallel.

use rayon::prelude::*;
use surfel_core::progress::Progress;

use super::line_end::FindEnd;
use super::line_reader::LineError;
use crate::error::{Error, Location, Result};
use crate::file::Input;

/// Bytes of text that a thread parses between two checks for cancellation.
const BYTES_PER_CHUNK: usize = 1 << 18;

/// A part of a file's text.
#[derive(Clone, Copy)]
pub(crate) struct TextChunk<'a> {
    /// Text of the chunk.
    pub text: &'a [u8],
    /// Byte of the file at which the text begins.
    pub start: usize,
}

/// An error in the text of a file, and the byte at which the wrong line begins.
pub(crate) struct ParseFault {
    /// Byte of the line in the file.
    pub byte: usize,
    /// The fault of the line.
    pub error: LineError,
}

impl<'a> TextChunk<'a> {
    /// Yields the trimmed lines that are not empty, each with the byte of the file at which it begins.
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

    /// Splits the text into chunks of whole records, whose ends `find_end` finds.
    pub fn split(self, find_end: FindEnd) -> Vec<Self> {
        let mut chunks = Vec::new();
        let mut start = 0;
        while start < self.text.len() {
            let rest = &self.text[start..];
            let near = rest.len().min(BYTES_PER_CHUNK);
            // A line end may count only together with the bytes before it, so none is cut off here.
            let ends = rest[near..].iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
            let near = near + ends.count();
            let end = find_end(&rest[near..]).map_or(rest.len(), |length| near + length);
            chunks.push(Self { text: &rest[..end], start: self.start + start });
            start += end;
        }
        chunks
    }
}

impl ParseFault {
    /// An error in the line at a byte.
    pub fn new(byte: usize, error: LineError) -> Self {
        Self { byte, error }
    }

    /// Returns the error with the line number, which is counted only now.
    pub fn into_error(self, input: &Input) -> Error {
        let LineError { found, expected } = self.error;
        input.malformed(line_at(input, self.byte), found, expected, "repair or remove the line")
    }
}

/// Parses all chunks in parallel. If several fail, the error is the first in the file.
pub(crate) fn parse_chunks<'a, T: Send>(
    input: &Input,
    chunks: &[TextChunk<'a>],
    parse: impl Fn(usize, TextChunk<'a>) -> std::result::Result<T, ParseFault> + Sync,
    progress: &dyn Progress,
) -> Result<Vec<T>> {
    let parsed = chunks.par_iter().enumerate().map(|(i, chunk)| {
        progress.check()?;
        let parsed = parse(i, *chunk).map_err(|fault| fault.into_error(input));
        progress.advance(chunk.text.len() as u64);
        parsed
    });
    parsed.collect::<Vec<Result<T>>>().into_iter().collect()
}

/// Returns the line that holds byte `at`.
pub(crate) fn line_at(input: &Input, at: usize) -> Location {
    Location::Line(1 + memchr::memchr_iter(b'\n', &input[..at]).count() as u64)
}

#[cfg(test)]
mod tests {
    //! Chunks of a text end with whole lines and together are all of it.

    use super::*;
    use crate::table::find_line_end;

    #[test]
    fn chunks_end_with_lines_and_cover_the_text() {
        let text: Vec<u8> = (0..200_000).flat_map(|i| format!(" {i}\r\n\n").into_bytes()).collect();
        let whole = TextChunk { text: &text, start: 7 };
        let chunks = whole.split(find_line_end);
        assert!(2 < chunks.len());
        let mut lines = chunks.iter().flat_map(|chunk| chunk.lines(find_line_end));
        for (i, (start, line)) in whole.lines(find_line_end).enumerate() {
            assert_eq!(line, i.to_string().as_bytes());
            assert_eq!(lines.next(), Some((start, line)));
        }
        assert_eq!(lines.next(), None);
        assert_eq!(TextChunk { text: b"", start: 0 }.split(find_line_end).len(), 0);
    }
}
