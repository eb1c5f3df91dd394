//! Errors of reading and writing files.

use std::borrow::Cow;
use std::fmt;
use std::io;
use surfel_core::words::{self, counted};

/// The error of an operation on a file; its message names the file and gives advice.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The system reports an error on a file.
    // Not named `source`: programs that print the chain of sources would print it a second time.
    #[error("{file}: cannot be {action}: {cause}; {advice}")]
    Io {
        /// Name of the file.
        file: String,
        /// Attempted action, as in "read" or "written".
        action: &'static str,
        /// The system's error.
        cause: io::Error,
        /// Advice to the user.
        advice: &'static str,
    },
    /// The folder of an output does not exist.
    #[error("{file}: cannot be written: there is no folder `{folder}`; create it first")]
    FolderNotFound {
        /// Name of the file.
        file: String,
        /// Folder that does not exist.
        folder: String,
    },
    /// The content of a file breaks the rules of its format.
    #[error("{file}: {location}: found {found}, expected {expected}; {advice}")]
    Malformed {
        /// Name of the file.
        file: String,
        /// Position of the wrong content.
        location: Location,
        /// The wrong content.
        found: String,
        /// The content that the format asks for.
        expected: String,
        /// Advice to the user.
        advice: Cow<'static, str>,
    },
    /// A file ends before its last point.
    #[error(
        "{file}: the file ends early, at {location}: {readable} of {} complete; {advice}",
        points_are(*claimed)
    )]
    Truncated {
        /// Name of the file.
        file: String,
        /// Position of the end.
        location: Location,
        /// Number of points that are complete.
        readable: u64,
        /// Number of points that the file claims to hold.
        claimed: u64,
        /// Advice to the user.
        advice: Cow<'static, str>,
    },
    /// surfel cannot read or write such a file.
    #[error("{file}: found {found}, which surfel cannot {action}; {advice}")]
    Unsupported {
        /// Name of the file.
        file: String,
        /// Attempted action: "read" or "write".
        action: &'static str,
        /// The unsupported content or name.
        found: String,
        /// Advice to the user.
        advice: &'static str,
    },
    /// The frames of a movie do not fit its options or one another.
    #[error("{file}: found {found}, expected {expected}; {advice}")]
    InvalidFrames {
        /// Name of the movie.
        file: String,
        /// The frames or options given.
        found: String,
        /// The frames or options that the movie needs.
        expected: String,
        /// Advice to the user.
        advice: &'static str,
    },
    /// The frames of an unfinished movie were rendered with other settings.
    #[error(
        "{file}: its frames were begun as `{found}`, and are now requested as `{expected}`; \
         request the same again, or start again instead of resuming [resume]"
    )]
    ResumeMismatch {
        /// Name of the movie.
        file: String,
        /// Settings of the frames that are there.
        found: String,
        /// Settings of this run.
        expected: String,
    },
    /// The program that encodes video is not installed.
    #[error(
        "{file}: video is encoded by the program `{program}`, which was not found; install it \
         (https://ffmpeg.org, or from your system's packages), or write .gif, .png or \
         frame_####.png, which need no other program"
    )]
    EncoderNotFound {
        /// Name of the movie.
        file: String,
        /// Name of the program.
        program: String,
    },
    /// The program that encodes video failed.
    #[error("{file}: the program `{program}` failed: {message}; {advice}")]
    EncoderFailed {
        /// Name of the movie.
        file: String,
        /// Name of the program.
        program: String,
        /// Message of the program.
        message: String,
        /// Advice to the user.
        advice: &'static str,
    },
    /// The columns of a cloud do not fit in memory.
    #[error("{file}: {n_points} points do not fit in memory; load fewer columns or a smaller part")]
    OutOfMemory {
        /// Name of the file.
        file: String,
        /// Number of points in the file.
        n_points: u64,
    },
    /// A glTF file has no animation of the requested name.
    #[error("{file}: has no animation `{requested}`; there is {known}")]
    UnknownAnimation {
        /// Name of the file.
        file: String,
        /// Name of the requested animation.
        requested: String,
        /// Names of the animations in the file, in words.
        known: String,
    },
    /// No file was named.
    #[error("no input file was named; name at least one")]
    NoInput,
    /// The renderer reports an error, or the work was cancelled.
    #[error(transparent)]
    Core(#[from] surfel_core::Error),
}

/// A position in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Location {
    /// Byte, counted from 0.
    Byte(u64),
    /// Line, counted from 1 as editors do.
    Line(u64),
    /// Point, counted from 0.
    Point(u64),
    /// Chunk of compressed points, counted from 0.
    Chunk(u64),
    /// JSON pointer, as in `/accessors/3/count`.
    Json(String),
}

/// The result of an operation on a file.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Returns true if the work was cancelled.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Core(surfel_core::Error::Cancelled))
    }

    /// Returns what is wrong with a damaged file, without its name and without advice.
    pub(crate) fn damage(&self) -> String {
        match self {
            Self::Truncated { location: chunk @ Location::Chunk(_), .. } => {
                format!("the file ends inside {chunk}")
            }
            Self::Truncated { location, .. } => format!("the file ends at {location}"),
            Self::Malformed { location, found, expected, .. } => {
                format!("found {found} at {location}, expected {expected}")
            }
            other => other.to_string(),
        }
    }
}

/// Cuts a text of a file for a message.
pub(crate) fn shorten(text: &str) -> String {
    const MAX_CHARS: usize = 60;
    words::shorten(text, MAX_CHARS)
}

/// Returns the number of points that a file claims, as the subject of a sentence.
fn points_are(claimed: u64) -> String {
    let verb = if claimed == 1 { "is" } else { "are" };
    format!("{} {verb}", counted(claimed, "point"))
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Point(point) => write!(f, "point {point}"),
            Self::Chunk(chunk) => write!(f, "chunk {chunk}"),
            Self::Json(pointer) if pointer.is_empty() => f.write_str("the whole of its JSON"),
            Self::Json(pointer) => f.write_str(pointer),
        }
    }
}
