//! JSON values that know their JSON pointer, so that errors can name it.

use serde_json::Value;
use surfel_core::words::counted;

use crate::error::{Error, Location, Result, shorten};

pub(super) const ADVICE: &str = "export the file again; a glTF validator lists its errors";

/// A JSON value and its location. The typed getters return an error if the value has another type.
#[derive(Clone)]
pub(super) struct Json<'a> {
    file: &'a str,
    /// The JSON pointer of the value, such as `/accessors/3/count`.
    pointer: String,
    value: &'a Value,
}

impl<'a> Json<'a> {
    /// Returns the root value of a file. Messages call the file `file`.
    pub fn root(file: &'a str, value: &'a Value) -> Self {
        Self { file, pointer: String::new(), value }
    }

    /// Returns the name of the file.
    pub fn file(&self) -> &'a str {
        self.file
    }

    /// Returns the JSON pointer of the value.
    pub fn pointer(&self) -> &str {
        &self.pointer
    }

    /// Serialises the value. Equal values give equal texts.
    pub fn to_json_string(&self) -> String {
        self.value.to_string()
    }

    /// Returns an error at this value.
    pub fn error(&self, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Malformed {
            file: self.file.into(),
            location: Location::Json(self.pointer.clone()),
            found: found.into(),
            expected: expected.into(),
            advice: ADVICE.into(),
        }
    }

    /// Returns an error that this value is not `expected`.
    pub fn type_error(&self, expected: impl Into<String>) -> Error {
        self.error(describe(self.value), expected)
    }

    /// Returns a member of an object. A null value counts as absent.
    pub fn get(&self, key: &str) -> Option<Self> {
        let value = self.value.get(key).filter(|value| !value.is_null())?;
        Some(self.child(key, value))
    }

    /// Returns a member of an object, or an error if it is absent.
    pub fn require(&self, key: &str) -> Result<Self> {
        self.get(key).ok_or_else(|| match self.value {
            Value::Object(_) => self.error(format!("no `{key}`"), "one"),
            _ => self.type_error("an object"),
        })
    }

    /// Returns the object of an extension of this object.
    pub fn extension(&self, name: &str) -> Option<Self> {
        self.get("extensions")?.get(name)
    }

    /// Iterates over the members of an object.
    pub fn object(&self) -> Result<impl Iterator<Item = (&'a str, Self)> + use<'a>> {
        let Value::Object(members) = self.value else { return Err(self.type_error("an object")) };
        let parent = self.clone();
        Ok(members.iter().map(move |(key, value)| (key.as_str(), parent.child(key, value))))
    }

    /// Iterates over the items of an array.
    pub fn array(&self) -> Result<impl ExactSizeIterator<Item = Self> + use<'a>> {
        let Value::Array(items) = self.value else { return Err(self.type_error("an array")) };
        let parent = self.clone();
        Ok(items.iter().enumerate().map(move |(i, value)| parent.child(&i.to_string(), value)))
    }

    /// Returns the items of a member that is an array; no items if it is absent.
    pub fn array_or_empty(&self, key: &str) -> Result<Vec<Self>> {
        self.get(key).map_or(Ok(Vec::new()), |list| Ok(list.array()?.collect()))
    }

    /// Returns the object at the index `reference` in the array `key` of this object, or an error if the array
    /// has no such object.
    pub fn resolve(&self, key: &str, reference: &Self) -> Result<Self> {
        let index = reference.index()?;
        let items = self.value.get(key).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let Some(value) = items.get(index) else {
            let expected = match items.len() {
                1 => format!("0, since `{key}` has one object"),
                n => format!("one of the {n} `{key}`, counted from 0"),
            };
            return Err(reference.error(format!("index {index}"), expected));
        };
        let item = self.child(key, value).child(&index.to_string(), value);
        if value.is_object() { Ok(item) } else { Err(item.type_error("an object")) }
    }

    /// Returns a non-negative integer.
    pub fn unsigned(&self) -> Result<u64> {
        // Some exporters write integers with a decimal point.
        let whole =
            |x: f64| (0.0 <= x && x < 2f64.powi(53) && x.fract() == 0.0).then_some(x as u64);
        let value = self.value.as_u64().or_else(|| self.value.as_f64().and_then(whole));
        value.ok_or_else(|| self.type_error("a whole number, 0 or more"))
    }

    /// Returns a non-negative integer that fits in `usize`.
    pub fn index(&self) -> Result<usize> {
        usize::try_from(self.unsigned()?).map_err(|_| self.type_error("a smaller number"))
    }

    /// Returns a number, which JSON guarantees to be finite.
    pub fn number(&self) -> Result<f64> {
        self.value.as_f64().ok_or_else(|| self.type_error("a number"))
    }

    /// Returns a finite number rounded to 32 bits.
    pub fn float(&self) -> Result<f32> {
        let value = self.number()? as f32;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.type_error("a number in the range of 32-bit floats"))
        }
    }

    /// Returns an array of `N` numbers.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N]> {
        let values: Vec<f64> = self.array()?.map(|item| item.number()).collect::<Result<_>>()?;
        let n = values.len();
        values.try_into().map_err(|_| self.error(counted(n, "number"), format!("{N}")))
    }

    /// Returns a string.
    pub fn string(&self) -> Result<&'a str> {
        self.value.as_str().ok_or_else(|| self.type_error("a string"))
    }

    /// Returns a boolean.
    pub fn boolean(&self) -> Result<bool> {
        self.value.as_bool().ok_or_else(|| self.type_error("true or false"))
    }

    /// Returns the non-negative integer `key`, or `default` if it is absent.
    pub fn unsigned_or(&self, key: &str, default: u64) -> Result<u64> {
        self.get(key).map_or(Ok(default), |value| value.unsigned())
    }

    /// Returns the 32-bit number `key`, or `default` if it is absent.
    pub fn float_or(&self, key: &str, default: f32) -> Result<f32> {
        self.get(key).map_or(Ok(default), |value| value.float())
    }

    /// Returns the boolean `key`, or `default` if it is absent.
    pub fn boolean_or(&self, key: &str, default: bool) -> Result<bool> {
        self.get(key).map_or(Ok(default), |value| value.boolean())
    }

    /// Returns the array of 32-bit numbers `key`, or `default` if it is absent.
    pub fn floats_or<const N: usize>(&self, key: &str, default: [f32; N]) -> Result<[f32; N]> {
        let Some(list) = self.get(key) else { return Ok(default) };
        let values = list.numbers()?.map(|value: f64| value as f32);
        let is_finite = values.iter().all(|value| value.is_finite());
        if is_finite {
            Ok(values)
        } else {
            Err(list.type_error("numbers in the range of 32-bit floats"))
        }
    }

    /// Returns the member `name` in quotes after a space, or an empty text if there is none.
    pub fn quoted_name(&self) -> String {
        let name = self.value.get("name").and_then(Value::as_str);
        name.map_or(String::new(), |name| format!(" `{}`", shorten(name)))
    }

    fn child(&self, key: &str, value: &'a Value) -> Self {
        let key = key.replace('~', "~0").replace('/', "~1");
        let pointer = format!("{}/{}", self.pointer, shorten(&key));
        Self { file: self.file, pointer, value }
    }
}

/// Describes a value briefly.
fn describe(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Object(_) => "an object".into(),
        Value::String(text) => format!("`{}`", shorten(text)),
        other => other.to_string(),
    }
}
