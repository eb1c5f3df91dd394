//! Numbers as text: coordinates with a number of decimals, all others with the fewest digits that read back equal.

/// Maximum magnitude of numbers that are written as whole numbers. All whole numbers up to it are exact in f64.
const MAX_WHOLE: f64 = 1e15;

const POWERS_OF_TEN: [u64; 16] = {
    let mut powers = [1; 16];
    let mut i = 1;
    while i < powers.len() {
        powers[i] = powers[i - 1] * 10;
        i += 1;
    }
    powers
};

/// Maximum number of decimals of [`push_fixed`].
pub(super) const MAX_DECIMALS: usize = POWERS_OF_TEN.len() - 1;

/// Appends a number rounded to `decimals`; zeros at its end are left out if `trims_zeros`.
pub(super) fn push_fixed(text: &mut Vec<u8>, value: f64, decimals: usize, trims_zeros: bool) {
    let one = POWERS_OF_TEN[decimals];
    let scaled = (value * one as f64).round();
    // Larger numbers have no decimals.
    if scaled.is_nan() || MAX_WHOLE <= scaled.abs() {
        push_float(text, value);
        return;
    }
    if scaled < 0.0 {
        text.push(b'-');
    }
    let digits = scaled.abs() as u64;
    push_whole(text, digits / one);
    if decimals == 0 {
        return;
    }
    // The digit in front of the leading zeros becomes the point.
    let point = text.len();
    push_whole(text, one + digits % one);
    text[point] = b'.';
    if trims_zeros {
        while text.pop_if(|last| *last == b'0').is_some() {}
        text.pop_if(|last| *last == b'.');
    }
}

/// Appends a whole number.
pub(super) fn push_whole(text: &mut Vec<u8>, value: impl itoa::Integer) {
    text.extend(itoa::Buffer::new().format(value).as_bytes());
}

/// Appends a number with the fewest digits that read back equal in its type; whole numbers have no point.
pub(super) fn push_float(text: &mut Vec<u8>, value: impl zmij::Float + Into<f64> + Copy) {
    let wide: f64 = value.into();
    if wide.fract() == 0.0 && wide.abs() < MAX_WHOLE {
        push_whole(text, wide as i64);
    } else {
        text.extend(zmij::Buffer::new().format(value).as_bytes());
    }
}

#[cfg(test)]
mod tests {
    //! Digits of coordinates and of other numbers.

    use super::*;

    fn text(write: impl Fn(&mut Vec<u8>)) -> String {
        let mut text = Vec::new();
        write(&mut text);
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn coordinates_have_the_decimals_of_their_precision() {
        let fixed = |value, decimals| text(|text| push_fixed(text, value, decimals, false));
        assert_eq!(fixed(484_800.25, 2), "484800.25");
        assert_eq!(fixed(-0.0625, 3), "-0.063");
        assert_eq!(fixed(-0.0001, 2), "0.00");
        assert_eq!(fixed(12.0, 0), "12");
        assert_eq!(fixed(5.05, 1), "5.1");
        assert_eq!(fixed(1e300, 2), "1e+300");
        assert_eq!(fixed(f64::NAN, 2), "NaN");
        let trimmed = |value, decimals| text(|text| push_fixed(text, value, decimals, true));
        assert_eq!(trimmed(500_000.123, 5), "500000.123");
        assert_eq!(trimmed(500_000.0, 5), "500000");
        assert_eq!(trimmed(100.0, 0), "100");
    }

    #[test]
    fn numbers_have_the_fewest_digits_that_read_back_equal() {
        assert_eq!(text(|text| push_float(text, 0.1f32)), "0.1");
        assert_eq!(text(|text| push_float(text, f64::from(0.1f32))), "0.10000000149011612");
        assert_eq!(text(|text| push_float(text, -7.0f32)), "-7");
        for value in [1e-20, 1.5e300, f64::MAX, f64::MIN_POSITIVE, f64::INFINITY, 123.456] {
            assert_eq!(text(|text| push_float(text, value)).parse::<f64>().unwrap(), value);
        }
    }
}
