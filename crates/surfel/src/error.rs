//! Errors between a description and a picture.

use crate::description::Invalid;
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
    File(#[from] surfel_formats::Error),
    /// The renderer refused what these files hold.
    // Not named `source`: programs that print the chain of sources would print it twice.
    #[error("{}: {cause}", crate::names::list_files(files))]
    Content {
        /// The files.
        files: Vec<PathBuf>,
        /// The renderer's error.
        cause: surfel_core::Error,
    },
    /// The data lack something that the description asks for.
    #[error("{0}")]
    Unfit(String),
    /// A movie was not finished.
    #[error("{cause}; {n_done} of {n_frames} frames are kept, continue from there with --resume")]
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
        if let Self::Unfinished { cause, .. } = self {
            return cause.is_cancelled();
        }
        matches!(
            self,
            Self::Core(surfel_core::Error::Cancelled)
                | Self::File(surfel_formats::Error::Core(surfel_core::Error::Cancelled))
                | Self::Content { cause: surfel_core::Error::Cancelled, .. }
        )
    }
}

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;
