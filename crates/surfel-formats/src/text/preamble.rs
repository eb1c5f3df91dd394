//! Reads the lines before the points of a text file, and finds how its fields are separated.

use super::header::{column_names, roles_of_names};
use super::separator::{Separator, comment};
use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::table::{ColumnRole, MAX_FIELDS, MAX_LINE_LENGTH};

const ONE_POINT_PER_LINE: &str = "put each point on a line of its own";

/// First bytes of texts in UTF-8 with a byte order mark.
const UTF_8_MARK: &[u8] = b"\xef\xbb\xbf";
/// First bytes of texts in UTF-16, of both byte orders.
const UTF_16_MARKS: [&[u8]; 2] = [b"\xff\xfe", b"\xfe\xff"];

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
    /// True if each line ends with a list of any length, which is not read.
    pub has_list: bool,
    /// True if the first line of points holds text, too.
    pub has_text: bool,
    /// First byte of the points.
    pub data: usize,
    /// First line of the points.
    pub data_line: u64,
}

/// Reads the lines up to the first one of numbers.
pub(super) fn read_preamble(input: &Input) -> Result<Preamble> {
    if UTF_16_MARKS.iter().any(|mark| input.starts_with(mark)) {
        let advice = "save it as UTF-8 or as plain text";
        return Err(input.malformed(Location::Byte(0), "text in UTF-16", "UTF-8", advice));
    }
    let mut header = HeaderLines::default();
    // Some programs put a byte order mark before UTF-8.
    let mut at = if input.starts_with(UTF_8_MARK) { UTF_8_MARK.len() } else { 0 };
    let mut line_number = 0;
    while at < input.len() {
        let start = at;
        line_number += 1;
        let location = Location::Line(line_number);
        let line = line_at(input, at, &location)?;
        at += line.len();
        let line = line.trim_ascii();
        let (text, is_comment) = match comment(line) {
            Some(text) => (text.trim_ascii(), true),
            None => (line, false),
        };
        if text.is_empty() {
            continue;
        }
        let separator = header.separator_of(text);
        let has_too_many = separator.fields(text).nth(MAX_FIELDS).is_some();
        if has_too_many && is_comment {
            continue;
        }
        if has_too_many {
            let found = format!("more than {MAX_FIELDS} fields");
            let expected = format!("at most {MAX_FIELDS} in a line");
            return Err(input.malformed(location, found, expected, ONE_POINT_PER_LINE));
        }
        let fields: Vec<&[u8]> = separator.fields(text).collect();
        if header.take(&fields, separator, is_comment) {
            continue;
        }
        let preamble = header.before_points(&fields, separator, start, line_number);
        return preamble.ok_or_else(|| not_numbers(input, location, text));
    }
    let (found, expected) = ("no line with numbers", "x y z in each line");
    Err(input.malformed(Location::Line(line_number), found, expected, "the file holds no points"))
}

/// Returns the line that begins at a byte, with its end.
fn line_at<'a>(input: &'a Input, at: usize, location: &Location) -> Result<&'a [u8]> {
    let rest = &input[at..];
    let near = &rest[..rest.len().min(MAX_LINE_LENGTH + 1)];
    let end = memchr::memchr(b'\n', near).map(|end| end + 1);
    if end.is_none() && near.len() < rest.len() {
        let expected = format!("lines of at most {MAX_LINE_LENGTH} bytes");
        let found = "a longer line";
        return Err(input.malformed(location.clone(), found, expected, ONE_POINT_PER_LINE));
    }
    Ok(&rest[..end.unwrap_or(rest.len())])
}

/// The content of the lines before the points, as far as they were read.
#[derive(Default)]
struct HeaderLines {
    names: Option<Vec<String>>,
    /// Separator of the names.
    separator: Option<Separator>,
    /// Names in a comment. It may be a header or only mention x, y and z: the number of fields decides.
    comment_names: Option<Vec<String>>,
    /// True if a list of any length follows the names in a comment, as the track of a point of COLMAP.
    has_list: bool,
    /// Number of points.
    count: Option<u64>,
}

impl HeaderLines {
    /// Returns the separator of a line: that of the names, if it gives as many fields. Texts may hold the separators of
    /// other files.
    fn separator_of(&self, text: &[u8]) -> Separator {
        let n_names = self.names.as_ref().map_or(0, Vec::len);
        let fits = |separator: &Separator| {
            let n_fields = separator.fields(text).take(MAX_FIELDS).count();
            n_fields == n_names || separator.may_lack_fields(n_fields, n_names)
        };
        self.separator.filter(fits).unwrap_or_else(|| Separator::detect(text))
    }

    /// Keeps the content of a comment, of names and of a number of points. Returns false for any other line.
    fn take(&mut self, fields: &[&[u8]], separator: Separator, is_comment: bool) -> bool {
        if is_comment {
            if let Some(mut names) = column_names(fields) {
                let list = names.iter().position(|name| name.contains("[]"));
                names.truncate(list.unwrap_or(names.len()));
                self.has_list = list.is_some();
                self.comment_names = Some(names);
            }
            return true;
        }
        if let Some(names) = column_names(fields) {
            self.names = Some(names);
            self.separator = Some(separator);
            return true;
        }
        if let ([field], None) = (fields, self.count)
            && let Ok(points) = String::from_utf8_lossy(field).parse()
        {
            self.count = Some(points);
            return true;
        }
        false
    }

    /// Returns the preamble before the first line of points, which has these fields; `None` if they are no point.
    fn before_points(
        self,
        fields: &[&[u8]],
        separator: Separator,
        data: usize,
        data_line: u64,
    ) -> Option<Preamble> {
        let has_empty_end = fields.last().is_some_and(|field| field.is_empty());
        let fits = |names: &Vec<String>| {
            names.len() == fields.len()
                || self.has_list && names.len() < fields.len()
                || has_empty_end && names.len() + 1 == fields.len()
                || separator.may_lack_fields(fields.len(), names.len())
        };
        let header =
            self.names.as_ref().or(self.comment_names.as_ref()).filter(|names| fits(names));
        let is_number = |field: &&[u8]| separator.parse_number(field).is_ok();
        let has_text = !fields.iter().all(|field| field.is_empty() || is_number(field));
        let is_point = match header {
            Some(names) => has_numbers_on_axes(names, fields, is_number),
            None => 3 <= fields.iter().filter(|field| is_number(field)).count(),
        };
        if has_text && !is_point {
            return None;
        }
        let has_list = self.has_list && self.names.is_none() && header.is_some();
        let names = self.names.clone().or(self.comment_names.clone().filter(fits));
        let n_names = names.as_ref().map_or(fields.len() - 1, Vec::len);
        // A separator at the end of each line does not begin a further column.
        let has_cut_end =
            has_list || has_empty_end || separator.may_lack_fields(fields.len(), n_names);
        let n_fields = if has_cut_end { n_names } else { fields.len() };
        let count = self.count;
        Some(Preamble { names, count, separator, n_fields, has_list, has_text, data, data_line })
    }
}

/// Returns true if the fields of x, y and z are numbers.
fn has_numbers_on_axes(
    names: &[String],
    fields: &[&[u8]],
    is_number: impl Fn(&&[u8]) -> bool,
) -> bool {
    let roles = roles_of_names(names);
    let mut columns = roles.iter().zip(fields);
    columns.all(|(role, field)| !matches!(role, ColumnRole::Position(_)) || is_number(field))
}

/// Returns the error of a line that holds neither numbers nor a header.
fn not_numbers(input: &Input, location: Location, text: &[u8]) -> Error {
    let found = format!("`{}`", text[..text.len().min(60)].escape_ascii());
    let expected = "numbers, or a header with at least x, y and z, E, N and H or longitude, latitude and height";
    input.malformed(location, found, expected, "remove the line or put # before it")
}
