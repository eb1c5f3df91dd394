//! Keys of a table, each taken once: those that are left are unknown.

use serde_json::{Map, Value};
use surfel::math::{DAffine3, DQuat, DVec3};
use surfel::scene::Transform;

/// A table of a scene file, with its name for messages.
pub struct Fields {
    name: String,
    map: Map<String, Value>,
    taken: Vec<String>,
}

impl Fields {
    pub fn new(name: String, map: Map<String, Value>) -> Self {
        // Both spellings are known: `focal-point` as on the command line, `focal_point` as in programs.
        let map = map.into_iter().map(|(key, value)| (key.replace('_', "-"), value)).collect();
        Self { name, map, taken: Vec::new() }
    }

    pub fn take(&mut self, key: &str) -> Option<Value> {
        self.taken.push(key.to_owned());
        self.map.remove(key)
    }

    pub fn peek(&self, key: &str) -> Option<&Value> {
        self.map.get(key)
    }

    pub fn error(&self, key: &str, found: &Value, expected: &str) -> String {
        format!("{}{key}: found {found}, expected {expected}", self.place())
    }

    fn place(&self) -> String {
        if self.name.is_empty() { String::new() } else { format!("{}: ", self.name) }
    }

    /// All that is left, which is to be known elsewhere.
    pub fn rest(&mut self) -> Map<String, Value> {
        std::mem::take(&mut self.map)
    }

    /// Fails at the first key that is none of `known`.
    pub fn check_known(&self, known: &[&str]) -> Result<(), String> {
        let unknown = self.map.keys().find(|key| !known.contains(&key.as_str()));
        unknown.map_or(Ok(()), |key| Err(self.unknown(key, known.iter().copied())))
    }

    /// Fails at the first key that nobody took.
    pub fn finish(&self) -> Result<(), String> {
        let left = self.map.keys().next();
        left.map_or(Ok(()), |key| Err(self.unknown(key, self.taken.iter().map(String::as_str))))
    }

    fn unknown<'k>(&self, key: &str, known: impl Iterator<Item = &'k str>) -> String {
        format!("{}: unknown key `{key}`{}", self.name, nearest(key, known))
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// The tables of `[[key]]`, named by it and their number.
    pub fn tables(&mut self, key: &str) -> Result<Vec<Self>, String> {
        let tables = match self.take(key) {
            None => return Ok(Vec::new()),
            Some(Value::Array(tables)) => tables,
            Some(table @ Value::Object(_)) => vec![table],
            Some(other) => return Err(self.error(key, &other, "tables")),
        };
        let named = tables.into_iter().enumerate().map(|(i, table)| match table {
            Value::Object(map) => Ok(Self::new(format!("{}{key} {}", self.place(), i + 1), map)),
            other => Err(self.error(key, &other, "a table")),
        });
        named.collect()
    }

    pub fn text(&mut self, key: &str) -> Result<Option<String>, String> {
        match self.take(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(other) => Err(self.error(key, &other, "a text in quotes")),
        }
    }

    pub fn flag(&mut self, key: &str) -> Result<Option<bool>, String> {
        match self.take(key) {
            None => Ok(None),
            Some(Value::Bool(flag)) => Ok(Some(flag)),
            Some(other) => Err(self.error(key, &other, "true or false")),
        }
    }

    /// A finite number for which `allowed` holds.
    pub fn number(
        &mut self,
        key: &str,
        expected: &str,
        allowed: impl Fn(f64) -> bool,
    ) -> Result<Option<f64>, String> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let number = value.as_f64().filter(|number| number.is_finite() && allowed(*number));
        number.map(Some).ok_or_else(|| self.error(key, &value, expected))
    }

    pub fn vector(&mut self, key: &str) -> Result<Option<DVec3>, String> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let found = vector(&value);
        found.map(Some).ok_or_else(|| self.error(key, &value, "three numbers as in [1, 2, 3]"))
    }

    pub fn vectors(&mut self, key: &str) -> Result<Option<Vec<DVec3>>, String> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let found = value.as_array().and_then(|all| all.iter().map(vector).collect());
        let expected = "vectors as in [[1, 2, 3], [4, 5, 6]]";
        found.map(Some).ok_or_else(|| self.error(key, &value, expected))
    }

    pub fn numbers(&mut self, key: &str) -> Result<Option<Vec<f64>>, String> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let number = |value: &Value| value.as_f64().filter(|number| number.is_finite());
        let found = value.as_array().and_then(|all| all.iter().map(number).collect());
        found.map(Some).ok_or_else(|| self.error(key, &value, "numbers as in [0, 1.5]"))
    }

    /// Where something stands: `matrix`, or `translate`, `rotate` and `scale`.
    pub fn transform(&mut self) -> Result<Transform, String> {
        if let Some(numbers) = self.numbers("matrix")? {
            if let Some(other) = PARTS.into_iter().find(|key| self.map.contains_key(*key)) {
                return Err(format!("{}: matrix stands alone; leave out {other}", self.name));
            }
            let rows: Result<[f64; 16], _> = numbers.try_into();
            let Ok(rows) = rows else {
                return Err(format!("{}: matrix: expected 16 numbers, row by row", self.name));
            };
            return self.checked("matrix", Transform::Matrix(affine(rows)));
        }
        let translation = self.vector("translate")?.unwrap_or(DVec3::ZERO);
        let rotation = self.rotation("rotate")?.unwrap_or(DQuat::IDENTITY);
        let scale = self.scale("scale")?.unwrap_or(DVec3::ONE);
        self.checked("scale", Transform::Parts { translation, rotation, scale })
    }

    fn checked(&self, key: &str, transform: Transform) -> Result<Transform, String> {
        let matrix = transform.matrix();
        let largest = matrix.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let volume = matrix.matrix3.determinant();
        if matrix.is_finite() && largest < LARGEST && volume != 0.0 {
            return Ok(transform);
        }
        Err(format!("{}: {key}: it leaves nothing to be seen, or makes it endless", self.name))
    }

    /// Degrees about X, then Y, then Z, or `{ axis = [0, 0, 1], angle = 30 }`.
    pub fn rotation(&mut self, key: &str) -> Result<Option<DQuat>, String> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let expected = "degrees about x, y and z as in [0, 0, 90], or an axis and an angle as in \
                        { axis = [0, 0, 1], angle = 90 }";
        rotation(&value).map(Some).ok_or_else(|| self.error(key, &value, expected))
    }

    fn scale(&mut self, key: &str) -> Result<Option<DVec3>, String> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let expected = "a number or three, below 1e15";
        scale(&value).map(Some).ok_or_else(|| self.error(key, &value, expected))
    }
}

/// Of a transform.
const PARTS: [&str; 3] = ["translate", "rotate", "scale"];

/// Lengths and factors stay below: beyond, their squares are no longer finite in f32.
const LARGEST: f64 = 1e15;

/// One factor for all axes, or three.
pub fn scale(value: &Value) -> Option<DVec3> {
    let even = value.as_f64().filter(|factor| factor.abs() < LARGEST).map(DVec3::splat);
    even.or_else(|| vector(value))
}

fn vector(value: &Value) -> Option<DVec3> {
    let [x, y, z] = value.as_array()?.as_slice() else { return None };
    let vector = DVec3::new(x.as_f64()?, y.as_f64()?, z.as_f64()?);
    (vector.is_finite() && vector.abs().max_element() < LARGEST).then_some(vector)
}

pub fn rotation(value: &Value) -> Option<DQuat> {
    if let Some(degrees) = vector(value) {
        let [x, y, z] = degrees.to_array().map(f64::to_radians);
        let about =
            (DQuat::from_rotation_x(x), DQuat::from_rotation_y(y), DQuat::from_rotation_z(z));
        return Some(about.2 * about.1 * about.0);
    }
    let table = value.as_object().filter(|table| table.len() == 2)?;
    let axis = vector(table.get("axis")?)?.try_normalize()?;
    Some(DQuat::from_axis_angle(axis, table.get("angle")?.as_f64()?.to_radians()))
}

/// From the rows of a 4x4 matrix, the last of which is left out.
fn affine(rows: [f64; 16]) -> DAffine3 {
    let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
    DAffine3::from_cols(column(0), column(1), column(2), column(3))
}

/// "; the nearest is `x`", or all that is known if nothing is near.
pub fn nearest<'k>(found: &str, known: impl Iterator<Item = &'k str>) -> String {
    let known: Vec<&str> = known.collect();
    let likeness = |name: &&&str| match strsim::osa_distance(found, name) {
        // Two letters of a short word in the wrong order, which the other measure takes for another word.
        0 | 1 => 1.0,
        _ => strsim::jaro_winkler(found, name),
    };
    let best = known.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    match best {
        Some(best) if 0.75 < likeness(&best) => {
            format!("; the nearest known one is `{best}`")
        }
        Some(_) => format!("; known: {}", known.join(", ")),
        None => String::new(),
    }
}
