//! Rough ground around ruins and under trees.

use super::stone;
use crate::classes::GROUND;
use crate::noise::{fbm, mix, noise, smoothstep};
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// Gently rolling ground within a ragged circle about the origin, heaped against a platform.
pub struct Terrain {
    /// Radius of the circle in metres.
    pub radius: f64,
    /// Half length and half width of the platform, under which the ground is level.
    pub platform: (f64, f64),
}

/// Maximum height in metres.
const MAX_HEIGHT: f64 = 1.6;

impl Terrain {
    /// Returns the height of the ground.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let point = DVec3::new(x, y, 0.0);
        let distance = self.platform_distance(x, y);
        let hills = 0.9 * fbm(point * 0.09 + DVec3::splat(3.0), 3) + 0.012 * (x + y).max(0.0);
        let heap = 0.45 * (0.5 + noise(point * 0.4)).max(0.0) * (-distance / 0.9).exp();
        let clods = 0.07 * fbm(point * 1.3, 3);
        mix(0.0, hills, smoothstep(0.5, 9.0, distance)) + heap + clods
    }

    fn platform_distance(&self, x: f64, y: f64) -> f64 {
        let (dx, dy) = (x.abs() - self.platform.0, y.abs() - self.platform.1);
        dx.max(0.0).hypot(dy.max(0.0))
    }

    /// Returns the distance to the ragged edge, positive inside.
    fn edge(&self, point: DVec3) -> f64 {
        let level = DVec3::new(point.x, point.y, 0.0);
        self.radius - 2.0 - level.length() + 2.0 * fbm(level * 0.3, 3)
    }
}

impl Sdf for Terrain {
    fn distance(&self, point: DVec3) -> f64 {
        let above = point.z - MAX_HEIGHT;
        if 0.3 < above {
            return above;
        }
        // The factors compensate for the slope of the ground (0.8) and of the edge (0.4).
        let ground = 0.8 * (point.z - self.height(point.x, point.y));
        ground.max(-0.4 * self.edge(point))
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let distance = self.platform_distance(point.x, point.y);
        let path =
            1.0 - smoothstep(0.8, 2.6, (point.x + 3.0 + 0.25 * point.y + noise(point * 0.3)).abs());
        let trodden =
            (1.0 - smoothstep(0.0, 2.5, distance)).max(if point.y < 0.0 { path } else { 0.0 });
        stone::meadow(point, trodden)
    }

    fn bounds(&self) -> DAabb {
        DAabb {
            min: DVec3::new(-self.radius, -self.radius, -1.5),
            max: DVec3::new(self.radius, self.radius, MAX_HEIGHT),
        }
    }

    fn class(&self) -> u8 {
        GROUND
    }
}
