//! Rules of values: each reads a value of a scene file, as a number, a list or text, and writes it back.
//!
//! Text is also what a command line gives, so `"1,2,3"` and `[1, 2, 3]` are the same vector to every door.

use super::Invalid;
use super::nearest::nearest;
use serde_json::{Value, json};
use std::path::{Path, PathBuf, absolute};
use std::str::FromStr;
use surfel_core::image::{Colormap, decode_srgb8, encode_srgb};
use surfel_core::math::{DVec3, Vec3};
use surfel_core::scene::color::ColorSource;
use surfel_core::scene::{Background, ClipBox, ClipPlane};

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
}

/// Coordinates, lengths and factors stay below this: beyond, their squares are not finite in f32.
pub const MAX_LENGTH: f64 = 1e15;

fn expected(what: impl std::fmt::Display) -> Invalid {
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
        surfel_core::Error::Setting { expected: what, .. } => expected(what),
        surfel_core::Error::UnknownName { found, known, .. } => {
            expected(format_args!("one of {known}{}", did_you_mean(&found, &known)))
        }
        other => Invalid::new(other.to_string()),
    }
}

fn did_you_mean(found: &str, known: &str) -> String {
    let advice = nearest(found, known.split(", "));
    if advice.starts_with("; the nearest") { advice } else { String::new() }
}

/// One of a few names.
pub struct OneOf<T: 'static>(pub &'static [(&'static str, T)]);

impl<T: Clone + PartialEq> Rule<T> for OneOf<T> {
    fn read(&self, value: &Value, _: &Path) -> Result<T, Invalid> {
        let known = self.0.iter().find(|(name, _)| value.as_str() == Some(name));
        known.map(|(_, value)| value.clone()).ok_or_else(|| {
            let names: Vec<&str> = self.0.iter().map(|(name, _)| *name).collect();
            let names = names.join(", ");
            expected(format_args!(
                "one of {names}{}",
                did_you_mean(value.as_str().unwrap_or_default(), &names)
            ))
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

/// Three finite numbers.
pub struct Vector;

impl Rule<DVec3> for Vector {
    fn read(&self, value: &Value, _: &Path) -> Result<DVec3, Invalid> {
        let vector = as_numbers(value).and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
        let vector = vector.ok_or_else(|| expected("three numbers as in [1.5, -2, 0]"))?;
        let vector = DVec3::from_array(vector);
        if vector.abs().max_element() < MAX_LENGTH {
            Ok(vector)
        } else {
            Err(expected("numbers below 1e15"))
        }
    }

    fn write(&self, value: &DVec3) -> Value {
        json!(value.to_array())
    }
}

/// A vector of length 1; others are normalised.
pub struct Direction;

impl Rule<DVec3> for Direction {
    fn read(&self, value: &Value, folder: &Path) -> Result<DVec3, Invalid> {
        let vector = Vector.read(value, folder)?;
        if (vector.length_squared() - 1.0).abs() < 1e-6 {
            // A direction that was written comes back bit by bit.
            return Ok(vector);
        }
        vector.try_normalize().ok_or_else(|| expected("a direction other than [0, 0, 0]"))
    }

    fn write(&self, value: &DVec3) -> Value {
        json!(value.to_array())
    }
}

/// A direction, or the name of an axis as in `+Z`.
pub struct Axis;

impl Rule<Vec3> for Axis {
    fn read(&self, value: &Value, folder: &Path) -> Result<Vec3, Invalid> {
        let wrong = || expected("+X, -X, +Y, -Y, +Z, -Z or a direction as in [0, 0, 1]");
        let text = value.as_str().unwrap_or_default().trim();
        let (sign, axis) = match text.strip_prefix('-') {
            Some(axis) => (-1.0, axis),
            None => (1.0, text.strip_prefix('+').unwrap_or(text)),
        };
        match axis {
            "X" | "x" => Ok(sign * Vec3::X),
            "Y" | "y" => Ok(sign * Vec3::Y),
            "Z" | "z" => Ok(sign * Vec3::Z),
            _ => Ok(Direction.read(value, folder).map_err(|_| wrong())?.as_vec3()),
        }
    }

    fn write(&self, value: &Vec3) -> Value {
        json!(value.to_array())
    }
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
}

/// A linear colour, as `#RRGGBB`, `#RGB` or a name of CSS.
pub struct Color;

const COLOR: &str = "a colour as in #aabbcc or steelblue";

impl Rule<Vec3> for Color {
    fn read(&self, value: &Value, _: &Path) -> Result<Vec3, Invalid> {
        let color = value.as_str().and_then(srgb_color);
        color.map(to_linear).ok_or_else(|| expected(COLOR))
    }

    fn write(&self, value: &Vec3) -> Value {
        json!(hex(*value))
    }
}

/// Returns a colour by its hexadecimal digits or its CSS name, sRGB-encoded.
pub fn srgb_color(text: &str) -> Option<[u8; 3]> {
    let text = text.trim();
    let is_hex = text.starts_with('#') && [4, 7].contains(&text.len());
    let is_name = text.bytes().all(|byte| byte.is_ascii_alphabetic()) && text != "transparent";
    let color = (is_hex || is_name).then(|| csscolorparser::parse(text).ok())??;
    let [r, g, b, _] = color.to_rgba8();
    Some([r, g, b])
}

fn to_linear(srgb: [u8; 3]) -> Vec3 {
    Vec3::from_array(srgb.map(decode_srgb8))
}

fn hex(linear: Vec3) -> String {
    let byte = |value: f32| (255.0 * encode_srgb(value)).round() as u8;
    let [r, g, b] = linear.to_array().map(byte);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// One colour, two from top to bottom, or the name of a background.
pub struct BackgroundRule;

/// Dark enough at the top for light stone to stand out, light enough at the bottom for dark things.
const GRADIENT: [&str; 2] = ["#6f7c8a", "#c9ced3"];

/// Returns the background of pictures that name none.
pub fn default_background() -> Background {
    let [top, bottom] = GRADIENT.map(|color| to_linear(srgb_color(color).unwrap_or_default()));
    Background::Gradient { top, bottom }
}

impl Rule<Background> for BackgroundRule {
    fn read(&self, value: &Value, _: &Path) -> Result<Background, Invalid> {
        match value.as_str() {
            Some("transparent") => return Ok(Background::Transparent),
            Some("environment") => return Ok(Background::Environment),
            Some("gradient") => return Ok(default_background()),
            _ => {}
        }
        let colors = as_list(value);
        let colors: Option<Vec<Vec3>> =
            colors.iter().map(|color| color.as_str().and_then(srgb_color).map(to_linear)).collect();
        match colors.as_deref() {
            Some(&[plain]) => Ok(Background::Gradient { top: plain, bottom: plain }),
            Some(&[top, bottom]) => Ok(Background::Gradient { top, bottom }),
            _ => Err(expected(
                "a colour as in #aabbcc or white, two colours (top, bottom), gradient, environment or transparent",
            )),
        }
    }

    fn write(&self, value: &Background) -> Value {
        match *value {
            Background::Transparent => json!("transparent"),
            Background::Environment => json!("environment"),
            Background::Gradient { top, bottom } => json!([hex(top), hex(bottom)]),
        }
    }
}

/// The source of colours of points: a column, a computed value, or one colour.
pub struct ColorSourceRule;

impl Rule<ColorSource> for ColorSourceRule {
    fn read(&self, value: &Value, _: &Path) -> Result<ColorSource, Invalid> {
        let text = value.as_str().unwrap_or_default().trim();
        match srgb_color(text) {
            Some(color) => Ok(ColorSource::Constant(color)),
            None if text == "height" => Ok(ColorSource::Elevation),
            None => text.parse().map_err(|_| {
                expected(
                    "rgb, intensity, elevation, class, normal, support, the name of a column, #RRGGBB or a colour's CSS name",
                )
            }),
        }
    }

    fn write(&self, value: &ColorSource) -> Value {
        json!(value.to_string())
    }
}

/// A colour map by its matplotlib name.
pub struct ColormapRule;

impl Rule<Colormap> for ColormapRule {
    fn read(&self, value: &Value, _: &Path) -> Result<Colormap, Invalid> {
        Colormap::from_name(value.as_str().unwrap_or_default()).map_err(from_core)
    }

    fn write(&self, value: &Colormap) -> Value {
        json!(value.to_string())
    }
}

/// Bounds as `([x0,x1],[y0,y1],[z0,z1])`, as six numbers (low corner, high corner), or of any height with two ranges.
pub struct ClipBoxRule;

impl Rule<ClipBox> for ClipBoxRule {
    fn read(&self, value: &Value, _: &Path) -> Result<ClipBox, Invalid> {
        let wrong = || {
            expected(
                "two or three ranges from low to high as in ([0,10],[0,10],[2,5]), or six numbers x0,y0,z0,x1,y1,z1",
            )
        };
        let any = [f64::NEG_INFINITY, f64::INFINITY];
        let ranges = match (value.as_str().map(bracketed_ranges), as_numbers(value).as_deref()) {
            (Some(Some(ranges)), _) => ranges,
            (_, Some(&[x0, y0, z0, x1, y1, z1])) => vec![[x0, x1], [y0, y1], [z0, z1]],
            _ => return Err(wrong()),
        };
        let ranges = match ranges[..] {
            [x, y] => [x, y, any],
            [x, y, z] => [x, y, z],
            _ => return Err(wrong()),
        };
        if !ranges.iter().all(|[low, high]| low <= high) {
            return Err(wrong());
        }
        let [low, high] = [0, 1].map(|end| DVec3::from_array(ranges.map(|range| range[end])));
        Ok(ClipBox { min: low, max: high })
    }

    fn write(&self, value: &ClipBox) -> Value {
        let ranges = value.min.to_array().into_iter().zip(value.max.to_array());
        let finite = ranges.filter(|(low, high)| low.is_finite() && high.is_finite());
        let ranges: Vec<String> = finite.map(|(low, high)| format!("[{low},{high}]")).collect();
        json!(format!("({})", ranges.join(",")))
    }
}

/// Reads `([low,high],[low,high])` and so on, as PDAL writes bounds.
fn bracketed_ranges(text: &str) -> Option<Vec<[f64; 2]>> {
    let inner = text.trim().strip_prefix('(')?.strip_suffix(')')?;
    let words: Vec<&str> = inner.split(',').map(str::trim).collect();
    let range = |words: &[&str]| {
        let [low, high] = words else { return None };
        let inner = [low.strip_prefix('[')?, high.strip_suffix(']')?].join(",");
        <[f64; 2]>::try_from(as_numbers(&Value::String(inner))?).ok()
    };
    words.chunks(2).map(range).collect()
}

/// A plane as six numbers: one of its points, and the normal, which points to the hidden side.
pub struct ClipPlaneRule;

impl Rule<ClipPlane> for ClipPlaneRule {
    fn read(&self, value: &Value, _: &Path) -> Result<ClipPlane, Invalid> {
        let numbers = as_numbers(value).filter(|numbers| numbers.len() == 6);
        let numbers =
            numbers.ok_or_else(|| expected("a point and a normal as in [0,0,5,0,0,1]"))?;
        let [point, normal] = [0, 3].map(|first| DVec3::from_slice(&numbers[first..]));
        let length_error = (normal.length_squared() - 1.0).abs();
        let unit = if length_error < 1e-6 { Some(normal) } else { normal.try_normalize() };
        match unit {
            Some(normal) => Ok(ClipPlane { point, normal }),
            None => Err(expected("a normal other than 0,0,0")),
        }
    }

    fn write(&self, value: &ClipPlane) -> Value {
        json!([value.point.to_array(), value.normal.to_array()].concat())
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
mod tests {
    //! Values are read as people write them, nonsense is refused, and what is written reads back equal.

    use super::*;

    fn read<T, R: Rule<T>>(rule: R, text: &str) -> Result<T, String> {
        let value = serde_json::from_str(text).unwrap_or_else(|_| json!(text));
        rule.read(&value, Path::new("")).map_err(|error| error.to_string())
    }

    #[test]
    fn values_are_read_in_all_spellings() {
        assert_eq!(read(Vector, "1, -2.5,3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        assert_eq!(read(Vector, "[1, -2.5, 300]"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        assert_eq!((read(Axis, "-y"), read(Axis, "Z")), (Ok(-Vec3::Y), Ok(Vec3::Z)));
        assert_eq!(read(Axis, "[0, 0, 2]"), Ok(Vec3::Z));
        for text in ["64x48", "64,48", "[64, 48]"] {
            assert_eq!(read(Resolution, text), Ok((64, 48)), "{text}");
        }
        assert_eq!(read(BackgroundRule, "transparent"), Ok(Background::Transparent));
        assert_eq!(read(BackgroundRule, "#fff"), read(BackgroundRule, "white,WHITE"));
        assert_eq!(read(Interval, "-1,2"), Ok((-1.0, 2.0)));
        assert_eq!(read(Color, "tomato"), read(Color, "#ff6347"));
        assert_eq!(read(ColorSourceRule, "height"), Ok(ColorSource::Elevation));
        assert_eq!(read(ColorSourceRule, "red"), Ok(ColorSource::Constant([255, 0, 0])));
        assert_eq!(read(ColorSourceRule, "Redness"), Ok(ColorSource::Column("Redness".into())));
        let (low, high) = (DVec3::new(0.0, -2.0, 4e5), DVec3::new(1.0, 3.5, 5e5));
        for text in [" ( [0, 1],[-2,3.5] , [4e5,5e5] ) ", "0,-2,4e5,1,3.5,5e5"] {
            assert_eq!(read(ClipBoxRule, text), Ok(ClipBox { min: low, max: high }), "{text}");
        }
        let (low, high) = (low.with_z(f64::NEG_INFINITY), high.with_z(f64::INFINITY));
        assert_eq!(read(ClipBoxRule, "([0,1],[-2,3.5])"), Ok(ClipBox { min: low, max: high }));
        let plane = ClipPlane { point: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::NEG_Z };
        assert_eq!(read(ClipPlaneRule, "1,2,3,0,0,-2"), Ok(plane));
    }

    #[test]
    fn invalid_values_are_rejected() {
        for text in ["", "1,2", "1,2,NaN", "inf,0,0", "1e99,0,0", "a,b,c", "1,2,3,4", "7"] {
            assert!(read(Vector, text).is_err(), "{text}");
        }
        for text in ["0x0", "x", "1920", "-1x5", "100000x100000", "5x"] {
            assert!(read(Resolution, text).is_err(), "{text}");
        }
        for text in ["", "0,1,0,1", "[0,1],[0,1]", "([0,1])", "([1,0],[0,1])", "()", "5,0,0,1,1,1"]
        {
            assert!(read(ClipBoxRule, text).is_err(), "{text}");
        }
        for text in ["([0,1],[0,NaN])", "([0 1],[0,1])", "([0,1],0,1])", "([0,1],[0,1],)"] {
            assert!(read(ClipBoxRule, text).is_err(), "{text}");
        }
        for text in ["", "0,0,1", "0,0,0,0,0,0", "0,0,0,0,0,x", "0,0,0,0,0,1,2"] {
            assert!(read(ClipPlaneRule, text).is_err(), "{text}");
        }
        for text in ["", "#12", "reddish", "#fff,#fff,#fff"] {
            assert!(read(BackgroundRule, text).is_err(), "{text}");
        }
        assert!(read(Axis, "W").is_err() && read(Direction, "0,0,0").is_err());
        assert!(read(Interval, "1,1").is_err() && read(POSITIVE, "0").is_err());
        assert!(read(POSITIVE, "NaN").is_err() && read(POSITIVE, "inf").is_err());
    }

    #[test]
    fn written_values_read_back_equal() {
        fn check<T: PartialEq + std::fmt::Debug>(rule: impl Rule<T>, text: &str) {
            let value = rule.read(&json!(text), Path::new("")).unwrap();
            assert_eq!(rule.read(&rule.write(&value), Path::new("")), Ok(value), "{text}");
        }
        check(Vector, "0.1,1e-7,562326.8");
        check(Direction, "1,2,3");
        check(Axis, "1,2,3");
        check(Color, "#89abcd");
        check(BackgroundRule, "#123456,#fedcba");
        check(ClipBoxRule, "([0.1,0.3],[-2,3.5])");
        check(ClipPlaneRule, "1,2,3,1,1,1");
        check(ColorSourceRule, "surface_variation");
    }
}
