//! Shrubs and cypresses: ellipsoids with a rough surface.

use super::stone;
use crate::classes::MEDIUM_VEGETATION;
use crate::noise::{fbm, unit};
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// The crown of a plant.
pub struct Foliage {
    /// Centre of the ellipsoid.
    pub center: DVec3,
    /// Half axes of the ellipsoid.
    pub half: DVec3,
    /// Seed of the leaves.
    pub seed: u64,
}

/// Maximum distance of leaves from the ellipsoid in metres.
const ROUGHNESS: f64 = 0.22;

impl Foliage {
    fn leafiness(&self, point: DVec3) -> f64 {
        fbm(point * 2.4 + DVec3::splat(64.0 * unit(self.seed)), 3)
    }
}

impl Sdf for Foliage {
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

    fn bounds(&self) -> DAabb {
        // Distances are scaled by the smallest half axis, so the other axes stretch them.
        let stretch = 1.0 + ROUGHNESS / self.half.min_element();
        DAabb::around(self.center, stretch * self.half)
    }

    /// Returns the ASPRS class 'medium vegetation'.
    fn class(&self) -> u8 {
        MEDIUM_VEGETATION
    }
}
