//! The errors of the library.

use crate::words::counted;

/// An error of the library.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The caller cancelled the work through [`Progress`](crate::progress::Progress).
    #[error("cancelled")]
    Cancelled,
    /// A cloud has no points, or no valid ones.
    #[error("the cloud has no points")]
    EmptyCloud,
    /// A cloud has more points than 32-bit indices allow.
    #[error("the cloud has {found} points, which exceeds the limit of {limit} (32-bit indices)")]
    TooManyPoints {
        /// Number of points in the cloud.
        found: usize,
        /// Maximum number of points.
        limit: usize,
    },
    /// A tree has more leaf blocks than its nodes can reference.
    #[error(
        "the tree has {found} blocks of eight, which exceeds the limit of {limit} (32-bit indices)"
    )]
    TooManyBlocks {
        /// Number of blocks in the tree.
        found: usize,
        /// Maximum number of blocks.
        limit: usize,
    },
    /// A cloud lacks a column that tracing needs.
    #[error("the cloud has no {column}")]
    MissingColumn {
        /// Name of the column.
        column: &'static str,
    },
    /// A column does not have one entry for each point.
    #[error(
        "the column of {column} has {}, one for each of {} expected",
        entries(*found),
        counted(*expected, "point")
    )]
    ColumnLength {
        /// Name of the column.
        column: &'static str,
        /// Number of entries.
        found: usize,
        /// Number of points.
        expected: usize,
    },
    /// A position is NaN, infinite or too far from the origin.
    #[error("point {point_idx} has no valid position")]
    InvalidPosition {
        /// Index of the first such point.
        point_idx: usize,
    },
    /// A setting is out of its range.
    #[error("{name} must be {expected}, found {found}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// The value that was given.
        found: String,
        /// The values that are allowed.
        expected: &'static str,
    },
    /// A renderer's device failed, or cannot render the picture.
    #[error("{0}")]
    Renderer(String),
    /// A filter of points is not written as it should be.
    #[error("filter, character {character}: found {found}, expected {expected}")]
    Filter {
        /// Character of the filter, counted from 1.
        character: usize,
        /// Text that was found there.
        found: String,
        /// Text that was expected.
        expected: &'static str,
    },
    /// No entry of a list of named things has the given name.
    #[error("unknown {kind} '{found}'; known: {known}")]
    UnknownName {
        /// The kind of thing that the name should stand for.
        kind: &'static str,
        /// The name that was given.
        found: String,
        /// All known names.
        known: String,
    },
}

/// A result whose error is [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

fn entries(n: usize) -> String {
    if n == 1 { "1 entry".to_owned() } else { format!("{n} entries") }
}
