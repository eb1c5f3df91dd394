//! URIs of buffers and images: external files and `data:` URIs.

use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::json::Json;
use crate::error::{Error, Result, shorten};
use crate::file::{Input, ResourceResolver};

/// Bytes of a buffer or image and their storage.
pub(super) enum BufferData<'a> {
    /// An external file, which several buffers may name.
    File(Rc<Input<'static>>),
    /// Bytes decoded from a `data:` URI.
    DataUri(Vec<u8>),
    /// The buffer inside a GLB.
    BinChunk(&'a [u8]),
}

impl Deref for BufferData<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::File(input) => input,
            Self::DataUri(bytes) => bytes,
            Self::BinChunk(bytes) => bytes,
        }
    }
}

/// Returns true for a `data:` URI.
pub(super) fn is_data_uri(uri: &str) -> bool {
    strip_prefix_ignoring_case(uri, "data:").is_some()
}

/// Returns the bytes of the `data:` URI `reference`.
pub(super) fn read_data_uri(reference: &Json) -> Result<Vec<u8>> {
    let uri = reference.string()?;
    strip_prefix_ignoring_case(uri, "data:").and_then(decode_data_uri).ok_or_else(|| {
        reference.error(format!("`{}`", shorten(uri)), "`data:` and bytes in Base64")
    })
}

/// Returns the path of the file that the URI `reference` refers to, relative to the glTF file.
///
/// Relative paths may contain `..`. Absolute paths and network addresses are rejected, because they would
/// make the image depend on the machine.
pub(super) fn file_path(resolver: &ResourceResolver, reference: &Json) -> Result<PathBuf> {
    let uri = reference.string()?;
    let unsupported = |advice| Error::Unsupported {
        file: reference.file().into(),
        action: "read",
        found: format!("the reference `{}` at {}", shorten(uri), reference.pointer()),
        advice,
    };
    let Some(folder) = resolver.folder else {
        return Err(unsupported(
            "only a file on disk can have others beside it; pack all into one .glb",
        ));
    };
    if is_absolute(uri) {
        return Err(unsupported("copy the file into the folder and write its relative path"));
    }
    let paths = candidate_paths(uri).map(|path| folder.join(path));
    Ok(resolver.choose(&paths).to_owned())
}

/// Opens the file at `path`, which the URI `reference` refers to.
pub(super) fn open_file(path: &Path, reference: &Json) -> Result<Input<'static>> {
    let uri = reference.string()?;
    Input::open(path).map_err(|error| match error {
        Error::Io { file, cause, .. } => {
            let found = format!("`{}`, and {file} cannot be read ({cause})", shorten(uri));
            reference.error(found, "a file beside this one, copied along with it")
        }
        other => other,
    })
}

/// Returns true if a URI begins with a scheme (`https:`), a drive (`C:`) or the root, the latter two also in escapes.
fn is_absolute(uri: &str) -> bool {
    let decoded = decode_percent(uri);
    // The escapes of a scheme make it a part of a name, as in `a%3Ab.png`.
    let is_drive = matches!(*decoded, [letter, b':', ..] if letter.is_ascii_alphabetic());
    let scheme = uri.split(['/', '\\', '?', '#']).next().unwrap_or_default();
    let scheme = scheme.split_once(':').map_or("", |(scheme, _)| scheme);
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme || is_drive || matches!(decoded.first(), Some(b'/' | b'\\'))
}

/// Returns the paths that a URI may mean, most likely first: percent-decoded as the standard requires,
/// verbatim, and with the backslashes of Windows converted.
fn candidate_paths(uri: &str) -> [PathBuf; 3] {
    let decoded = String::from_utf8(decode_percent(uri)).unwrap_or_else(|_| uri.into());
    let slashes = decoded.replace('\\', "/");
    [decoded.into(), uri.into(), slashes.into()]
}

/// Decodes the part of a `data:` URI after the scheme.
fn decode_data_uri(data: &str) -> Option<Vec<u8>> {
    let (kind, payload) = data.split_once(',')?;
    if kind.to_ascii_lowercase().ends_with(";base64") {
        decode_base64(payload)
    } else {
        Some(decode_percent(payload))
    }
}

/// Decodes percent escapes such as `%20`. A percent sign that begins no escape stays.
fn decode_percent(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let digit = |at: usize| bytes.get(at).and_then(|byte| char::from(*byte).to_digit(16));
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        match (bytes[at], digit(at + 1), digit(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((16 * high + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    decoded
}

/// Decodes Base64 in the standard or URL-safe alphabet, with or without padding.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut decoded = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut n_bits) = (0_u32, 0);
    for byte in text.trim_end_matches('=').bytes() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        n_bits += 6;
        if 8 <= n_bits {
            n_bits -= 8;
            decoded.push((bits >> n_bits) as u8);
        }
    }
    // A single remaining character has only six bits: the input is incomplete.
    (n_bits < 6).then_some(decoded)
}

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let (start, rest) = text.split_at_checked(prefix.len())?;
    start.eq_ignore_ascii_case(prefix).then_some(rest)
}

#[cfg(test)]
mod tests {
    //! Tests of URI decoding.

    use super::*;

    #[test]
    fn base64_is_decoded_in_both_alphabets() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob")]
        {
            assert_eq!(decode_base64(text).unwrap(), bytes.as_bytes(), "{text}");
        }
        assert_eq!(decode_base64("-_+/"), Some(vec![0xfb, 0xff, 0xbf]));
        assert_eq!(decode_base64("Zm9vY"), None);
        assert_eq!(decode_base64("Zm 9v"), None);
    }

    #[test]
    fn percent_escapes_are_decoded_and_other_percent_signs_stay() {
        assert_eq!(decode_percent("a%20b%2fc"), b"a b/c");
        assert_eq!(decode_percent("100%"), b"100%");
        assert_eq!(decode_percent("%4"), b"%4");
        assert_eq!(decode_percent("%zz%C3%A9"), "%zzé".as_bytes());
    }

    #[test]
    fn absolute_uris_are_distinguished_from_relative_ones() {
        for uri in [
            "/a",
            "\\\\server\\a",
            "C:\\a.bin",
            "http://a/b",
            "file:a",
            "%2Fetc/a",
            "C%3A/secrets/a.png",
            "%43%3a%5Ca.png",
            "%5C%5Cserver%5Cshare%5Ca.png",
            "%5Ca",
        ] {
            assert!(is_absolute(uri), "{uri}");
        }
        for uri in [
            "a.bin",
            "../a.bin",
            "a/b:c.bin",
            "ö:a",
            "a b.png",
            "1:2.png",
            "ab%3Ac.png",
            "a%5Cb.png",
        ] {
            assert!(!is_absolute(uri), "{uri}");
        }
    }
}
