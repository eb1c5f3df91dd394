//! The two wrappings of glTF: plain JSON, and GLB, which has JSON and a buffer in one file.

use serde_json::Value;

use crate::error::{Place, Result};
use crate::input::Input;

const MAGIC: &[u8] = b"glTF";
const ADVICE: &str = "copy the file again from its source, or export it again";

/// What a file holds.
pub(super) struct Container<'a> {
    pub json: Value,
    /// The buffer that comes along in a GLB.
    pub chunk: Option<&'a [u8]>,
    pub is_binary: bool,
}

pub(super) fn open<'a>(input: &'a Input) -> Result<Container<'a>> {
    if input.is_empty() {
        let expected = "glTF as JSON or GLB";
        return Err(input.malformed(Place::Byte(0), "an empty file", expected, ADVICE));
    }
    let is_binary = input.starts_with(MAGIC);
    let (json, chunk) = if is_binary { chunks(input)? } else { (&input[..], None) };
    Ok(Container { json: parse(input, json)?, chunk, is_binary })
}

/// The JSON and, if there is one, the buffer of a GLB.
fn chunks<'a>(input: &'a Input) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let whole: &[u8] = input;
    let word = |at: usize| {
        let bytes = whole.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
        bytes.map(u32::from_le_bytes).ok_or_else(|| {
            let found = format!("the end of {} bytes", whole.len());
            input.malformed(Place::Byte(at as u64), found, "a header of a GLB", ADVICE)
        })
    };
    let (version, length) = (word(4)?, word(8)? as usize);
    if version != 2 {
        let advice = "convert it to glTF 2.0";
        return Err(input.unsupported(format!("version {version} of GLB"), advice));
    }
    let Some(body) = whole.get(..length) else {
        let found = format!("{} bytes", whole.len());
        let expected = format!("the {length} that its header announces");
        return Err(input.malformed(Place::Byte(8), found, expected, ADVICE));
    };
    let (mut json, mut buffer) = (None, None);
    let mut at = 12;
    while at + 8 <= body.len() {
        let (size, kind) = (word(at)? as usize, word(at + 4)?.to_le_bytes());
        let Some(chunk) = body[at + 8..].get(..size) else {
            let found = format!("a chunk of {size} bytes");
            let expected = format!("at most the {} that are left", body.len() - at - 8);
            return Err(input.malformed(Place::Byte(at as u64), found, expected, ADVICE));
        };
        match &kind {
            b"JSON" => json = json.or(Some(chunk)),
            b"BIN\0" => buffer = buffer.or(Some(chunk)),
            // Chunks of other kinds are for other programs.
            _ => {}
        }
        at += 8 + size;
    }
    let none = || input.malformed(Place::Byte(12), "no chunk `JSON`", "one", ADVICE);
    Ok((json.ok_or_else(none)?, buffer))
}

fn parse(input: &Input, bytes: &[u8]) -> Result<Value> {
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let value: Value = serde_json::from_slice(bytes).map_err(|error| {
        // Its message ends in line and column.
        let (place, found) = (Place::Line(error.line() as u64), error.to_string());
        let advice = "the file is damaged or not glTF; export it again";
        input.malformed(place, found, "JSON", advice)
    })?;
    if value.is_object() {
        return Ok(value);
    }
    let advice = "the file is not glTF; export it again";
    Err(input.malformed(Place::Line(1), "no object", "a JSON object", advice))
}
