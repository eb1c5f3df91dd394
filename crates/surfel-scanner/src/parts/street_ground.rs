//! A road between pavements with kerbs.

use super::stone;
use crate::classes::GROUND;
use crate::noise::{fbm, smoothstep};
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// The ground of a street along X. Pavements are at z = 0, the road is a kerb lower and rises a little in its middle.
pub struct StreetGround {
    /// Half width of the road in metres.
    pub half_road: f64,
    /// Radius of the ground about the origin.
    pub radius: f64,
}

const KERB: f64 = 0.14;
const KERB_WIDTH: f64 = 0.04;
impl StreetGround {
    /// Returns the height of the ground.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let across = y.abs() / self.half_road;
        let camber = 0.06 * (1.0 - across * across).max(0.0);
        let pavement = smoothstep(self.half_road, self.half_road + KERB_WIDTH, y.abs());
        let rough = 0.01 * fbm(DVec3::new(x, y, 0.0) * 1.7, 2);
        (camber - KERB) * (1.0 - pavement) + rough
    }
}

impl Sdf for StreetGround {
    fn distance(&self, point: DVec3) -> f64 {
        let highest = 0.02;
        let edge = point.truncate().length() - self.radius;
        if 0.3 < point.z - highest {
            return (point.z - highest).max(edge);
        }
        // The kerb's slope is at most 5.3; elsewhere the ground is nearly level.
        let kerb_distance = (point.y.abs() - self.half_road - 0.5 * KERB_WIDTH).abs();
        let above = point.z - self.height(point.x, point.y);
        let steep = 0.18 * above;
        let level = (0.95 * above).min(kerb_distance - 0.5 * KERB_WIDTH);
        (if 0.0 < above { steep.max(level) } else { steep }).max(edge)
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let shade = 0.05 * fbm(point * 3.0, 3) as f32;
        if point.y.abs() < self.half_road {
            return Vec3::splat(0.36 + shade);
        }
        if point.y.abs() < self.half_road + 2.0 {
            return Vec3::new(0.66, 0.64, 0.6) + Vec3::splat(shade);
        }
        stone::meadow(point, 0.0)
    }

    fn bounds(&self) -> DAabb {
        let radius = self.radius;
        DAabb { min: DVec3::new(-radius, -radius, -0.5), max: DVec3::new(radius, radius, 0.05) }
    }

    fn class(&self) -> u8 {
        GROUND
    }
}

#[cfg(test)]
mod tests {
    //! Heights of the street.

    use super::*;

    #[test]
    fn the_road_lies_a_kerb_below_the_pavement() {
        let ground = StreetGround { half_road: 3.0, radius: 30.0 };
        let step = ground.height(5.0, 3.1) - ground.height(5.0, 2.95);
        assert!((step - KERB).abs() < 0.03, "{step}");
        let surface = DVec3::new(2.0, 1.0, ground.height(2.0, 1.0));
        assert!(ground.distance(surface).abs() < 1e-9);
        assert!(0.0 < ground.distance(surface + 0.01 * DVec3::Z));
    }
}
