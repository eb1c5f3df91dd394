//! How the fields of a line are separated, and how numbers are written between the separators.

use crate::table::{LineError, parse_number};

/// The separator of the fields in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    Whitespace,
    Tab,
    Comma,
    Semicolon,
}

/// Maximum length of a number with a decimal comma.
const MAX_NUMBER_LENGTH: usize = 64;

impl Separator {
    /// Returns the separator that a line uses. Tabs are one if there are texts with spaces between them, else
    /// whitespace of any kind.
    pub fn detect(line: &[u8]) -> Self {
        let has_spaces = |field: &[u8]| {
            let mut words = Self::Whitespace.fields(field);
            field.contains(&b' ') && !words.all(|word| Self::Whitespace.parse_number(word).is_ok())
        };
        if line.contains(&b';') {
            Self::Semicolon
        } else if line.contains(&b',') && !Self::has_decimal_commas(line) {
            Self::Comma
        } else if line.contains(&b'\t') && Self::Tab.fields(line).any(has_spaces) {
            Self::Tab
        } else {
            Self::Whitespace
        }
    }

    /// Returns true for at least three numbers between blanks in which commas stand for the decimal point.
    fn has_decimal_commas(line: &[u8]) -> bool {
        const MIN_NUMBERS: usize = 3;
        let mut words = Self::Whitespace.fields(line);
        let is_number = |word: &[u8]| {
            let has_comma_at_end = word.starts_with(b",") || word.ends_with(b",");
            !has_comma_at_end && Self::Whitespace.parse_number(word).is_ok()
        };
        words.clone().nth(MIN_NUMBERS - 1).is_some() && words.all(is_number)
    }

    /// Splits a line into trimmed fields. One in double quotes may hold separators; the quotes are left out.
    pub fn fields(self, line: &[u8]) -> Fields<'_> {
        Fields { separator: self, rest: Some(line) }
    }

    /// Returns true if a line of fewer fields than there are columns may have ended with empty cells, which were trimmed
    /// with the line.
    pub fn may_lack_fields(self, n_fields: usize, n_columns: usize) -> bool {
        self == Self::Tab && 1 < n_fields && n_fields < n_columns
    }

    /// Parses a number. A comma may stand for the decimal point, except between commas.
    pub fn parse_number(self, field: &[u8]) -> Result<f64, LineError> {
        if self != Self::Comma
            && field.len() <= MAX_NUMBER_LENGTH
            && let Some(comma) = memchr::memchr(b',', field)
        {
            let mut with_point = [0; MAX_NUMBER_LENGTH];
            with_point[..field.len()].copy_from_slice(field);
            with_point[comma] = b'.';
            // The error shows the number as it is in the file.
            return parse_number(&with_point[..field.len()]).or_else(|_| parse_number(field));
        }
        parse_number(field)
    }
}

/// The fields of a line.
#[derive(Clone)]
pub(super) struct Fields<'a> {
    separator: Separator,
    /// Bytes after the last separator; none at the end of the line.
    rest: Option<&'a [u8]>,
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let is_blank = |byte: &u8| match self.separator {
            Separator::Tab => *byte == b' ',
            _ => byte.is_ascii_whitespace(),
        };
        let rest = self.rest?;
        let rest = &rest[rest.iter().take_while(|byte| is_blank(byte)).count()..];
        if self.separator == Separator::Whitespace && rest.is_empty() {
            return None;
        }
        let quoted = quoted_length(rest);
        let end = quoted + self.find_separator(&rest[quoted..]);
        self.rest = rest.get(end + 1..);
        let field = rest[..end].trim_ascii_end();
        Some(if quoted == 0 { field } else { field[1..field.len().min(quoted) - 1].trim_ascii() })
    }
}

impl Fields<'_> {
    /// Returns the length of what comes before the next separator.
    fn find_separator(&self, bytes: &[u8]) -> usize {
        let found = match self.separator {
            Separator::Whitespace => bytes.iter().position(u8::is_ascii_whitespace),
            Separator::Tab => memchr::memchr(b'\t', bytes),
            Separator::Comma => memchr::memchr(b',', bytes),
            Separator::Semicolon => memchr::memchr(b';', bytes),
        };
        found.unwrap_or(bytes.len())
    }
}

/// Returns the length of the text in double quotes that `bytes` begin with, with the quotes; 0 if they do not. Two
/// quotes stand for one in the text.
fn quoted_length(bytes: &[u8]) -> usize {
    if bytes.first() != Some(&b'"') {
        return 0;
    }
    let mut at = 1;
    while let Some(quote) = memchr::memchr(b'"', &bytes[at..]) {
        at += quote + 1;
        if bytes.get(at) != Some(&b'"') {
            return at;
        }
        at += 1;
    }
    0
}

/// Returns the text of a comment; `None` if the line is none.
pub(super) fn comment(line: &[u8]) -> Option<&[u8]> {
    line.strip_prefix(b"#").or_else(|| line.strip_prefix(b"//"))
}

#[cfg(test)]
mod tests {
    //! Fields between separators, in quotes and at the ends, and decimal commas.

    use super::*;

    fn fields(line: &str) -> Vec<&str> {
        let separator = Separator::detect(line.as_bytes());
        separator.fields(line.as_bytes()).map(|field| str::from_utf8(field).unwrap()).collect()
    }

    #[test]
    fn fields_are_trimmed_and_may_be_quoted_or_empty() {
        assert_eq!(fields(" 1  2\t3 "), ["1", "2", "3"]);
        assert_eq!(fields("1, 2,,3,"), ["1", "2", "", "3", ""]);
        assert_eq!(fields("\"a, b\",1,\"c \"\"d\"\"\" ,"), ["a, b", "1", "c \"\"d\"\"", ""]);
        assert_eq!(fields("\"oak tree\" 1 2"), ["oak tree", "1", "2"]);
        assert_eq!(fields("oak tree\t1 \t\t3"), ["oak tree", "1", "", "3"]);
        assert_eq!(fields("1\t 2 3 "), ["1", "2", "3"]);
        assert_eq!(fields("\"open,1"), ["\"open", "1"]);
        assert_eq!(fields("\"\";5\""), ["", "5\""]);
        assert_eq!(fields("\"a\"b,1"), ["a", "1"]);
    }

    #[test]
    fn decimal_commas_are_read_except_between_commas() {
        for separator in [Separator::Semicolon, Separator::Tab, Separator::Whitespace] {
            let number = |text: &str| separator.parse_number(text.as_bytes()).ok();
            assert_eq!(number("1,5"), Some(1.5));
            assert_eq!(number("-0.5"), Some(-0.5));
            assert_eq!(number("1.000,5"), None);
        }
        assert!(Separator::Comma.parse_number(b"1,5").is_err());
    }

    #[test]
    fn decimal_commas_do_not_separate() {
        assert_eq!(fields("1,5\t-2,5 3"), ["1,5", "-2,5", "3"]);
        assert_eq!(fields("1,5 2,5"), ["1", "5 2", "5"]);
        assert_eq!(fields("1, 2, 3"), ["1", "2", "3"]);
        assert_eq!(fields("1 ,2 ,3"), ["1", "2", "3"]);
        assert_eq!(fields("1,2,3 4,5,6 7,8,9").len(), 7);
    }
}
