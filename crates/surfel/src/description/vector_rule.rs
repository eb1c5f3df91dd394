//! Rules of vectors, directions and axes.

use super::Invalid;
use super::rule::{MAX_LENGTH, Rule, as_numbers, expected};
use serde_json::{Value, json};
use std::path::Path;
use surfel_core::math::{DVec3, Vec3};

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

    fn may_begin_with_hyphen(&self) -> bool {
        true
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

    fn may_begin_with_hyphen(&self) -> bool {
        true
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

    fn may_begin_with_hyphen(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    //! Vectors are read as people write them, nonsense is refused, and what is written reads back equal.

    use super::super::rule::tests_of_rules::{check, read};
    use super::*;

    #[test]
    fn vectors_are_read_in_all_spellings() {
        assert_eq!(read(Vector, "1, -2.5,3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        assert_eq!(read(Vector, "[1, -2.5, 300]"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        assert_eq!((read(Axis, "-y"), read(Axis, "Z")), (Ok(-Vec3::Y), Ok(Vec3::Z)));
        assert_eq!(read(Axis, "[0, 0, 2]"), Ok(Vec3::Z));
    }

    #[test]
    fn invalid_vectors_are_rejected() {
        for text in ["", "1,2", "1,2,NaN", "inf,0,0", "1e99,0,0", "a,b,c", "1,2,3,4", "7"] {
            assert!(read(Vector, text).is_err(), "{text}");
        }
        assert!(read(Axis, "W").is_err() && read(Direction, "0,0,0").is_err());
    }

    #[test]
    fn written_vectors_read_back_equal() {
        check(Vector, "0.1,1e-7,562326.8");
        check(Direction, "1,2,3");
        check(Axis, "1,2,3");
    }
}
