//! The sRGB transfer function (IEC 61966-2-1).

use std::sync::LazyLock;

/// Decodes an sRGB value in [0, 1] to linear light.
pub fn decode_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Decodes an 8-bit sRGB value to linear light.
pub fn decode_srgb8(encoded: u8) -> f32 {
    static TABLE: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|value| decode_srgb(value as f32 / 255.0)));
    TABLE[usize::from(encoded)]
}

/// Encodes linear light in [0, 1] as an sRGB value.
pub fn encode_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Encodes linear light as the nearest 8-bit sRGB value, equal to rounding `encode_srgb`. Clamps to [0, 1]; NaN is
/// black.
///
/// A table replaces the power: the upper bits of a float select the lowest code of their range, and a second table has
/// the lowest value of the next code. It is eight times as fast, which matters for interactive pictures.
#[inline]
pub fn encode_srgb8(linear: f32) -> u8 {
    static TABLE: LazyLock<CodeTable> = LazyLock::new(CodeTable::new);
    TABLE.code(linear)
}

/// Returns a pixel whose colour is not multiplied by alpha, which is clamped to [0, 1]. Without alpha, as light alone has
/// it, the colour stays.
pub fn unpremultiply([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    let a = a.clamp(0.0, 1.0);
    let opacity = if 0.0 < a { a } else { 1.0 };
    [r / opacity, g / opacity, b / opacity, a]
}

/// Encodes a linear pixel with premultiplied alpha as 8-bit sRGB and alpha, which multiplies no more.
pub fn encode_srgba8(pixel: [f32; 4]) -> [u8; 4] {
    let [r, g, b, a] = unpremultiply(pixel);
    // The cast maps NaN to 0.
    [encode_srgb8(r), encode_srgb8(g), encode_srgb8(b), (a * 255.0 + 0.5) as u8]
}

/// The table of `encode_srgb8`.
struct CodeTable {
    /// Lowest code of each range of floats that share their upper bits, from `FIRST` to 1.
    lowest_code: Vec<u8>,
    /// Lowest value of each code, then infinity.
    begins: [f32; 257],
}

impl CodeTable {
    /// A value below which all codes are 0.
    const FIRST: f32 = 1.0 / 8192.0;
    /// Number of low bits that a range ignores, which makes ranges narrower than codes.
    const SHIFT: u32 = 16;

    fn new() -> Self {
        let code = |linear: f32| (255.0 * encode_srgb(linear.clamp(0.0, 1.0)) + 0.5) as u8;
        let mut begins = [f32::INFINITY; 257];
        for (value, begin) in begins.iter_mut().enumerate().take(256) {
            *begin = min_float_that(|linear| value <= usize::from(code(linear)));
        }
        let ranges = Self::FIRST.to_bits() >> Self::SHIFT..=1.0f32.to_bits() >> Self::SHIFT;
        let lowest_code = ranges.map(|range| code(f32::from_bits(range << Self::SHIFT))).collect();
        Self { lowest_code, begins }
    }

    #[inline]
    fn code(&self, linear: f32) -> u8 {
        // NaN, which `clamp` would pass on, becomes the lowest value.
        let linear = if Self::FIRST < linear { linear.min(1.0) } else { Self::FIRST };
        let range = (linear.to_bits() - Self::FIRST.to_bits()) >> Self::SHIFT;
        let code = self.lowest_code[range as usize];
        code + u8::from(self.begins[usize::from(code) + 1] <= linear)
    }
}

/// Returns the least float in [0, 1] for which a monotonic predicate holds. It must hold for 1.
fn min_float_that(holds: impl Fn(f32) -> bool) -> f32 {
    // The bits of positive floats are ordered as the floats are.
    let (mut low, mut high) = (0, 1.0f32.to_bits());
    while low < high {
        let middle = (low + high) / 2;
        if holds(f32::from_bits(middle)) { high = middle } else { low = middle + 1 }
    }
    f32::from_bits(low)
}

#[cfg(test)]
mod tests {
    //! Encoding and decoding.

    use super::*;

    #[test]
    fn the_table_equals_the_rounded_formula() {
        let rounded = |linear: f32| (255.0 * encode_srgb(linear.clamp(0.0, 1.0)) + 0.5) as u8;
        let check = |linear: f32| assert_eq!(encode_srgb8(linear), rounded(linear), "{linear}");
        (0..=1_000_000).for_each(|i| check(i as f32 / 1e6));
        for begin in CodeTable::new().begins[1..256].iter().map(|begin| begin.to_bits()) {
            (begin - 3..begin + 3).for_each(|bits| check(f32::from_bits(bits)));
        }
        for (odd, code) in [(-1.0, 0), (7.0, 255), (f32::NAN, 0), (f32::INFINITY, 255)] {
            assert_eq!(encode_srgb8(odd), code);
        }
    }

    #[test]
    fn colours_are_divided_by_alpha_within_its_range() {
        let gray = decode_srgb8(100);
        assert_eq!(encode_srgba8([0.5 * gray, 0.0, 0.5, 0.5]), [100, 0, 255, 128]);
        // Sums of samples may exceed 1 by rounding.
        assert_eq!(encode_srgba8([gray, gray, 1.0, 1.01]), [100, 100, 255, 255]);
        assert_eq!(encode_srgba8([gray, 0.0, 0.0, 0.0]), [100, 0, 0, 0]);
    }

    #[test]
    fn eight_bit_values_survive_the_round_trip() {
        for value in 0..=255u8 {
            let encoded = encode_srgb(decode_srgb8(value));
            assert_eq!((encoded * 255.0).round() as u8, value);
        }
    }
}
