//! The two file formats of glTF: plain JSON, and GLB, which holds JSON and a buffer in one file.

use serde_json::Value;
use surfel_core::words::counted;

use super::json::Json;
use crate::error::{Error, Location, Result, shorten};
use crate::file::Input;

/// First bytes of a GLB file.
const MAGIC: &[u8] = b"glTF";
const ADVICE: &str = "copy the file again from its source, or export it again";

/// The contents of a file.
pub(super) struct Container<'a> {
    /// The JSON of the document.
    pub json: Value,
    /// The buffer inside a GLB.
    pub bin_chunk: Option<&'a [u8]>,
    /// True for GLB.
    pub is_binary: bool,
}

impl Container<'_> {
    /// Returns the name of the format for users.
    pub fn format_name(&self) -> String {
        if self.is_binary { "glTF 2.0, binary" } else { "glTF 2.0" }.into()
    }
}

/// Rejects versions other than 2.x and files that require more than version 2.0.
pub(super) fn check_version(root: &Json) -> Result<()> {
    let asset = root.require("asset")?;
    let version = asset.require("version")?;
    let min_version = asset.get("minVersion");
    let is_2 = version.string()?.starts_with("2.");
    let is_supported = min_version.as_ref().map_or(Ok("2.0"), Json::string)? == "2.0";
    if is_2 && is_supported {
        return Ok(());
    }
    let found = min_version.filter(|_| is_2).unwrap_or(version).string()?;
    Err(Error::Unsupported {
        file: root.file().into(),
        action: "read",
        found: format!("glTF {}", shorten(found)),
        advice: "convert it to glTF 2.0",
    })
}

/// Splits a file into its JSON and buffer.
pub(super) fn open<'a>(input: &'a Input) -> Result<Container<'a>> {
    if input.is_empty() {
        let expected = "glTF as JSON or GLB";
        return Err(input.malformed(Location::Byte(0), "an empty file", expected, ADVICE));
    }
    let is_binary = input.starts_with(MAGIC);
    let (json, bin_chunk) = if is_binary { read_chunks(input)? } else { (&input[..], None) };
    Ok(Container { json: parse(input, json)?, bin_chunk, is_binary })
}

/// Returns the JSON chunk and, if there is one, the buffer of a GLB.
fn read_chunks<'a>(input: &'a Input) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let bytes: &[u8] = input;
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
        word.map(u32::from_le_bytes).ok_or_else(|| {
            let found = format!("the end of {}", counted(bytes.len(), "byte"));
            input.malformed(Location::Byte(at as u64), found, "a header of a GLB", ADVICE)
        })
    };
    let (version, length) = (word(4)?, word(8)? as usize);
    if version != 2 {
        let advice = "convert it to glTF 2.0";
        return Err(input.unsupported(format!("version {version} of GLB"), advice));
    }
    let Some(body) = bytes.get(..length) else {
        let found = counted(bytes.len(), "byte");
        let expected = format!("the {length} that its header announces");
        return Err(input.malformed(Location::Byte(8), found, expected, ADVICE));
    };
    let (mut json, mut buffer) = (None, None);
    let mut at = 12;
    while at + 8 <= body.len() {
        let (size, kind) = (word(at)? as usize, word(at + 4)?.to_le_bytes());
        let Some(chunk) = body[at + 8..].get(..size) else {
            let found = format!("a chunk of {}", counted(size, "byte"));
            let expected = format!("at most the {} that are left", body.len() - at - 8);
            return Err(input.malformed(Location::Byte(at as u64), found, expected, ADVICE));
        };
        match &kind {
            b"JSON" => json = json.or(Some(chunk)),
            b"BIN\0" => buffer = buffer.or(Some(chunk)),
            // The specification requires unknown chunks to be ignored.
            _ => {}
        }
        at += 8 + size;
    }
    let no_json = || input.malformed(Location::Byte(12), "no chunk `JSON`", "one", ADVICE);
    Ok((json.ok_or_else(no_json)?, buffer))
}

fn parse(input: &Input, bytes: &[u8]) -> Result<Value> {
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let value: Value = serde_json::from_slice(bytes).map_err(|error| {
        // The message of the error ends with line and column.
        let (location, found) = (Location::Line(error.line() as u64), error.to_string());
        let advice = "the file is damaged or not glTF; export it again";
        input.malformed(location, found, "JSON", advice)
    })?;
    if value.is_object() {
        return Ok(value);
    }
    let advice = "the file is not glTF; export it again";
    Err(input.malformed(Location::Line(1), "no object", "a JSON object", advice))
}
