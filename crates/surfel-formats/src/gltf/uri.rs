//! References to bytes: other files beside this one, and data written into the JSON.

use std::ops::Deref;
use std::path::PathBuf;

use super::json::{Json, shortened};
use crate::beside::Beside;
use crate::error::{Error, Result};
use crate::input::Input;

/// Bytes from wherever they came.
pub(super) enum Bytes<'a> {
    File(Input<'static>),
    Decoded(Vec<u8>),
    Chunk(&'a [u8]),
}

impl Deref for Bytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::File(input) => input,
            Self::Decoded(bytes) => bytes,
            Self::Chunk(bytes) => bytes,
        }
    }
}

/// Whether a reference has its bytes in itself.
pub(super) fn is_data(uri: &str) -> bool {
    strip_prefix_ignoring_case(uri, "data:").is_some()
}

/// What `reference` names: `data:` followed by the bytes, or a file beside that.
///
/// A path may lead up by `..`, as users lay out their folders; an absolute one or an address in a network
/// would make the picture depend on the machine, and is refused.
pub(super) fn fetch<'a>(beside: &Beside, reference: &Json<'a>) -> Result<Bytes<'a>> {
    let uri = reference.text()?;
    if let Some(data) = strip_prefix_ignoring_case(uri, "data:") {
        return decode_data(data).map(Bytes::Decoded).ok_or_else(|| {
            reference.error(format!("`{}`", shortened(uri)), "`data:` and bytes in Base64")
        });
    }
    let unfit = |advice| Error::Unsupported {
        file: reference.file().into(),
        action: "read",
        found: format!("the reference `{}` at {}", shortened(uri), reference.pointer()),
        advice,
    };
    let Some(folder) = beside.folder else {
        return Err(unfit("only a file on disk can have others beside it; pack all into one .glb"));
    };
    if is_absolute(uri) {
        return Err(unfit("copy what it names into the folder and write its relative path"));
    }
    let paths = candidates(uri).map(|path| folder.join(path));
    Input::open(beside.choose(&paths)).map(Bytes::File).map_err(|error| match error {
        Error::Io { file, cause, .. } => {
            let found = format!("`{}`, and {file} cannot be read ({cause})", shortened(uri));
            reference.error(found, "a file beside this one, copied along with it")
        }
        other => other,
    })
}

/// Whether a reference begins with a scheme (`https:`), a drive (`C:`) or the root.
fn is_absolute(uri: &str) -> bool {
    let scheme = uri.split(['/', '\\', '?', '#']).next().unwrap_or_default();
    let scheme = scheme.split_once(':').map_or("", |(scheme, _)| scheme);
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme || uri.starts_with(['/', '\\']) || decode_percent(uri).starts_with(b"/")
}

/// The paths that a reference may mean, the likeliest first: escaped as it should be, written as it is,
/// and as a program on Windows has it.
fn candidates(uri: &str) -> [PathBuf; 3] {
    let decoded = String::from_utf8(decode_percent(uri)).unwrap_or_else(|_| uri.into());
    let slashes = decoded.replace('\\', "/");
    [decoded.into(), uri.into(), slashes.into()]
}

/// What follows `data:`.
fn decode_data(data: &str) -> Option<Vec<u8>> {
    let (kind, payload) = data.split_once(',')?;
    if kind.to_ascii_lowercase().ends_with(";base64") {
        decode_base64(payload)
    } else {
        Some(decode_percent(payload))
    }
}

/// `%20` and the like as the bytes that they stand for; what is no such escape stays as it is.
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

/// Base64 in either alphabet, with or without padding.
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
    // Six bits alone are no byte.
    (n_bits < 6).then_some(decoded)
}

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let (start, rest) = text.split_at_checked(prefix.len())?;
    start.eq_ignore_ascii_case(prefix).then_some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded() {
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
    fn escapes_are_decoded_and_other_percents_kept() {
        assert_eq!(decode_percent("a%20b%2fc"), b"a b/c");
        assert_eq!(decode_percent("100%"), b"100%");
        assert_eq!(decode_percent("%4"), b"%4");
        assert_eq!(decode_percent("%zz%C3%A9"), "%zzé".as_bytes());
    }

    #[test]
    fn absolute_references_are_told_from_relative_ones() {
        for uri in ["/a", "\\\\server\\a", "C:\\a.bin", "http://a/b", "file:a", "%2Fetc/a"] {
            assert!(is_absolute(uri), "{uri}");
        }
        for uri in ["a.bin", "../a.bin", "a/b:c.bin", "ö:a", "a b.png", "1:2.png"] {
            assert!(!is_absolute(uri), "{uri}");
        }
    }
}
