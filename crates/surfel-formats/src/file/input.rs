//! The bytes of an input, with its name in messages.

use std::borrow::Cow;
use std::fs::File;
use std::io;
use std::ops::Deref;
use std::path::Path;

use crate::error::{Error, Location, Result};

/// Reads a text file of at most `max_bytes` bytes.
///
/// # Errors
///
/// Fails if the file cannot be read, is longer, or is not UTF-8.
pub fn load_text(path: &Path, max_bytes: usize) -> Result<String> {
    let input = Input::open(path)?;
    if max_bytes < input.len() {
        let found = format!("{} bytes where at most {max_bytes} are expected", input.len());
        return Err(input.unsupported(found, "check that it is the file you mean"));
    }
    let text = str::from_utf8(&input).map(str::to_owned);
    text.map_err(|_| {
        input.unsupported("bytes that are no text", "check that it is the file you mean")
    })
}

/// The bytes of an input, mapped from disk or borrowed.
pub(crate) struct Input<'a> {
    /// Name of the input in messages.
    pub name: Cow<'a, str>,
    bytes: Bytes<'a>,
}

enum Bytes<'a> {
    Mapped(memmap2::Mmap),
    Borrowed(&'a [u8]),
}

impl<'a> Input<'a> {
    /// Maps the file at `path`.
    pub fn open(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let failed = |cause: io::Error| Error::Io {
            file: name.clone(),
            action: "read",
            advice: match cause.kind() {
                io::ErrorKind::NotFound => "check the name and the folder",
                io::ErrorKind::PermissionDenied => "get permission to read it",
                _ => "check the disk and the connection to it",
            },
            cause,
        };
        // The kind is checked before opening, because opening a pipe waits for its writer.
        let kind = std::fs::metadata(path).map_err(failed)?.file_type();
        if !kind.is_file() {
            let (found, advice) = if kind.is_dir() {
                ("a folder", "name the files in it")
            } else {
                ("a pipe or device, not a regular file", "write it to a file first and name that")
            };
            return Err(Error::Unsupported {
                file: name,
                action: "read",
                found: found.into(),
                advice,
            });
        }
        let file = File::open(path).map_err(failed)?;
        let metadata = file.metadata().map_err(failed)?;
        // An empty file cannot be mapped.
        if metadata.len() == 0 {
            return Ok(Self { name: name.into(), bytes: Bytes::Borrowed(&[]) });
        }
        // SAFETY: the mapping is read only as plain bytes, all of whose values are valid. A file that
        // another program shortens meanwhile ends this one with SIGBUS, as it does every reader of
        // mapped files; reading by copy would hold every file in memory a second time.
        let map = unsafe { memmap2::Mmap::map(&file) }.map_err(failed)?;
        Ok(Self { name: name.into(), bytes: Bytes::Mapped(map) })
    }

    /// An input of bytes in memory.
    pub fn from_bytes(name: &'a str, bytes: &'a [u8]) -> Self {
        Self { name: name.into(), bytes: Bytes::Borrowed(bytes) }
    }

    /// Returns the error of content that breaks the rules of its format.
    pub fn malformed(
        &self,
        location: Location,
        found: impl Into<String>,
        expected: impl Into<String>,
        advice: impl Into<Cow<'static, str>>,
    ) -> Error {
        Error::Malformed {
            file: self.name.to_string(),
            location,
            found: found.into(),
            expected: expected.into(),
            advice: advice.into(),
        }
    }

    /// Returns the error of a file that ends at `location`, after `readable` of the points that it claims to hold.
    pub fn truncated(&self, location: Location, readable: u64, claimed: u64) -> Error {
        Error::Truncated {
            file: self.name.to_string(),
            location,
            readable,
            claimed,
            advice: "copy the file again from its source, or write it again".into(),
        }
    }

    /// Returns the error of content that surfel does not read.
    pub fn unsupported(&self, found: impl Into<String>, advice: &'static str) -> Error {
        Error::Unsupported {
            file: self.name.to_string(),
            action: "read",
            found: found.into(),
            advice,
        }
    }

    /// Returns the lower-case extension of the name, without the dot.
    pub fn extension(&self) -> String {
        let path = Path::new(self.name.as_ref());
        path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
    }
}

impl Deref for Input<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match &self.bytes {
            Bytes::Mapped(map) => map,
            Bytes::Borrowed(bytes) => bytes,
        }
    }
}
