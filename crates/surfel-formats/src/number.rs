//! Numbers in messages.

use surfel::math::DVec3;

/// `value` in few digits, whatever its size.
pub(crate) fn number(value: f64) -> String {
    let is_usual = value == 0.0 || (1e-6..1e15).contains(&value.abs());
    if is_usual || !value.is_finite() { value.to_string() } else { format!("{value:e}") }
}

/// The coordinates of `v` in few digits each.
pub(crate) fn numbers(v: DVec3) -> String {
    format!("[{}]", v.to_array().map(number).join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_unusual_size_stay_short() {
        assert_eq!(number(1e300), "1e300");
        assert_eq!(number(-2.5e-9), "-2.5e-9");
        assert_eq!(numbers(DVec3::new(0.0, 0.001, f64::NAN)), "[0, 0.001, NaN]");
    }
}
