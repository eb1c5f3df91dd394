//! The header of a PCD file: the fields of a point and the number of points.

use crate::error::{Location, Result, shorten};
use crate::file::Input;
use crate::table::{MAX_FIELDS, NumberType};
use surfel_core::math::{DQuat, DVec3};
use surfel_core::words::counted;

/// Maximum bytes of a header: names of a thousand fields take a tenth of it.
const MAX_HEADER_LENGTH: usize = 1 << 17;

/// The header of a file.
pub(super) struct Header {
    /// Version in the words of the file, as in "0.7".
    pub version: String,
    /// Fields of a point in the order of the file.
    pub fields: Vec<PcdField>,
    /// Number of columns of an organised cloud, else the number of points.
    pub width: u64,
    /// Number of rows of an organised cloud, else 1.
    pub height: u64,
    /// Pose of the sensor in the coordinates of the points.
    pub viewpoint: Viewpoint,
    /// Encoding of the points.
    pub encoding: Encoding,
    /// First byte after the header.
    pub body: usize,
    /// Number of the line that begins there.
    pub body_line: u64,
}

/// The pose of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Viewpoint {
    pub position: DVec3,
    /// Rotation from the sensor's axes to those of the points.
    pub rotation: DQuat,
}

/// The encoding of the points after the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    /// All values of a field, then all of the next, compressed together by LZF.
    BinaryCompressed,
}

/// A field of a point: one number or several of a type.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PcdField {
    /// Name, as in the header; `_` is padding.
    pub name: String,
    /// Type of the numbers.
    pub number_type: NumberType,
    /// Number of the numbers.
    pub count: usize,
}

impl PcdField {
    /// Returns the bytes of the field in a binary point.
    pub fn size(&self) -> usize {
        self.number_type.size() * self.count
    }

    /// Returns true if the field's four bytes are blue, green, red and opacity.
    pub fn is_packed_color(&self) -> bool {
        let is_color = ["rgb", "rgba"].contains(&self.name.to_lowercase().as_str());
        is_color && self.count == 1 && self.number_type.size() == 4
    }
}

impl Header {
    /// Returns the number of points.
    pub fn n_points(&self) -> u64 {
        self.width * self.height
    }

    /// Returns true if the points are the grid of a sensor, row by row.
    pub fn is_organized(&self) -> bool {
        1 < self.width && 1 < self.height
    }

    /// Returns the bytes of a binary point.
    pub fn stride(&self) -> usize {
        self.fields.iter().map(PcdField::size).sum()
    }

    /// Returns the numbers of an ascii point.
    pub fn n_values(&self) -> usize {
        self.fields.iter().map(|field| field.count).sum()
    }
}

/// The lines of a header that say how points are stored, as far as they were read.
#[derive(Default)]
struct Entries {
    version: Option<String>,
    fields: Option<Vec<String>>,
    sizes: Option<Vec<usize>>,
    types: Option<Vec<char>>,
    counts: Option<Vec<usize>>,
    width: Option<u64>,
    height: Option<u64>,
    viewpoint: Option<Viewpoint>,
    points: Option<u64>,
}

/// Returns true if an input begins with the comment that programs write first, or with a key of the header after
/// comments.
pub(crate) fn is_pcd(input: &Input) -> bool {
    /// Number of first bytes among which the key is.
    const MAX_LENGTH: usize = 4096;
    let start = &input[..input.len().min(MAX_LENGTH)];
    let lines = start.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let first = lines.into_iter().find(|line| !line.is_empty() && !line.starts_with(b"#"));
    let is_key = |line: &[u8]| line.starts_with(b"VERSION ") || line.starts_with(b"FIELDS ");
    start.starts_with(b"# .PCD") || first.is_some_and(is_key)
}

/// Reads the header at the start of `input`.
pub(super) fn read_header(input: &Input) -> Result<Header> {
    let text = &input[..input.len().min(MAX_HEADER_LENGTH)];
    let mut entries = Entries::default();
    let mut at = 0;
    for number in 1.. {
        let malformed = |found: String, expected: &str| {
            input.malformed(Location::Line(number), found, expected, "the header is broken")
        };
        let rest = &text[at..];
        let Some(length) = memchr::memchr(b'\n', rest) else {
            return Err(malformed("no end of the header".into(), "a line `DATA`"));
        };
        let line = String::from_utf8_lossy(&rest[..length]);
        at += length + 1;
        let (key, values) =
            line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
        if key.is_empty() || key.starts_with('#') {
            continue;
        }
        if values.split_whitespace().nth(MAX_FIELDS).is_some() {
            let found = format!("`{key}` with more than {MAX_FIELDS} values");
            return Err(malformed(found, &format!("at most {MAX_FIELDS}")));
        }
        if key == "DATA" {
            let encoding = match values.trim() {
                "ascii" => Encoding::Ascii,
                "binary" => Encoding::Binary,
                "binary_compressed" => Encoding::BinaryCompressed,
                other => {
                    let found = format!("`DATA {}`", shorten(other));
                    return Err(malformed(found, "ascii, binary or binary_compressed"));
                }
            };
            let found = |(found, expected): (String, String)| malformed(found, &expected);
            let fields = entries.point_fields().map_err(found)?;
            let (width, height) = entries.dimensions().map_err(found)?;
            let version = entries.version.unwrap_or_else(|| "0.7".into());
            let viewpoint = entries.viewpoint.unwrap_or_default();
            let (body, body_line) = (at, number + 1);
            return Ok(Header {
                version,
                fields,
                width,
                height,
                viewpoint,
                encoding,
                body,
                body_line,
            });
        }
        let expected = entries.set(key, values);
        if let Err(expected) = expected {
            return Err(malformed(format!("`{}`", shorten(line.trim())), expected));
        }
    }
    unreachable!("a header has a line `DATA` or an end")
}

impl Entries {
    /// Stores the values of a line; fails with the content that was expected.
    fn set(&mut self, key: &str, values: &str) -> std::result::Result<(), &'static str> {
        let one = values.trim();
        let words = values.split_whitespace();
        match key {
            // Most programs write `.7`.
            "VERSION" if one.starts_with('.') => self.version = Some(format!("0{one}")),
            "VERSION" => self.version = Some(one.into()),
            // Version 0.5 says COLUMNS.
            "FIELDS" | "COLUMNS" => self.fields = Some(words.map(str::to_owned).collect()),
            "SIZE" => self.sizes = Some(numbers(words).ok_or("the bytes of each field")?),
            "TYPE" => {
                let types = words.map(|word| word.chars().next().filter(|_| word.len() == 1));
                self.types = Some(types.collect::<Option<_>>().ok_or("I, U or F for each field")?);
            }
            "COUNT" => self.counts = Some(numbers(words).ok_or("the numbers of each field")?),
            "WIDTH" => self.width = Some(one.parse().map_err(|_| "the points of a row")?),
            "HEIGHT" => self.height = Some(one.parse().map_err(|_| "the number of rows")?),
            "POINTS" => self.points = Some(one.parse().map_err(|_| "the number of points")?),
            // A viewpoint that is none is as good as no line.
            "VIEWPOINT" => {
                let numbers = words.map_while(|word| word.parse::<f64>().ok());
                let numbers: Vec<f64> = numbers.filter(|number| number.is_finite()).collect();
                self.viewpoint = viewpoint(&numbers);
            }
            _ => {
                return Err(
                    "VERSION, FIELDS, SIZE, TYPE, COUNT, WIDTH, HEIGHT, VIEWPOINT, POINTS or DATA",
                );
            }
        }
        Ok(())
    }

    /// Returns the fields; fails with what was found and what was expected.
    fn point_fields(&self) -> std::result::Result<Vec<PcdField>, (String, String)> {
        let missing = |key: &str| ("`DATA`".to_owned(), format!("a line `{key}` before it"));
        let names = self.fields.as_ref().ok_or_else(|| missing("FIELDS"))?;
        let sizes = self.sizes.as_ref().ok_or_else(|| missing("SIZE"))?;
        let types = self.types.as_ref().ok_or_else(|| missing("TYPE"))?;
        let counts = self.counts.clone().unwrap_or_else(|| vec![1; names.len()]);
        for (key, n) in [("SIZE", sizes.len()), ("TYPE", types.len()), ("COUNT", counts.len())] {
            if n != names.len() {
                let found = format!("{} of `{key}`", counted(n, "value"));
                return Err((found, format!("{}, one for each field", names.len())));
            }
        }
        let n_values = counts.iter().try_fold(0usize, |sum, count| sum.checked_add(*count));
        if n_values.is_none_or(|n| MAX_FIELDS < n) {
            let found = "a larger number of values in a point".into();
            return Err((found, format!("at most {MAX_FIELDS}")));
        }
        let fields = names.iter().zip(sizes).zip(types).zip(counts);
        fields
            .map(|(((name, size), type_letter), count)| {
                let number_type = number_type(*type_letter, *size).ok_or_else(|| {
                    let found =
                        format!("field `{}` of type {type_letter}, size {size}", shorten(name));
                    (found, "I or U of 1, 2, 4 or 8 bytes, or F of 4 or 8".to_owned())
                })?;
                Ok(PcdField { name: name.clone(), number_type, count })
            })
            .collect()
    }

    /// Returns width and height; fails with what was found and what was expected.
    fn dimensions(&self) -> std::result::Result<(u64, u64), (String, String)> {
        let (width, height) = match (self.width, self.height, self.points) {
            (Some(width), height, _) => (width, height.unwrap_or(1)),
            (None, _, Some(points)) => (points, 1),
            (None, _, None) => {
                return Err(("`DATA`".into(), "a line `WIDTH` or `POINTS` before it".into()));
            }
        };
        let product = width.checked_mul(height);
        let points = self.points.or(product);
        if product.is_none() || product != points {
            let points = points.map_or("no number".into(), |points| points.to_string());
            return Err((
                format!("a width of {width}, a height of {height}, {points} points"),
                "as many points as width times height".into(),
            ));
        }
        Ok((width, height))
    }
}

/// Returns the pose of a position and a quaternion w, x, y, z, which may be missing.
fn viewpoint(numbers: &[f64]) -> Option<Viewpoint> {
    let (position, rest) = numbers.split_first_chunk()?;
    let rotation = rest.first_chunk().and_then(|&[w, x, y, z]| {
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let length = rotation.length();
        (0.0 < length && length.is_finite()).then(|| rotation.normalize())
    });
    let position = DVec3::from_array(*position);
    Some(Viewpoint { position, rotation: rotation.unwrap_or_default() })
}

fn numbers<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Vec<usize>> {
    words.try_fold(Vec::new(), |mut numbers, word| {
        numbers.push(word.parse().ok()?);
        Some(numbers)
    })
}

fn number_type(letter: char, size: usize) -> Option<NumberType> {
    Some(match (letter, size) {
        ('I', 1) => NumberType::I8,
        ('I', 2) => NumberType::I16,
        ('I', 4) => NumberType::I32,
        ('I', 8) => NumberType::I64,
        ('U', 1) => NumberType::U8,
        ('U', 2) => NumberType::U16,
        ('U', 4) => NumberType::U32,
        ('U', 8) => NumberType::U64,
        ('F', 4) => NumberType::F32,
        ('F', 8) => NumberType::F64,
        _ => return None,
    })
}
