//! Rules of values: each reads a value of a scene file, as a number, a list or text, and writes it back.
//!
//! Text is also what a command line gives, so `"1,2,3"` and `[1, 2, 3]` are the same vector to every door.

use super::Invalid;
use super::spelling::nearest_if_any;
use serde_json::{Value, json};
use std::path::{Path, PathBuf, absolute};
use std::str::FromStr;

/// Reads and writes one kind of value.
pub trait Rule<T> {
    /// Reads a value; relative paths start at `folder`.
    ///
    /// # Errors
    ///
    /// Fails with what was expected.
    fn read(&self, value: &Value, folder: &Path) -> Result<T, Invalid>;

    /// Writes a value as a scene file has it.
    fn write(&self, value: &T) -> Value;

    /// Returns whether a key may be given without a value.
    fn arity(&self) -> Arity {
        Arity::One
    }

    /// Returns true if values may begin with a hyphen, as `-1,2,3` does.
    fn may_begin_with_hyphen(&self) -> bool {
        false
    }
}

/// The number of values that a key takes where words set it, as on a command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arity {
    /// One value.
    One,
    /// One value or none, which means `true`. The value is joined to the key, so that the next word is none.
    Optional,
}

/// Coordinates, lengths and factors stay below this: beyond, their squares are not finite in f32.
pub const MAX_LENGTH: f64 = 1e15;

pub(super) fn expected(what: impl std::fmt::Display) -> Invalid {
    Invalid::new(format!("expected {what}"))
}

/// A number from `low` to `high`, both included.
pub struct Number {
    /// Least number.
    pub low: f64,
    /// Greatest number.
    pub high: f64,
}

/// Returns the rule of numbers from `low` to `high`.
pub const fn number(low: f64, high: f64) -> Number {
    Number { low, high }
}

impl Rule<f64> for Number {
    fn read(&self, value: &Value, _: &Path) -> Result<f64, Invalid> {
        let number = as_number(value).filter(|number| (self.low..=self.high).contains(number));
        number.ok_or_else(|| match (self.low, self.high) {
            (low, f64::INFINITY) => expected(format_args!("a number from {low}")),
            (low, high) => expected(format_args!("a number from {low} to {high}")),
        })
    }

    fn write(&self, value: &f64) -> Value {
        json!(value)
    }
}

/// A number for which `allows` holds.
pub struct Checked {
    /// Returns true for numbers that are valid.
    pub allows: fn(f64) -> bool,
    /// Words for the valid values.
    pub expected: &'static str,
}

/// A length or factor above 0.
pub const POSITIVE: Checked =
    Checked { allows: |x| 1e-9 < x && x < MAX_LENGTH, expected: "a positive number" };

/// Degrees of a perspective camera's field of view.
pub const VIEW_ANGLE: Checked =
    Checked { allows: |x| (1e-6..180.0).contains(&x), expected: "degrees above 0 and below 180" };

impl Rule<f64> for Checked {
    fn read(&self, value: &Value, _: &Path) -> Result<f64, Invalid> {
        as_number(value).filter(|x| (self.allows)(*x)).ok_or_else(|| expected(self.expected))
    }

    fn write(&self, value: &f64) -> Value {
        json!(value)
    }
}

/// A whole number from `low` to `high`, both included.
pub struct Count {
    /// Least number.
    pub low: u64,
    /// Greatest number.
    pub high: u64,
}

/// Returns the rule of whole numbers from `low` to `high`.
pub const fn count(low: u64, high: u64) -> Count {
    Count { low, high }
}

impl Rule<u64> for Count {
    fn read(&self, value: &Value, _: &Path) -> Result<u64, Invalid> {
        let number = match value {
            Value::String(text) => text.trim().parse().ok(),
            // JavaScript writes whole numbers as `2.0` at times.
            value => value.as_u64().or_else(|| {
                value
                    .as_f64()
                    .filter(|x| x.fract() == 0.0 && 0.0 <= *x && *x < 2e15)
                    .map(|x| x as u64)
            }),
        };
        let number = number.filter(|number| (self.low..=self.high).contains(number));
        number.ok_or_else(|| match (self.low, self.high) {
            (low, u64::MAX) => expected(format_args!("a whole number from {low}")),
            (low, high) => expected(format_args!("a whole number from {low} to {high}")),
        })
    }

    fn write(&self, value: &u64) -> Value {
        json!(value)
    }
}

impl Rule<u32> for Count {
    fn read(&self, value: &Value, folder: &Path) -> Result<u32, Invalid> {
        let number: u64 = self.read(value, folder)?;
        u32::try_from(number).map_err(|_| expected(format_args!("at most {}", u32::MAX)))
    }

    fn write(&self, value: &u32) -> Value {
        json!(value)
    }
}

/// True or false.
pub struct Flag;

impl Rule<bool> for Flag {
    fn read(&self, value: &Value, _: &Path) -> Result<bool, Invalid> {
        match value {
            Value::Bool(flag) => Ok(*flag),
            Value::String(text) => text.trim().parse().map_err(|_| expected("true or false")),
            _ => Err(expected("true or false")),
        }
    }

    fn write(&self, value: &bool) -> Value {
        json!(value)
    }

    fn arity(&self) -> Arity {
        Arity::Optional
    }
}

/// Any text.
pub struct Text;

impl Rule<String> for Text {
    fn read(&self, value: &Value, _: &Path) -> Result<String, Invalid> {
        match value {
            Value::String(text) => Ok(text.clone()),
            // A name may look like a number.
            Value::Number(number) => Ok(number.to_string()),
            _ => Err(expected("a text in quotes")),
        }
    }

    fn write(&self, value: &String) -> Value {
        json!(value)
    }
}

/// Names of columns in a list, as in `x,y,z,-,r,g,b`.
pub struct ColumnNames;

impl Rule<String> for ColumnNames {
    fn read(&self, value: &Value, folder: &Path) -> Result<String, Invalid> {
        Text.read(value, folder)
    }

    fn write(&self, value: &String) -> Value {
        json!(value)
    }

    fn may_begin_with_hyphen(&self) -> bool {
        true
    }
}

/// Text that a type parses by itself; `text` writes it back.
pub struct Parsed<T> {
    /// Writes a value as text.
    pub text: fn(&T) -> String,
}

/// Returns the rule of a type that parses text; `text` writes it back.
pub const fn parsed<T>(text: fn(&T) -> String) -> Parsed<T> {
    Parsed { text }
}

impl<T: FromStr<Err = surfel_core::Error>> Rule<T> for Parsed<T> {
    fn read(&self, value: &Value, folder: &Path) -> Result<T, Invalid> {
        Text.read(value, folder)?.parse().map_err(from_core)
    }

    fn write(&self, value: &T) -> Value {
        json!((self.text)(value))
    }
}

/// Says what the library expected.
pub fn from_core(error: surfel_core::Error) -> Invalid {
    match error {
        surfel_core::Error::Setting { found, expected: what, .. } => {
            expected(format_args!("{what}{}", nearest_word(&found, what)))
        }
        surfel_core::Error::UnknownName { found, known, .. } => {
            expected(format_args!("one of {known}{}", nearest_if_any(&found, known.split(", "))))
        }
        other => Invalid::new(other.to_string()),
    }
}

/// Advises on a text by the nearest of the names in a list as `auto, none or viewpoint:x,y,z`; empty if none is near,
/// and for one of the names whose values are wrong.
fn nearest_word<'l>(found: &str, list: &'l str) -> String {
    let name_of = |item: &'l str| item.split([':', '[']).next().unwrap_or_default();
    let items = list.split(", ").flat_map(|items| items.split(" or "));
    let names: Vec<&str> = items.map(name_of).filter(|name| !name.contains(' ')).collect();
    let found_name = found.split(':').next().unwrap_or_default();
    if names.contains(&found_name) { String::new() } else { nearest_if_any(found, names) }
}

/// One of a few names.
pub struct OneOf<T: 'static>(pub &'static [(&'static str, T)]);

impl<T: Clone + PartialEq> Rule<T> for OneOf<T> {
    fn read(&self, value: &Value, _: &Path) -> Result<T, Invalid> {
        let known = self.0.iter().find(|(name, _)| value.as_str() == Some(name));
        known.map(|(_, value)| value.clone()).ok_or_else(|| {
            let names: Vec<&str> = self.0.iter().map(|(name, _)| *name).collect();
            let list = names.join(", ");
            let advice = nearest_if_any(value.as_str().unwrap_or_default(), names);
            expected(format_args!("one of {list}{advice}"))
        })
    }

    fn write(&self, value: &T) -> Value {
        let known = self.0.iter().find(|(_, known)| known == value);
        json!(known.map(|(name, _)| *name))
    }
}

/// Several names of a `OneOf`, as a list or separated by commas, each at most once.
pub struct SeveralOf<T: 'static>(pub OneOf<T>);

impl<T: Clone + PartialEq> Rule<Vec<T>> for SeveralOf<T> {
    fn read(&self, value: &Value, folder: &Path) -> Result<Vec<T>, Invalid> {
        let mut chosen = Vec::new();
        for name in as_list(value) {
            let choice = self.0.read(&name, folder)?;
            if !chosen.contains(&choice) {
                chosen.push(choice);
            }
        }
        Ok(chosen)
    }

    fn write(&self, value: &Vec<T>) -> Value {
        value.iter().map(|choice| self.0.write(choice)).collect()
    }
}

/// The path of a file, from the folder of the scene file that names it.
pub struct FilePath;

impl Rule<PathBuf> for FilePath {
    fn read(&self, value: &Value, folder: &Path) -> Result<PathBuf, Invalid> {
        let name = value.as_str().filter(|name| !name.is_empty());
        name.map(|name| folder.join(name)).ok_or_else(|| expected("the name of a file"))
    }

    fn write(&self, value: &PathBuf) -> Value {
        json!(absolute_text(value))
    }
}

/// Returns a path from the root, so that the scene that names it may lie anywhere.
pub fn absolute_text(path: &Path) -> String {
    absolute(path).unwrap_or_else(|_| path.to_owned()).display().to_string()
}

/// Width and height in pixels, as in `1920x1080`, `1920,1080` or `[1920, 1080]`.
pub struct Resolution;

impl Rule<(u32, u32)> for Resolution {
    fn read(&self, value: &Value, _: &Path) -> Result<(u32, u32), Invalid> {
        let text = match value {
            Value::String(text) => text.clone(),
            Value::Array(sides) => sides.iter().map(Value::to_string).collect::<Vec<_>>().join(","),
            _ => String::new(),
        };
        let sides = text.split_once(['x', ',']);
        let sides = sides.and_then(|(w, h)| Some((w.trim().parse().ok()?, h.trim().parse().ok()?)));
        let (width, height): (u32, u32) =
            sides.ok_or_else(|| expected("width and height as in 1920x1080"))?;
        let n_pixels = u64::from(width) * u64::from(height);
        let max = surfel_core::render::MAX_PIXELS;
        if (1..=max).contains(&n_pixels) {
            Ok((width, height))
        } else {
            Err(expected(format_args!("1 to {max} pixels in all")))
        }
    }

    fn write(&self, (width, height): &(u32, u32)) -> Value {
        json!(format!("{width}x{height}"))
    }
}

/// Two different numbers.
pub struct Interval;

impl Rule<(f64, f64)> for Interval {
    fn read(&self, value: &Value, _: &Path) -> Result<(f64, f64), Invalid> {
        match as_numbers(value).as_deref() {
            Some(&[low, high]) if low != high => Ok((low, high)),
            _ => Err(expected("two different numbers as in [0, 255]")),
        }
    }

    fn write(&self, (low, high): &(f64, f64)) -> Value {
        json!([low, high])
    }

    fn may_begin_with_hyphen(&self) -> bool {
        true
    }
}

/// A list of values of one rule.
pub struct List<R> {
    /// The rule of the elements.
    pub rule: R,
    /// Words for the valid values.
    pub expected: &'static str,
}

impl<T, R: Rule<T>> Rule<Vec<T>> for List<R> {
    fn read(&self, value: &Value, folder: &Path) -> Result<Vec<T>, Invalid> {
        let values = value.as_array().ok_or_else(|| expected(self.expected))?;
        let read = |value| self.rule.read(value, folder).map_err(|_| expected(self.expected));
        values.iter().map(read).collect()
    }

    fn write(&self, value: &Vec<T>) -> Value {
        value.iter().map(|value| self.rule.write(value)).collect()
    }
}

/// Any finite number.
pub const FINITE: Checked = Checked { allows: f64::is_finite, expected: "a number" };

/// Returns the number of a value, which may be text.
pub fn as_number(value: &Value) -> Option<f64> {
    let number = match value {
        Value::String(text) => text.trim().parse().ok(),
        value => value.as_f64(),
    };
    number.filter(|number: &f64| number.is_finite())
}

/// Returns the numbers of a list, or of text that separates them by commas.
pub fn as_numbers(value: &Value) -> Option<Vec<f64>> {
    if value.is_number() {
        return None;
    }
    as_list(value).iter().map(as_number).collect()
}

/// Returns the elements of a list; text is split at its commas, and any other value is the only element.
pub fn as_list(value: &Value) -> Vec<Value> {
    match value {
        Value::Array(values) => values.clone(),
        Value::String(text) => {
            text.split(',').map(|word| Value::String(word.trim().to_owned())).collect()
        }
        other => vec![other.clone()],
    }
}

#[cfg(test)]
pub(super) mod tests_of_rules {
    //! Functions for the tests of all rules.

    use super::*;

    /// Reads a value as JSON or as text.
    pub fn read<T, R: Rule<T>>(rule: R, text: &str) -> Result<T, String> {
        let value = serde_json::from_str(text).unwrap_or_else(|_| json!(text));
        rule.read(&value, Path::new("")).map_err(|error| error.to_string())
    }

    /// Checks that the value that a text says reads back equal when written.
    pub fn check<T: PartialEq + std::fmt::Debug>(rule: impl Rule<T>, text: &str) {
        let value = rule.read(&json!(text), Path::new("")).unwrap();
        assert_eq!(rule.read(&rule.write(&value), Path::new("")), Ok(value), "{text}");
    }
}

#[cfg(test)]
mod tests {
    //! Values are read as people write them, and nonsense is refused.

    use super::tests_of_rules::read;
    use super::*;

    #[test]
    fn values_are_read_in_all_spellings() {
        for text in ["64x48", "64,48", "[64, 48]"] {
            assert_eq!(read(Resolution, text), Ok((64, 48)), "{text}");
        }
        assert_eq!(read(Interval, "-1,2"), Ok((-1.0, 2.0)));
    }

    #[test]
    fn invalid_values_are_rejected() {
        for text in ["0x0", "x", "1920", "-1x5", "100000x100000", "5x"] {
            assert!(read(Resolution, text).is_err(), "{text}");
        }
        assert!(read(Interval, "1,1").is_err() && read(POSITIVE, "0").is_err());
        assert!(read(POSITIVE, "NaN").is_err() && read(POSITIVE, "inf").is_err());
    }
}
