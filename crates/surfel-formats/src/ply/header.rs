//! The header of a PLY file: elements and their properties.

use std::borrow::Cow;

use super::station_comment::parse_station;
use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::stations::MAX_STATIONS;
use crate::table::{MAX_FIELDS, MAX_LINE_LENGTH, NumberType};
use surfel_core::points::ScanStation;
use surfel_core::words::counted;

/// The header of a file.
pub(super) struct Header {
    /// Encoding of the elements.
    pub encoding: Encoding,
    /// Elements in the order of the file.
    pub elements: Vec<Element>,
    /// Names of texture files, which MeshLab writes in comments.
    pub textures: Vec<String>,
    /// Stations of the points, which surfel writes in comments.
    pub stations: Vec<ScanStation>,
    /// First byte after the header.
    pub body: usize,
    /// Number of the line that begins there.
    pub body_line: u64,
}

/// The encoding of the numbers after the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A kind of element, such as vertices or faces.
pub(super) struct Element {
    /// Name, as in the header.
    pub name: String,
    /// Number of the elements.
    pub count: u64,
    /// Properties in the order of the file.
    pub properties: Vec<Property>,
}

/// A property of an element: a number, or a list of them.
pub(super) struct Property {
    /// Name, as in the header.
    pub name: String,
    /// Type of the number, or of the items of a list.
    pub number_type: NumberType,
    /// Type of the length of a list; `None` if the property is one number.
    pub length_type: Option<NumberType>,
}

impl Element {
    /// Returns the bytes of one binary element; `None` if a list makes them vary.
    pub fn stride(&self) -> Option<usize> {
        let sizes = self.properties.iter().map(|property| match property.length_type {
            Some(_) => None,
            None => Some(property.number_type.size()),
        });
        sizes.sum()
    }

    /// Returns the error of a file that ends within these elements.
    pub fn ends_early(&self, input: &Input) -> Error {
        input.malformed(
            Location::Byte(input.len() as u64),
            "the end of the file",
            format!("{} `{}`", counted(self.count, "element"), self.name),
            "copy the file again from its source",
        )
    }

    /// Returns the error of a file that ends after `readable` of these elements, which are its points.
    pub fn truncated(&self, input: &Input, readable: u64) -> Error {
        input.truncated(Location::Byte(input.len() as u64), readable, self.count)
    }
}

/// Reads the header at the start of `input`.
pub(super) fn read_header(input: &Input) -> Result<Header> {
    let mut lines = Lines::new(input);
    let mut declarations = Declarations::default();
    loop {
        let number = lines.number;
        let malformed = |found: &str, expected: &str| {
            let found = format!("`{}`", found.chars().take(80).collect::<String>());
            input.malformed(Location::Line(number), found, expected, "the header is broken")
        };
        let Some(line) = lines.next() else {
            return Err(malformed("the end of the file", "`end_header`"));
        };
        if MAX_LINE_LENGTH < line.len() {
            let start = String::from_utf8_lossy(&line[..80]);
            return Err(malformed(&start, &format!("at most {MAX_LINE_LENGTH} bytes in a line")));
        }
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        if words != ["end_header"] {
            declarations.add(&line, &words).map_err(|expected| malformed(&line, &expected))?;
            continue;
        }
        let Declarations { encoding, elements, textures, stations } = declarations;
        let Some(encoding) = encoding else {
            return Err(malformed(&line, "a `format` line before it"));
        };
        let (body, body_line) = (lines.at, lines.number);
        return Ok(Header { encoding, elements, textures, stations, body, body_line });
    }
}

/// The content of the lines that were read so far.
#[derive(Default)]
struct Declarations {
    encoding: Option<Encoding>,
    elements: Vec<Element>,
    textures: Vec<String>,
    stations: Vec<ScanStation>,
}

impl Declarations {
    /// Adds a line, which consists of `words`; fails with what was expected.
    fn add(&mut self, line: &str, words: &[&str]) -> Result<(), Cow<'static, str>> {
        match words {
            ["comment", "TextureFile", ..] => {
                let name = line.split_once("TextureFile").map(|(_, name)| name.trim().to_owned());
                self.textures.extend(name);
            }
            ["comment", "station", ..] if self.stations.len() < MAX_STATIONS => {
                self.stations.extend(parse_station(words));
            }
            ["ply"] | ["comment" | "obj_info", ..] | [] => {}
            ["format", name, _version] => {
                let expected = "ascii, binary_little_endian or binary_big_endian";
                self.encoding = Some(parse_encoding(name).ok_or(expected)?);
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| "`element NAME COUNT`")?;
                let element = Element { name: (*name).into(), count, properties: Vec::new() };
                self.elements.push(element);
            }
            ["property", _, .., _] => self.add_property(words)?,
            _ => return Err("format, element, property, comment, obj_info or end_header".into()),
        }
        Ok(())
    }

    /// Adds a property to the last element; fails with what was expected.
    fn add_property(&mut self, words: &[&str]) -> Result<(), Cow<'static, str>> {
        let property = parse_property(words).ok_or(
            "`property TYPE NAME` or `property list TYPE TYPE NAME` with types such as float and uchar",
        )?;
        let element = self.elements.last_mut().ok_or("an element before its properties")?;
        if element.properties.len() == MAX_FIELDS {
            return Err(format!("at most {MAX_FIELDS} properties an element").into());
        }
        element.properties.push(property);
        Ok(())
    }
}

fn parse_encoding(name: &str) -> Option<Encoding> {
    Some(match name {
        "ascii" => Encoding::Ascii,
        "binary_little_endian" => Encoding::LittleEndian,
        "binary_big_endian" => Encoding::BigEndian,
        _ => return None,
    })
}

/// Returns the property that a line of words declares.
fn parse_property(words: &[&str]) -> Option<Property> {
    let (number_type, length_type, name) = match words {
        [_, number_type, name] => (parse_type(number_type)?, None, name),
        [_, "list", length, item, name] => {
            let length_type = parse_type(length).filter(|length| !length.is_float())?;
            (parse_type(item)?, Some(length_type), name)
        }
        _ => return None,
    };
    Some(Property { name: (*name).into(), number_type, length_type })
}

/// Returns the type of a name, old or new.
fn parse_type(name: &str) -> Option<NumberType> {
    Some(match name {
        "char" | "int8" => NumberType::I8,
        "uchar" | "uint8" => NumberType::U8,
        "short" | "int16" => NumberType::I16,
        "ushort" | "uint16" => NumberType::U16,
        "int" | "int32" => NumberType::I32,
        "uint" | "uint32" => NumberType::U32,
        "float" | "float32" => NumberType::F32,
        "double" | "float64" => NumberType::F64,
        "int64" => NumberType::I64,
        "uint64" => NumberType::U64,
        _ => return None,
    })
}

/// The lines of the header; the first line shows their line ending.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: u64,
    end: &'static [u8],
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let first_end = memchr::memchr2(b'\r', b'\n', bytes).unwrap_or(0);
        // The last line cannot show it: after a lone CR, binary data may begin with LF.
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
