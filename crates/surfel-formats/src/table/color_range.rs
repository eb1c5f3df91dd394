//! The range of colours and the columns that can be classes, found by their values.

use surfel_core::points::COLOR_8_TO_16;

/// The range of a file's colour channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ColorRange {
    /// 0 to 1.
    Unit,
    /// 0 to 255.
    Bits8,
    /// 0 to 65535.
    Bits16,
}

impl ColorRange {
    /// Infers the range of channels written as text, where whole numbers up to 1 are dark colours of 8 bits.
    pub fn from_text(values: impl Iterator<Item = f64> + Clone) -> Self {
        let has_fractions = values.clone().any(|v| v.is_finite() && v.fract() != 0.0);
        match largest(values) {
            largest if has_fractions && largest <= 1.0 => Self::Unit,
            largest if largest <= 255.0 => Self::Bits8,
            _ => Self::Bits16,
        }
    }

    /// Infers the range of channels stored as floats: most programs write 0 to 1, some 0 to 255.
    pub fn from_floats(values: impl Iterator<Item = f64>) -> Self {
        if largest(values) <= 1.0 { Self::Unit } else { Self::Bits8 }
    }

    /// Returns the factor that scales the range to 0..65535.
    pub fn scale(self) -> f64 {
        match self {
            Self::Unit => 65535.0,
            Self::Bits8 => f64::from(COLOR_8_TO_16),
            Self::Bits16 => 1.0,
        }
    }

    /// Returns the range in words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Unit => "0 to 1",
            Self::Bits8 => "0 to 255",
            Self::Bits16 => "0 to 65535",
        }
    }
}

/// Returns true if `value` can be a class or a channel of 8 bits: a whole number from 0 to 255.
pub(crate) fn is_byte(value: f64) -> bool {
    value.fract() == 0.0 && (0.0..256.0).contains(&value)
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.filter(|v| v.is_finite()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    //! The range of colours by their largest value, and the numbers that count as bytes.

    use super::*;

    #[test]
    fn range_follows_from_the_largest_value() {
        let text = |values: &[f64]| ColorRange::from_text(values.iter().copied());
        assert_eq!(text(&[0.0, 1.0, 1.0]), ColorRange::Bits8);
        assert_eq!(text(&[0.0, 0.5, 1.0, f64::NAN]), ColorRange::Unit);
        assert_eq!(text(&[0.0, 256.0]), ColorRange::Bits16);
        let floats = |values: &[f64]| ColorRange::from_floats(values.iter().copied());
        assert_eq!(floats(&[0.0, 1.0, f64::INFINITY]), ColorRange::Unit);
        assert_eq!(floats(&[0.0, 128.0]), ColorRange::Bits8);
    }

    #[test]
    fn bytes_are_whole_numbers_below_256() {
        assert!(is_byte(0.0) && is_byte(255.0));
        assert!(!is_byte(-1.0) && !is_byte(256.0) && !is_byte(0.5) && !is_byte(f64::NAN));
    }
}
