//! What can go wrong with a file.

use std::fmt;
use std::io;

#[derive(Debug, thiserror::Error)]
pub enum Error {
    // Not named `source`: programs that print the chain of sources would print it a second time.
    #[error("{file}: cannot be {action}: {cause}; {advice}")]
    Io { file: String, action: &'static str, cause: io::Error, advice: &'static str },
    #[error("{file}: cannot be written: there is no folder `{folder}`; create it first")]
    NoFolder { file: String, folder: String },
    #[error("{file}: {place}: found {found}, expected {expected}; {advice}")]
    Malformed { file: String, place: Place, found: String, expected: String, advice: &'static str },
    #[error(
        "{file}: the file ends early, at {place}: {readable} of {claimed} points are complete; \
         copy the file again from its source, or write it again"
    )]
    Truncated { file: String, place: Place, readable: u64, claimed: u64 },
    #[error("{file}: found {found}, which surfel cannot {action}; {advice}")]
    Unsupported { file: String, action: &'static str, found: String, advice: &'static str },
    #[error("{file}: found {found}, expected {expected}; {advice}")]
    Frames { file: String, found: String, expected: String, advice: &'static str },
    #[error(
        "{file}: its frames were begun as `{found}`, and are now asked for as `{expected}`; \
         ask for the same again, or run without --resume to start again"
    )]
    OtherSettings { file: String, found: String, expected: String },
    #[error(
        "{file}: video is made by the program `{program}`, which was not found; install it \
         (https://ffmpeg.org, or from your system's packages), or write .gif, .png or \
         frame_####.png, which need no other program"
    )]
    NoEncoder { file: String, program: String },
    #[error("{file}: the program `{program}` failed: {message}; {advice}")]
    Encoder { file: String, program: String, message: String, advice: &'static str },
    #[error("{file}: {n_points} points do not fit in memory; load fewer columns or a smaller part")]
    OutOfMemory { file: String, n_points: u64 },
    #[error("{file}: has no animation `{wanted}`; there is {known}")]
    NoAnimation { file: String, wanted: String, known: String },
    #[error("no input file was named; name at least one")]
    NoInput,
    #[error(transparent)]
    Surfel(#[from] surfel::Error),
}

/// Where in a file something was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    Byte(u64),
    /// Counted from 1, as editors do.
    Line(u64),
    /// Counted from 0.
    Point(u64),
    /// A JSON pointer, as in `/accessors/3/count`.
    Json(String),
}

pub type Result<T, E = Error> = std::result::Result<T, E>;

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Point(point) => write!(f, "point {point}"),
            Self::Json(pointer) if pointer.is_empty() => f.write_str("the whole of its JSON"),
            Self::Json(pointer) => f.write_str(pointer),
        }
    }
}
