//! From linear light to what a display shows.

use super::encode_srgb;

/// How bright a picture is shown. The view transform is the plain one: what is too bright is cut off,
/// all else keeps its value, so that scanned colours come out as they went in.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tone {
    /// In stops: one more doubles the light.
    pub exposure_ev: f32,
}

impl Tone {
    /// A linear, premultiplied pixel as sRGB with straight alpha, each in [0, 1].
    pub fn display(&self, [r, g, b, alpha]: [f32; 4]) -> [f32; 4] {
        let alpha = cut_off(alpha);
        let gain = if 0.0 < alpha { self.exposure_ev.exp2() / alpha } else { 0.0 };
        let encode = |linear: f32| encode_srgb(cut_off(linear * gain));
        [encode(r), encode(g), encode(b), alpha]
    }

    pub fn rgba8(&self, pixel: [f32; 4]) -> [u8; 4] {
        self.display(pixel).map(|value| (value * 255.0).round() as u8)
    }

    pub fn rgba16(&self, pixel: [f32; 4]) -> [u16; 4] {
        self.display(pixel).map(|value| (value * 65535.0).round() as u16)
    }
}

/// To [0, 1]; NaN, which `clamp` would let through to the file, becomes 0.
fn cut_off(value: f32) -> f32 {
    if 0.0 < value { value.min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::decode_srgb;

    #[test]
    fn encoded_values_come_out_as_they_went_in() {
        for value in 0..=255u8 {
            let linear = decode_srgb(f32::from(value) / 255.0);
            assert_eq!(
                Tone::default().rgba8([linear, linear, linear, 1.0]),
                [value, value, value, 255]
            );
            let [deep, ..] = Tone::default().rgba16([linear, 0.0, 0.0, 1.0]);
            assert!(deep.abs_diff(u16::from(value) * 257) <= 1, "{value}: {deep}");
        }
    }

    #[test]
    fn exposure_counts_in_stops() {
        let brighter = Tone { exposure_ev: 1.0 };
        let plain = Tone::default();
        assert_eq!(brighter.rgba8([0.1, 0.2, 0.3, 1.0]), plain.rgba8([0.2, 0.4, 0.6, 1.0]));
    }

    #[test]
    fn alpha_is_straight_in_the_output() {
        let tone = Tone::default();
        let half = decode_srgb(128.0 / 255.0) / 2.0;
        assert_eq!(tone.rgba8([half, half, half, 0.5]), [128; 4]);
        assert_eq!(tone.rgba8([0.0; 4]), [0; 4]);
    }

    #[test]
    fn what_is_no_color_is_cut_off() {
        let tone = Tone::default();
        assert_eq!(tone.rgba8([f32::NAN, -1.0, f32::INFINITY, 1.0]), [0, 0, 255, 255]);
        assert_eq!(tone.rgba8([1.0, 1.0, 1.0, f32::NAN]), [0; 4]);
    }
}
