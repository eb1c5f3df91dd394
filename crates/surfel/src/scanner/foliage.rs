//! Shrubs and cypresses: ellipsoids with a leafy surface.

use super::noise::{fbm, unit};
use super::site::{Bounds, Solid};
use super::stone;
use crate::math::DVec3;
use crate::math::Vec3;

/// A crown about `center`.
pub struct Foliage {
    pub center: DVec3,
    pub half: DVec3,
    pub seed: u64,
}

/// Leaves lie within this of the ellipsoid.
const ROUGHNESS: f64 = 0.22;

impl Foliage {
    fn leafiness(&self, point: DVec3) -> f64 {
        fbm(point * 2.4 + DVec3::splat(64.0 * unit(self.seed)), 3)
    }
}

impl Solid for Foliage {
    fn distance(&self, point: DVec3) -> f64 {
        let q = (point - self.center) / self.half;
        let smooth = (q.length() - 1.0) * self.half.min_element();
        if ROUGHNESS + 0.2 < smooth {
            return smooth - ROUGHNESS;
        }
        0.5 * (smooth + ROUGHNESS * self.leafiness(point))
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        stone::leaves(point, 1.6 * self.leafiness(point), unit(self.seed ^ 0x77))
    }

    fn bounds(&self) -> Bounds {
        // The ellipsoid's distance is measured by its smallest half axis: along the others it is stretched.
        let stretch = 1.0 + ROUGHNESS / self.half.min_element();
        Bounds::around(self.center, stretch * self.half)
    }

    /// ASPRS 'medium vegetation'.
    fn class(&self) -> u8 {
        4
    }
}
