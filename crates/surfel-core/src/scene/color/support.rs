//! Colours of hits by their support: measured points near or far.

use crate::image::{Colormap, PercentileRange, decode_srgb8};
use crate::math::Vec3;

/// Distances at the first and the last colour, in radii of the points: at a point, and as far as its disc reaches.
pub(super) const DEFAULT_RANGE: PercentileRange = PercentileRange { low: 0.0, high: 1.0 };

/// The mapping from the distance between a hit and the nearest point to colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportColors {
    /// The map.
    pub colormap: Colormap,
    /// Distances of the first and the last colour in radii.
    pub range: PercentileRange,
}

impl SupportColors {
    /// Returns the linear colour of a distance in radii.
    pub fn color(&self, distance: f32) -> Vec3 {
        let position = self.range.normalize(f64::from(distance));
        Vec3::from_array(self.colormap.color(position).map(decode_srgb8))
    }
}

#[cfg(test)]
mod tests {
    //! Distances are mapped from one end of the range to the other.

    use super::*;

    #[test]
    fn distances_beyond_the_range_have_the_colors_of_its_ends() {
        let colormap = Colormap::from_name("gray").unwrap();
        let colors = SupportColors { colormap, range: DEFAULT_RANGE };
        assert_eq!(colors.color(0.0), Vec3::ZERO);
        assert_eq!(colors.color(1.0), Vec3::ONE);
        assert_eq!(colors.color(1.4), Vec3::ONE);
        let reversed = PercentileRange { low: 0.5, high: 0.0 };
        let colors = SupportColors { range: reversed, ..colors };
        assert_eq!((colors.color(0.0), colors.color(0.7)), (Vec3::ONE, Vec3::ZERO));
    }
}
