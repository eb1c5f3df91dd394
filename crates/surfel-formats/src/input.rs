//! A file's bytes, with the name that messages give it.

use std::borrow::Cow;
use std::fs::File;
use std::io;
use std::ops::Deref;
use std::path::Path;

use crate::error::{Error, Place, Result};

/// Reads a text file of at most `most_bytes` bytes.
pub fn load_text(path: &Path, most_bytes: usize) -> Result<String> {
    let input = Input::open(path)?;
    if most_bytes < input.len() {
        let found = format!("{} bytes where at most {most_bytes} are expected", input.len());
        return Err(input.unsupported(found, "check that it is the file you mean"));
    }
    let text = str::from_utf8(&input).map(str::to_owned);
    text.map_err(|_| {
        input.unsupported("bytes that are no text", "check that it is the file you mean")
    })
}

/// The bytes of one input.
pub(crate) struct Input<'a> {
    pub name: Cow<'a, str>,
    bytes: Bytes<'a>,
}

enum Bytes<'a> {
    Mapped(memmap2::Mmap),
    Borrowed(&'a [u8]),
}

impl<'a> Input<'a> {
    pub fn open(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let failed = |cause: io::Error| Error::Io {
            file: name.clone(),
            action: "read",
            advice: match cause.kind() {
                io::ErrorKind::NotFound => "check the name and the folder",
                io::ErrorKind::PermissionDenied => "ask for the right to read it",
                _ => "check the disk and the connection to it",
            },
            cause,
        };
        // Asked before opening: to open a pipe is to wait for its writer.
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

    pub fn of_bytes(name: &'a str, bytes: &'a [u8]) -> Self {
        Self { name: name.into(), bytes: Bytes::Borrowed(bytes) }
    }

    pub fn malformed(
        &self,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
        advice: &'static str,
    ) -> Error {
        Error::Malformed {
            file: self.name.to_string(),
            place,
            found: found.into(),
            expected: expected.into(),
            advice,
        }
    }

    pub fn unsupported(&self, found: impl Into<String>, advice: &'static str) -> Error {
        Error::Unsupported {
            file: self.name.to_string(),
            action: "read",
            found: found.into(),
            advice,
        }
    }

    /// The lower-case extension of the name, without the dot.
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
