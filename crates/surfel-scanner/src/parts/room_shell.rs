//! The inside of a room: floor, ceiling and walls.

use super::masonry::box_distance;
use crate::classes::BUILDING;
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// Everything outside of the box from the floor at z = 0 up to the ceiling. Viewpoints must be inside of the box.
pub struct RoomShell {
    /// Half length, half width and half height.
    pub half: DVec3,
}

impl Sdf for RoomShell {
    fn distance(&self, point: DVec3) -> f64 {
        -box_distance(point - DVec3::Z * self.half.z, self.half)
    }

    fn color(&self, point: DVec3, normal: DVec3) -> Vec3 {
        if 0.9 < normal.z {
            let board = (point.y / 0.14).floor() as i64;
            let shade = if board % 2 == 0 { 0.0 } else { 0.05 };
            return Vec3::new(0.6, 0.47, 0.34) + Vec3::splat(shade);
        }
        if normal.z < -0.9 { Vec3::splat(0.93) } else { Vec3::new(0.82, 0.82, 0.74) }
    }

    fn bounds(&self) -> DAabb {
        // Rays from inside must cross the walls within the box.
        let margin = DVec3::splat(0.1);
        DAabb::around(DVec3::Z * self.half.z, self.half + margin)
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

#[cfg(test)]
mod tests {
    //! The shell is empty inside.

    use super::*;

    #[test]
    fn distances_are_positive_inside_and_negative_in_the_walls() {
        let shell = RoomShell { half: DVec3::new(3.0, 2.0, 1.25) };
        assert_eq!(shell.distance(DVec3::new(0.0, 0.0, 0.5)), 0.5);
        assert!(shell.distance(DVec3::new(3.05, 0.0, 1.0)) < -0.04);
    }
}
