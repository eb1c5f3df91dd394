//! The sRGB transfer function (IEC 61966-2-1).

/// Encoded value in [0, 1] to linear light.
pub fn decode_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
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
            let encoded = encode_srgb(decode_srgb(f32::from(value) / 255.0));
            assert_eq!((encoded * 255.0).round() as u8, value);
        }
    }
}
