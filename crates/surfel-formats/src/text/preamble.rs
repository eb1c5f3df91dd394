//! Reads the lines before the points of a text file, and finds how its fields are separated.

use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::table::{ColumnRole, MAX_FIELDS, MAX_LINE_LENGTH, parse_number};

const ONE_POINT_PER_LINE: &str = "put each point on a line of its own";

/// The content of the lines before the first point, and the form of its line.
pub(super) struct Preamble {
    /// Names of the columns, from a header.
    pub names: Option<Vec<String>>,
    /// Number of points, if a line states it as in PTS files.
    pub count: Option<u64>,
    /// Separator of the columns.
    pub separator: Separator,
    /// Number of columns.
    pub n_fields: usize,
    /// First byte of the points.
    pub data: usize,
    /// First line of the points.
    pub data_line: u64,
}

/// The separator of the fields in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    Whitespace,
    Comma,
    Semicolon,
}

impl Separator {
    /// Returns the separator that a line uses.
    fn detect(line: &[u8]) -> Self {
        if line.contains(&b';') {
            Self::Semicolon
        } else if line.contains(&b',') {
            Self::Comma
        } else {
            Self::Whitespace
        }
    }

    /// Splits a line into trimmed fields.
    pub fn fields(self, line: &[u8]) -> impl Iterator<Item = &[u8]> {
        let separator = if self == Self::Semicolon { b';' } else { b',' };
        let is_separated = self != Self::Whitespace;
        line.split(
            move |byte| {
                if is_separated { *byte == separator } else { byte.is_ascii_whitespace() }
            },
        )
        .filter(move |field| is_separated || !field.is_empty())
        .map(|field| field.trim_ascii())
    }
}

/// Returns the text of a comment; `None` if the line is none.
pub(super) fn comment(line: &[u8]) -> Option<&[u8]> {
    line.strip_prefix(b"#").or_else(|| line.strip_prefix(b"//"))
}

/// Reads the lines up to the first one of numbers.
pub(super) fn read_preamble(input: &Input) -> Result<Preamble> {
    let mut names = None;
    // A comment may be a header or only mention x, y and z: the number of fields decides.
    let mut comment_names = None;
    let mut count = None;
    let mut at = 0;
    let mut line_number = 0;
    while at < input.len() {
        let rest = &input[at..];
        let near = &rest[..rest.len().min(MAX_LINE_LENGTH + 1)];
        let end = memchr::memchr(b'\n', near).map(|end| end + 1);
        if end.is_none() && near.len() < rest.len() {
            let expected = format!("lines of at most {MAX_LINE_LENGTH} bytes");
            return Err(input.malformed(
                Location::Line(line_number + 1),
                "a longer line",
                expected,
                ONE_POINT_PER_LINE,
            ));
        }
        let length = end.unwrap_or(rest.len());
        // Some programs put a byte order mark before UTF-8.
        let line = rest[..length].trim_ascii();
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        line_number += 1;
        let start = at;
        at += length;
        let (text, is_comment) = match comment(line) {
            Some(text) => (text.trim_ascii(), true),
            None => (line, false),
        };
        if text.is_empty() {
            continue;
        }
        let separator = Separator::detect(text);
        let has_too_many = separator.fields(text).nth(MAX_FIELDS).is_some();
        if has_too_many && is_comment {
            continue;
        }
        if has_too_many {
            let found = format!("more than {MAX_FIELDS} fields");
            let expected = format!("at most {MAX_FIELDS} in a line");
            return Err(input.malformed(
                Location::Line(line_number),
                found,
                expected,
                ONE_POINT_PER_LINE,
            ));
        }
        let fields: Vec<&[u8]> = separator.fields(text).collect();
        if is_comment {
            comment_names = column_names(&fields).or(comment_names);
            continue;
        }
        if let Some(header) = column_names(&fields) {
            names = Some(header);
            continue;
        }
        if let ([field], None) = (&fields[..], count)
            && let Ok(points) = String::from_utf8_lossy(field).parse()
        {
            count = Some(points);
            continue;
        }
        if fields.iter().all(|field| field.is_empty() || parse_number(field).is_ok()) {
            let has_empty_end = fields.last().is_some_and(|field| field.is_empty());
            let fits = |names: &Vec<String>| {
                names.len() == fields.len() || has_empty_end && names.len() + 1 == fields.len()
            };
            let names = names.or(comment_names.filter(fits));
            let n_names = names.as_ref().map_or(fields.len() - 1, Vec::len);
            // A separator at the end of each line does not begin a further column.
            let n_fields = if has_empty_end { n_names } else { fields.len() };
            return Ok(Preamble {
                names,
                count,
                separator,
                n_fields,
                data: start,
                data_line: line_number,
            });
        }
        return Err(not_numbers(input, Location::Line(line_number), text, separator));
    }
    let advice = "the file holds no points";
    Err(input.malformed(
        Location::Line(line_number),
        "no line with numbers",
        "x y z in each line",
        advice,
    ))
}

/// Returns the error of a line that holds neither numbers nor a header.
fn not_numbers(input: &Input, location: Location, text: &[u8], separator: Separator) -> Error {
    let found = format!("`{}`", text[..text.len().min(60)].escape_ascii());
    let has_inner_space =
        separator == Separator::Comma && separator.fields(text).any(|field| field.contains(&b' '));
    if has_inner_space || separator == Separator::Semicolon && text.contains(&b',') {
        let expected = "numbers with a decimal point, not a comma";
        return input.malformed(location, found, expected, "replace the decimal commas by points");
    }
    let expected = "numbers, or a header with at least x, y and z";
    input.malformed(location, found, expected, "remove the line or put # before it")
}

/// Returns the fields as names of columns, if x, y and z are among them.
fn column_names(fields: &[&[u8]]) -> Option<Vec<String>> {
    let mut names: Vec<String> = fields
        .iter()
        .map(|field| String::from_utf8_lossy(field).trim_matches(['"', '\'', ' ']).to_owned())
        .collect();
    if names.last().is_some_and(String::is_empty) {
        names.pop();
    }
    let has_axis = |axis| {
        names.iter().any(|name| ColumnRole::from_name(name) == Some(ColumnRole::Position(axis)))
    };
    (0..3).all(has_axis).then_some(names)
}
