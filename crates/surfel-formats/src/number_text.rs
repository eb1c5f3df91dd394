//! Formats numbers for messages.

use surfel_core::math::DVec3;

/// Formats `value` in few digits, of any magnitude.
pub(crate) fn format_number(value: f64) -> String {
    let is_usual = value == 0.0 || (1e-6..1e15).contains(&value.abs());
    if is_usual || !value.is_finite() { value.to_string() } else { format!("{value:e}") }
}

/// Formats the coordinates of `v` in few digits each.
pub(crate) fn format_vector(v: DVec3) -> String {
    format!("[{}]", v.to_array().map(format_number).join(", "))
}

#[cfg(test)]
mod tests {
    //! Very large and very small numbers as text.

    use super::*;

    #[test]
    fn numbers_of_unusual_magnitude_stay_short() {
        assert_eq!(format_number(1e300), "1e300");
        assert_eq!(format_number(-2.5e-9), "-2.5e-9");
        assert_eq!(format_vector(DVec3::new(0.0, 0.001, f64::NAN)), "[0, 0.001, NaN]");
    }
}
