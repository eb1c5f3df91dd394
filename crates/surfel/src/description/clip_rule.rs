//! Rules of the bounds and planes that clip a scene.

use super::Invalid;
use super::rule::{Rule, as_numbers, expected};
use serde_json::{Value, json};
use std::path::Path;
use surfel_core::math::DVec3;
use surfel_core::scene::{ClipBox, ClipPlane};

/// Bounds as `([x0,x1],[y0,y1],[z0,z1])`, as six numbers (low corner, high corner), or of any height with two ranges.
pub struct ClipBoxRule;

impl Rule<ClipBox> for ClipBoxRule {
    fn read(&self, value: &Value, _: &Path) -> Result<ClipBox, Invalid> {
        let ranges = ranges(value).ok_or_else(|| {
            expected(
                "two or three ranges from low to high as in ([0,10],[0,10],[2,5]), or six numbers x0,y0,z0,x1,y1,z1",
            )
        })?;
        box_of(ranges)
    }

    fn write(&self, value: &ClipBox) -> Value {
        let ranges = value.min.to_array().into_iter().zip(value.max.to_array());
        let finite = ranges.filter(|(low, high)| low.is_finite() && high.is_finite());
        let ranges: Vec<String> = finite.map(|(low, high)| format!("[{low},{high}]")).collect();
        json!(format!("({})", ranges.join(",")))
    }

    fn may_begin_with_hyphen(&self) -> bool {
        true
    }
}

/// A range that contains every number.
pub(super) const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Returns the box of ranges along the axes X, Y and Z.
///
/// # Errors
///
/// Fails for a range whose higher end comes first.
pub(super) fn box_of(ranges: [[f64; 2]; 3]) -> Result<ClipBox, Invalid> {
    if let Some([first, second]) = ranges.into_iter().find(|[low, high]| high < low) {
        let message = format!("the lower end of a range first, as in [{second},{first}]");
        return Err(expected(message));
    }
    let [min, max] = [0, 1].map(|end| DVec3::from_array(ranges.map(|range| range[end])));
    Ok(ClipBox { min, max })
}

/// Reads the ranges of a box.
pub(super) fn ranges(value: &Value) -> Option<[[f64; 2]; 3]> {
    if let Some(&[x0, y0, z0, x1, y1, z1]) = as_numbers(value).as_deref() {
        return Some([[x0, x1], [y0, y1], [z0, z1]]);
    }
    match bracketed_ranges(value.as_str()?)?[..] {
        [x, y] => Some([x, y, ANY]),
        [x, y, z] => Some([x, y, z]),
        _ => None,
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

    fn may_begin_with_hyphen(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    //! Bounds and planes are read as people write them, nonsense is refused, and what is written reads back equal.

    use super::super::rule::tests_of_rules::{check, read};
    use super::*;

    #[test]
    fn bounds_and_planes_are_read_in_all_spellings() {
        let (low, high) = (DVec3::new(0.0, -2.0, 4e5), DVec3::new(1.0, 3.5, 5e5));
        for text in [" ( [0, 1],[-2,3.5] , [4e5,5e5] ) ", "0,-2,4e5,1,3.5,5e5"] {
            assert_eq!(read(ClipBoxRule, text), Ok(ClipBox { min: low, max: high }), "{text}");
        }
        let (low, high) = (low.with_z(f64::NEG_INFINITY), high.with_z(f64::INFINITY));
        assert_eq!(read(ClipBoxRule, "([0,1],[-2,3.5])"), Ok(ClipBox { min: low, max: high }));
        let plane = ClipPlane { point: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::NEG_Z };
        assert_eq!(read(ClipPlaneRule, "1,2,3,0,0,-2"), Ok(plane));
        check(ClipBoxRule, "([0.1,0.3],[-2,3.5])");
        check(ClipPlaneRule, "1,2,3,1,1,1");
    }

    #[test]
    fn invalid_bounds_and_planes_are_rejected() {
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
    }
}
