//! What can go wrong in the library.

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    #[error("cancelled")]
    Cancelled,
    #[error("the cloud has no points")]
    EmptyCloud,
    #[error("{name} must be {expected}, found {found}")]
    Setting { name: &'static str, found: String, expected: &'static str },
}

pub type Result<T> = std::result::Result<T, Error>;
