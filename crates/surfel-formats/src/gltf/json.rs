//! Values of a JSON tree that know where they stand, so that each error can say so.

use serde_json::Value;

use crate::error::{Error, Place, Result};

pub(super) const ADVICE: &str =
    "export the file again; a glTF validator lists all that is wrong with it";

/// A value and the way to it.
#[derive(Clone)]
pub(super) struct Json<'a> {
    file: &'a str,
    /// A JSON pointer: `/accessors/3/count`.
    pointer: String,
    value: &'a Value,
}

impl<'a> Json<'a> {
    pub fn root(file: &'a str, value: &'a Value) -> Self {
        Self { file, pointer: String::new(), value }
    }

    pub fn file(&self) -> &'a str {
        self.file
    }

    pub fn pointer(&self) -> &str {
        &self.pointer
    }

    /// The text of the value, the same for equal values.
    pub fn source(&self) -> String {
        self.value.to_string()
    }

    pub fn error(&self, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Malformed {
            file: self.file.into(),
            place: Place::Json(self.pointer.clone()),
            found: found.into(),
            expected: expected.into(),
            advice: ADVICE,
        }
    }

    /// This value is not what it should be.
    pub fn unlike(&self, expected: impl Into<String>) -> Error {
        self.error(describe(self.value), expected)
    }

    /// A member that may be absent; null counts as absent.
    pub fn get(&self, key: &str) -> Option<Self> {
        let value = self.value.get(key).filter(|value| !value.is_null())?;
        Some(self.child(key, value))
    }

    pub fn need(&self, key: &str) -> Result<Self> {
        self.get(key).ok_or_else(|| match self.value {
            Value::Object(_) => self.error(format!("no `{key}`"), "one"),
            _ => self.unlike("an object"),
        })
    }

    /// The object that an extension keeps here.
    pub fn extension(&self, name: &str) -> Option<Self> {
        self.get("extensions")?.get(name)
    }

    /// The names and values of an object.
    pub fn members(&self) -> Result<impl Iterator<Item = (&'a str, Self)> + use<'a>> {
        let Value::Object(members) = self.value else { return Err(self.unlike("an object")) };
        let parent = self.clone();
        Ok(members.iter().map(move |(key, value)| (key.as_str(), parent.child(key, value))))
    }

    /// The entries of an array.
    pub fn items(&self) -> Result<impl ExactSizeIterator<Item = Self> + use<'a>> {
        let Value::Array(items) = self.value else { return Err(self.unlike("an array")) };
        let parent = self.clone();
        Ok(items.iter().enumerate().map(move |(i, value)| parent.child(&i.to_string(), value)))
    }

    /// The entries of a member that is an array; none if it is absent.
    pub fn list(&self, key: &str) -> Result<Vec<Self>> {
        self.get(key).map_or(Ok(Vec::new()), |list| Ok(list.items()?.collect()))
    }

    /// The object in the list `key` of this one that `reference` names by its index.
    pub fn referred(&self, key: &str, reference: &Self) -> Result<Self> {
        let index = reference.index()?;
        let items = self.value.get(key).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let Some(value) = items.get(index) else {
            let expected = format!("one of the {} `{key}`, counted from 0", items.len());
            return Err(reference.error(format!("index {index}"), expected));
        };
        let item = self.child(key, value).child(&index.to_string(), value);
        if value.is_object() { Ok(item) } else { Err(item.unlike("an object")) }
    }

    /// A count, an offset or a number that stands for something.
    pub fn unsigned(&self) -> Result<u64> {
        // Some programs write whole numbers with a point.
        let whole =
            |x: f64| (0.0 <= x && x < 2f64.powi(53) && x.fract() == 0.0).then_some(x as u64);
        let value = self.value.as_u64().or_else(|| self.value.as_f64().and_then(whole));
        value.ok_or_else(|| self.unlike("a whole number, 0 or more"))
    }

    /// One that this machine can count to.
    pub fn index(&self) -> Result<usize> {
        usize::try_from(self.unsigned()?).map_err(|_| self.unlike("a smaller number"))
    }

    /// Finite.
    pub fn number(&self) -> Result<f64> {
        self.value.as_f64().ok_or_else(|| self.unlike("a number"))
    }

    /// Finite, rounded to 32 bits.
    pub fn float(&self) -> Result<f32> {
        let value = self.number()? as f32;
        if value.is_finite() { Ok(value) } else { Err(self.unlike("a number of usual size")) }
    }

    pub fn numbers<const N: usize>(&self) -> Result<[f64; N]> {
        let values: Vec<f64> = self.items()?.map(|item| item.number()).collect::<Result<_>>()?;
        let n = values.len();
        values.try_into().map_err(|_| self.error(format!("{n} numbers"), format!("{N}")))
    }

    pub fn text(&self) -> Result<&'a str> {
        self.value.as_str().ok_or_else(|| self.unlike("a text"))
    }

    pub fn flag(&self) -> Result<bool> {
        self.value.as_bool().ok_or_else(|| self.unlike("true or false"))
    }

    pub fn unsigned_or(&self, key: &str, default: u64) -> Result<u64> {
        self.get(key).map_or(Ok(default), |value| value.unsigned())
    }

    pub fn float_or(&self, key: &str, default: f32) -> Result<f32> {
        self.get(key).map_or(Ok(default), |value| value.float())
    }

    pub fn flag_or(&self, key: &str, default: bool) -> Result<bool> {
        self.get(key).map_or(Ok(default), |value| value.flag())
    }

    /// Finite 32-bit numbers.
    pub fn floats_or<const N: usize>(&self, key: &str, default: [f32; N]) -> Result<[f32; N]> {
        let Some(list) = self.get(key) else { return Ok(default) };
        let values = list.numbers()?.map(|value: f64| value as f32);
        let is_usual = values.iter().all(|value| value.is_finite());
        if is_usual { Ok(values) } else { Err(list.unlike("numbers of usual size")) }
    }

    /// The name that the file gives this object, between quotes, or nothing.
    pub fn title(&self) -> String {
        let name = self.value.get("name").and_then(Value::as_str);
        name.map_or(String::new(), |name| format!(" `{}`", shortened(name)))
    }

    fn child(&self, key: &str, value: &'a Value) -> Self {
        let key = key.replace('~', "~0").replace('/', "~1");
        let pointer = format!("{}/{}", self.pointer, shortened(&key));
        Self { file: self.file, pointer, value }
    }
}

/// A value in few letters.
fn describe(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Object(_) => "an object".into(),
        Value::String(text) => format!("`{}`", shortened(text)),
        other => other.to_string(),
    }
}

/// The beginning of a text that may be megabytes long.
pub(super) fn shortened(text: &str) -> String {
    const LONGEST: usize = 60;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.into(),
    }
}
