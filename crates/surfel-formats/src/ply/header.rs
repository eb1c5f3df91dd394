//! The header of a PLY file: elements and their properties.

use crate::error::{Place, Result};
use crate::input::Input;
use crate::lines::{LONGEST_LINE, MOST_FIELDS};
use crate::record::Kind;

pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// Files of textures, as MeshLab names them in comments.
    pub textures: Vec<String>,
    /// First byte behind the header, and the number of its line.
    pub body: usize,
    pub body_line: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

pub(super) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

pub(super) struct Property {
    pub name: String,
    pub kind: Kind,
    /// The kind of the length of a list.
    pub list: Option<Kind>,
}

impl Element {
    /// Bytes of one binary element, if all are the same.
    pub fn stride(&self) -> Option<usize> {
        let sizes = self.properties.iter().map(|property| match property.list {
            Some(_) => None,
            None => Some(property.kind.size()),
        });
        sizes.sum()
    }
}

/// Reads the header at the start of `input`.
pub(super) fn read_header(input: &Input) -> Result<Header> {
    let mut lines = Lines::new(input);
    let mut encoding = None;
    let mut textures = Vec::new();
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let number = lines.number;
        let malformed = |found: &str, expected: &str| {
            let found = format!("`{}`", found.chars().take(80).collect::<String>());
            input.malformed(Place::Line(number), found, expected, "the header is broken")
        };
        let Some(line) = lines.next() else {
            return Err(malformed("the end of the file", "`end_header`"));
        };
        if LONGEST_LINE < line.len() {
            let start = String::from_utf8_lossy(&line[..80]);
            return Err(malformed(&start, &format!("at most {LONGEST_LINE} bytes in a line")));
        }
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["comment", "TextureFile", ..] => {
                let name = line.split_once("TextureFile").map(|(_, name)| name.trim().to_owned());
                textures.extend(name);
            }
            ["ply"] | ["comment" | "obj_info", ..] | [] => {}
            ["format", name, _version] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => {
                        return Err(malformed(
                            &line,
                            "ascii, binary_little_endian or binary_big_endian",
                        ));
                    }
                });
            }
            ["element", name, count] => {
                let Ok(count) = count.parse() else {
                    return Err(malformed(&line, "`element NAME COUNT`"));
                };
                elements.push(Element { name: (*name).into(), count, properties: Vec::new() });
            }
            ["property", kind, .., name] => {
                let property = match words.as_slice() {
                    [_, _, _] => kind_of_name(kind).map(|kind| (kind, None)),
                    [_, "list", length, item, _] => kind_of_name(item)
                        .zip(kind_of_name(length).filter(|kind| !kind.is_float()))
                        .map(|(item, length)| (item, Some(length))),
                    _ => None,
                };
                let Some((kind, list)) = property else {
                    return Err(malformed(
                        &line,
                        "`property TYPE NAME` or `property list TYPE TYPE NAME` with types such as float and uchar",
                    ));
                };
                let Some(element) = elements.last_mut() else {
                    return Err(malformed(&line, "an element before its properties"));
                };
                if element.properties.len() == MOST_FIELDS {
                    let expected = format!("at most {MOST_FIELDS} properties an element");
                    return Err(malformed(&line, &expected));
                }
                element.properties.push(Property { name: (*name).into(), kind, list });
            }
            ["end_header"] => {
                let Some(encoding) = encoding else {
                    return Err(malformed(&line, "a `format` line before it"));
                };
                let (body, body_line) = (lines.at, lines.number);
                return Ok(Header { encoding, elements, textures, body, body_line });
            }
            _ => {
                return Err(malformed(
                    &line,
                    "format, element, property, comment, obj_info or end_header",
                ));
            }
        }
    }
}

fn kind_of_name(name: &str) -> Option<Kind> {
    Some(match name {
        "char" | "int8" => Kind::I8,
        "uchar" | "uint8" => Kind::U8,
        "short" | "int16" => Kind::I16,
        "ushort" | "uint16" => Kind::U16,
        "int" | "int32" => Kind::I32,
        "uint" | "uint32" => Kind::U32,
        "float" | "float32" => Kind::F32,
        "double" | "float64" => Kind::F64,
        "int64" => Kind::I64,
        "uint64" => Kind::U64,
        _ => return None,
    })
}

/// The lines of the header, whichever line ending its first line has.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: u64,
    end: &'static [u8],
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let first_end = memchr::memchr2(b'\r', b'\n', bytes).unwrap_or(0);
        // A lone CR cannot be told from CR LF at the last line, where binary data may begin with LF.
        let end: &[u8] = match &bytes[first_end..] {
            [b'\r', b'\n', ..] => b"\r\n",
            [b'\r', ..] => b"\r",
            _ => b"\n",
        };
        Self { bytes, at: 0, number: 1, end }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return None;
        }
        let length = memchr::memmem::find(rest, self.end);
        let line = &rest[..length.unwrap_or(rest.len())];
        self.at += length.map_or(rest.len(), |length| length + self.end.len());
        self.number += 1;
        Some(line)
    }
}
