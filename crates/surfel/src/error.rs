//! What can go wrong in the library.

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    #[error("cancelled")]
    Cancelled,
    #[error("the cloud has no points")]
    EmptyCloud,
    #[error("the cloud has {found} points; at most {limit} can be told apart")]
    TooManyPoints { found: usize, limit: usize },
    #[error("the tree has {found} blocks of eight; at most {limit} can be told apart")]
    TooManyBlocks { found: usize, limit: usize },
    #[error("{name} must be {expected}, found {found}")]
    Setting { name: &'static str, found: String, expected: &'static str },
    #[error("unknown {kind} '{found}'; known: {known}")]
    UnknownName { kind: &'static str, found: String, known: String },
}

pub type Result<T> = std::result::Result<T, Error>;
