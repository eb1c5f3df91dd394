//! The sRGB transfer function (IEC 61966-2-1).

use std::sync::LazyLock;

/// Encoded value in [0, 1] to linear light.
pub fn decode_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Encoded 8-bit value to linear light.
pub fn decode_srgb8(encoded: u8) -> f32 {
    static TABLE: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|value| decode_srgb(value as f32 / 255.0)));
    TABLE[usize::from(encoded)]
}

/// Linear light in [0, 1] to the encoded value.
pub fn encode_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bit_values_survive_the_round_trip() {
        for value in 0..=255u8 {
            let encoded = encode_srgb(decode_srgb8(value));
            assert_eq!((encoded * 255.0).round() as u8, value);
        }
    }
}
