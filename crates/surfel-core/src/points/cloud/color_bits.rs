//! Colours of 8 bits in channels of 16.

use rayon::prelude::*;

/// The channel of 16 bits that a channel 1 of 8 bits becomes.
pub const COLOR_8_TO_16: u16 = 257;

/// Returns the channel of 8 bits nearest to one of 16.
pub fn to_8_bits(channel: u16) -> u8 {
    ((u32::from(channel) + 128) / u32::from(COLOR_8_TO_16)) as u8
}

/// Returns true if 8 bits per channel hold the colours.
pub fn have_8_bits(colors: &[[u16; 3]]) -> bool {
    colors.par_iter().all(|color| color.iter().all(|channel| channel % COLOR_8_TO_16 == 0))
}

#[cfg(test)]
mod tests {
    //! Channels of 8 bits, and colours that need more.

    use super::*;

    #[test]
    fn channels_of_8_bits_survive_16() {
        assert!((0..=u8::MAX).all(|v| to_8_bits(u16::from(v) * COLOR_8_TO_16) == v));
        assert_eq!([128, 129, 65_406, 65_407].map(to_8_bits), [0, 1, 254, 255]);
    }

    #[test]
    fn one_channel_between_the_steps_needs_16_bits() {
        assert!(have_8_bits(&[[131 * 257, 0, 65_535], [0; 3]]));
        assert!(!have_8_bits(&[[131 * 257, 0, 65_535], [1, 0, 0]]));
    }
}
