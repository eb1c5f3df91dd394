//! Errors between a description and a picture.

use crate::description::{Invalid, with_nearest};
use crate::file_names::list_files;
use std::path::PathBuf;

/// An error of this crate. Its message names the file, the place in it, what was found and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A key or value of the description is not valid.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// The renderer refused its input, or was cancelled.
    #[error(transparent)]
    Core(#[from] surfel_core::Error),
    /// A file could not be read or written.
    #[error(transparent)]
    File(surfel_formats::Error),
    /// The renderer refused what these files hold.
    // Not named `source`: programs that print the chain of sources would print it twice.
    #[error("{}: {cause}", list_files(files))]
    Content {
        /// The files.
        files: Vec<PathBuf>,
        /// The renderer's error.
        cause: surfel_core::Error,
    },
    /// The data lack the column that a setting asks for.
    #[error("{}: {text} [{key}]", list_files(files))]
    MissingColumn {
        /// Files of the points.
        files: Vec<PathBuf>,
        /// Key of the setting.
        key: &'static str,
        /// The name that was found, and those that there are.
        text: String,
    },
    /// The data lack something that the description asks for.
    #[error("{0}")]
    Unfit(String),
    /// A filter keeps no point.
    #[error("{}no point meets {filter}{hint}", prefix(files))]
    NoPointKept {
        /// Files of the points; none if they are not told apart.
        files: Vec<PathBuf>,
        /// Key of the setting that is the filter; none if it is of several settings.
        key: Option<&'static str>,
        /// The filter, as a description has it.
        filter: String,
        /// A clause about where the area and the points lie, if they are apart; it begins with `; `.
        hint: String,
    },
    /// The system denies threads.
    #[error("the threads cannot be started; ask for fewer [threads]: {0}")]
    Threads(String),
    /// A movie was not finished.
    #[error("{cause}; {} kept, continue from there [resume]", frames(*n_done, *n_frames))]
    Unfinished {
        /// The reason.
        cause: Box<Error>,
        /// Number of finished frames.
        n_done: u32,
        /// Number of frames of the movie.
        n_frames: u32,
    },
    /// The work would take more memory than it may.
    #[error("{0}")]
    OutOfMemory(String),
}

impl Error {
    /// Returns true if the work was cancelled.
    pub fn is_cancelled(&self) -> bool {
        match self {
            Self::Unfinished { cause, .. } => cause.is_cancelled(),
            Self::File(error) => error.is_cancelled(),
            Self::Core(cause) | Self::Content { cause, .. } => {
                matches!(cause, surfel_core::Error::Cancelled)
            }
            _ => false,
        }
    }
}

impl From<surfel_formats::Error> for Error {
    fn from(error: surfel_formats::Error) -> Self {
        match error {
            surfel_formats::Error::Core(cause @ surfel_core::Error::UnknownName { .. }) => {
                Self::Unfit(with_nearest(&cause))
            }
            other => Self::File(other),
        }
    }
}

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Returns the start of a message about files.
fn prefix(files: &[PathBuf]) -> String {
    match files {
        [] => String::new(),
        files => format!("{}: ", list_files(files)),
    }
}

/// Returns how many frames of a movie are done, with the verb.
fn frames(n_done: u32, n_frames: u32) -> String {
    match n_done {
        n if n == n_frames => "all frames are".to_owned(),
        1 => format!("1 of {n_frames} frames is"),
        n => format!("{n} of {n_frames} frames are"),
    }
}

#[cfg(test)]
mod tests {
    //! Numbers of frames in words.

    use super::*;

    #[test]
    fn frames_that_are_kept_are_counted_in_words() {
        let texts = [(1, 3), (2, 3), (3, 3), (1, 1)].map(|(n_done, n)| frames(n_done, n));
        assert_eq!(
            texts,
            ["1 of 3 frames is", "2 of 3 frames are", "all frames are", "all frames are"]
        );
    }
}
