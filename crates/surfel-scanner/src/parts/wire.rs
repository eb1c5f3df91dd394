//! Wires that hang between two points.

use super::assembly::segment_distance;
use crate::classes::WIRE_CONDUCTOR;
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// A wire along a parabola, made of straight pieces.
pub struct Wire {
    nodes: Vec<DVec3>,
    radius: f64,
}

impl Wire {
    /// Creates a wire between two ends whose middle hangs lower by `sag`.
    pub fn new(from: DVec3, to: DVec3, sag: f64, radius: f64) -> Self {
        const N_PIECES: usize = 12;
        let node = |i: usize| {
            let t = i as f64 / N_PIECES as f64;
            from.lerp(to, t) - 4.0 * sag * t * (1.0 - t) * DVec3::Z
        };
        Self { nodes: (0..=N_PIECES).map(node).collect(), radius }
    }
}

impl Sdf for Wire {
    fn distance(&self, point: DVec3) -> f64 {
        let pieces = self.nodes.windows(2).map(|ends| segment_distance(point, [ends[0], ends[1]]));
        pieces.fold(f64::INFINITY, f64::min) - self.radius
    }

    fn color(&self, _point: DVec3, _normal: DVec3) -> Vec3 {
        Vec3::splat(0.2)
    }

    fn bounds(&self) -> DAabb {
        let radius = DVec3::splat(self.radius);
        DAabb {
            min: self.nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min) - radius,
            max: self.nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + radius,
        }
    }

    fn class(&self) -> u8 {
        WIRE_CONDUCTOR
    }
}

#[cfg(test)]
mod tests {
    //! The shape of a hanging wire.

    use super::*;

    #[test]
    fn the_middle_hangs_lower_by_the_sag() {
        let wire = Wire::new(DVec3::ZERO, DVec3::X * 10.0, 0.5, 0.01);
        assert!((wire.distance(DVec3::new(5.0, 0.0, -0.5)) + 0.01).abs() < 1e-9);
        assert!((wire.distance(DVec3::ZERO) + 0.01).abs() < 1e-9);
    }
}
