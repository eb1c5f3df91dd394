//! The error for a value that makes no sense: its path, what was found and what was expected.

use serde_json::Value;
use std::fmt;
use std::path::PathBuf;
use surfel_core::words::shorten;

/// A key or value of a description that is not valid, from whichever door it came.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Invalid {
    /// The scene file that has it, if it came from one.
    pub file: Option<PathBuf>,
    /// Path of the key, as in `object[2].material.ior`; tables are counted from 0.
    pub path: String,
    /// The value as a scene file has it, if there is one to show.
    pub found: Option<String>,
    /// The fault, or `expected ...`.
    pub message: String,
}

/// Maximum number of characters of a value in a message.
const MAX_FOUND_CHARS: usize = 200;

impl Invalid {
    /// An error whose path and value are added on the way out.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), ..Self::default() }
    }

    /// An error at a path.
    pub fn at(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), message: message.into(), ..Self::default() }
    }

    /// Adds the value that was found, unless one is known.
    #[must_use]
    pub fn found(mut self, value: &Value) -> Self {
        self.found.get_or_insert_with(|| shorten(&value.to_string(), MAX_FOUND_CHARS));
        self
    }

    /// Adds the value that was found, unless the error is about a key inside it.
    #[must_use]
    pub(super) fn found_unless_nested(self, value: &Value) -> Self {
        if self.path.is_empty() { self.found(value) } else { self }
    }

    /// Puts a table or key in front of the path.
    #[must_use]
    pub fn within(mut self, table: &str) -> Self {
        self.path = match self.path.as_str() {
            "" => table.to_owned(),
            path if path.starts_with('[') => format!("{table}{path}"),
            path => format!("{table}.{path}"),
        };
        self
    }

    /// Names the scene file that has it.
    #[must_use]
    pub fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        self.file.get_or_insert(file.into());
        self
    }

    /// Says what is wrong, without file and path.
    pub fn reason(&self) -> String {
        match &self.found {
            Some(found) => format!("found {found}, {}", self.message),
            None => self.message.clone(),
        }
    }
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        f.write_str(&self.reason())
    }
}

impl std::error::Error for Invalid {}

#[cfg(test)]
mod tests {
    //! Values in messages.

    use super::*;

    #[test]
    fn long_values_are_cut() {
        let message = |n: usize| Invalid::new("expected less").found(&vec![1; n].into()).reason();
        assert_eq!(message(2), "found [1,1], expected less");
        assert!(message(100_000).len() < 300, "{}", message(100_000));
    }
}
