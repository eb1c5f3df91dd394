//! The number of bits of the colours of a LAS file, which its header does not state.

use rayon::prelude::*;
use surfel_core::points::{COLOR_8_TO_16, PointCloud};
use surfel_core::progress::Progress;

use crate::file::Input;
use crate::table::ColumnSlices;

/// The number of bits of the colours that were read so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ColorBits {
    /// All colours are black.
    #[default]
    Unknown,
    /// No channel was above 255, and all are scaled to 16 bits.
    Bits8,
    /// 16 bits.
    Bits16,
}

impl ColorBits {
    /// Scales the colours of further points to 16 bits, and mends those `before` if they had other bits than it seemed.
    pub fn scale(&mut self, before: ColumnSlices, cloud: &mut PointCloud) {
        let Some(new) = &mut cloud.colors else { return };
        let before = before.colors.unwrap_or_default();
        let largest = new.par_iter().flatten_iter().copied().max().unwrap_or(0);
        match (*self, largest) {
            (Self::Bits16, _) | (Self::Unknown, 0) => {}
            (Self::Unknown | Self::Bits8, 0..=255) => {
                *self = Self::Bits8;
                new.par_iter_mut().for_each(|color| *color = color.map(|v| v * COLOR_8_TO_16));
            }
            (Self::Unknown | Self::Bits8, _) => {
                if *self == Self::Bits8 {
                    let colors = before.par_iter_mut();
                    colors.for_each(|color| *color = color.map(|v| v / COLOR_8_TO_16));
                }
                *self = Self::Bits16;
            }
        }
    }

    /// Drops colours that are all black, since they were never set. Notes this, and colours of 8 bits.
    pub fn report(self, input: &Input, cloud: &mut PointCloud, progress: &dyn Progress) {
        if cloud.colors.is_none() {
            return;
        }
        let note = |what: &str| progress.note(&format!("{}: {what}", input.name));
        match self {
            Self::Unknown => {
                note("all colours are zero; treated as absent");
                cloud.colors = None;
            }
            Self::Bits8 => note("colours have 8 bits, scaled to 16"),
            Self::Bits16 => {}
        }
    }
}

#[cfg(test)]
mod tests {
    //! Colours of several batches.

    use super::*;

    fn scaled(batches: &[&[u16]]) -> (Vec<u16>, ColorBits) {
        let (mut colors, mut bits) = (Vec::new(), ColorBits::default());
        for batch in batches {
            let new = batch.iter().map(|v| [*v, 0, 0]).collect();
            let mut cloud = PointCloud { colors: Some(new), ..PointCloud::default() };
            bits.scale(
                ColumnSlices { colors: Some(&mut colors), ..Default::default() },
                &mut cloud,
            );
            colors.extend(cloud.colors.unwrap());
        }
        (colors.iter().map(|color| color[0]).collect(), bits)
    }

    #[test]
    fn all_colors_have_the_bits_of_the_brightest() {
        assert_eq!(scaled(&[&[0, 0], &[0]]), (vec![0; 3], ColorBits::Unknown));
        assert_eq!(scaled(&[&[0], &[1, 0], &[255]]), (vec![0, 257, 0, 65_535], ColorBits::Bits8));
        assert_eq!(scaled(&[&[0, 9], &[300], &[7]]), (vec![0, 9, 300, 7], ColorBits::Bits16));
    }
}
