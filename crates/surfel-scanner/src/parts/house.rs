//! A house with recessed windows and a door under a gabled roof.

use super::masonry::box_distance;
use crate::classes::BUILDING;
use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// A house whose front looks along -Y.
pub struct House {
    /// Middle of the base.
    pub base: DVec3,
    /// Half length along X and half depth along Y.
    pub half: (f64, f64),
    /// Height of the walls.
    pub wall_height: f64,
    /// Height of the roof above the walls.
    pub roof_height: f64,
}

const RECESS_DEPTH: f64 = 0.18;
const WINDOW_SPACING: f64 = 2.2;
const STOREY_HEIGHT: f64 = 2.8;
const EAVES: f64 = 0.35;
const ROOF_THICKNESS: f64 = 0.15;

impl House {
    /// Returns the signed distance to the nearest window of a wall, whose plane has the coordinates (`along`, `height`);
    /// `depth` is the distance behind the wall.
    fn recess_distance(&self, along: f64, height: f64, depth: f64, half_length: f64) -> f64 {
        let last = ((half_length - 0.9) / WINDOW_SPACING).floor();
        let column = (along / WINDOW_SPACING).round().clamp(-last, last);
        let n_storeys = (self.wall_height / STOREY_HEIGHT).floor().max(1.0);
        let storey = (height / STOREY_HEIGHT).floor().clamp(0.0, n_storeys - 1.0);
        let center = DVec3::new(column * WINDOW_SPACING, (storey + 0.5) * STOREY_HEIGHT, 0.0);
        let half = DVec3::new(0.55, 0.75, RECESS_DEPTH);
        box_distance(DVec3::new(along, height, depth) - center, half)
    }

    fn door_distance(&self, p: DVec3) -> f64 {
        let half = DVec3::new(0.55, 0.3, 1.05);
        box_distance(p - DVec3::new(0.5 * WINDOW_SPACING, -self.half.1, 1.05), half)
    }

    fn walls_distance(&self, p: DVec3) -> f64 {
        let (length, depth) = self.half;
        let half = DVec3::new(length, depth, 0.5 * self.wall_height);
        let walls = box_distance(p - DVec3::Z * half.z, half).max(self.gable_distance(p));
        let gables = self.gable_wall_distance(p);
        let front = self.recess_distance(p.x, p.z, depth - p.y.abs(), length);
        let side = self.recess_distance(p.y, p.z, length - p.x.abs(), depth);
        walls.min(gables).max(-front).max(-side).max(-self.door_distance(p))
    }

    /// Returns the distance above the lower face of the roof, negative under it.
    fn gable_distance(&self, p: DVec3) -> f64 {
        let (rise, run) = (self.roof_height, self.half.1);
        let slope = DVec3::new(0.0, rise, run).normalize();
        slope.dot(DVec3::new(0.0, p.y.abs() - run, p.z - self.wall_height))
    }

    fn gable_wall_distance(&self, p: DVec3) -> f64 {
        let side = p.x.abs() - self.half.0;
        side.max(self.gable_distance(p)).max(self.wall_height - 0.1 - p.z)
    }

    fn roof_distance(&self, p: DVec3) -> f64 {
        let plane = self.gable_distance(p);
        let (length, depth) = (self.half.0 + EAVES, self.half.1 + EAVES);
        let ends = (p.x.abs() - length).max(p.y.abs() - depth);
        (-plane).max(plane - ROOF_THICKNESS).max(ends)
    }
}

impl Sdf for House {
    fn distance(&self, point: DVec3) -> f64 {
        let p = point - self.base;
        self.walls_distance(p).min(self.roof_distance(p))
    }

    fn color(&self, point: DVec3, _normal: DVec3) -> Vec3 {
        let p = point - self.base;
        if self.roof_distance(p) < self.walls_distance(p) {
            let rows = 0.05 * (40.0 * p.z).sin() as f32;
            return Vec3::new(0.62, 0.3, 0.22) + Vec3::splat(rows);
        }
        let is_recessed = p.y.abs() < self.half.1 - 0.02 && p.x.abs() < self.half.0 - 0.02;
        if is_recessed { Vec3::new(0.3, 0.33, 0.38) } else { Vec3::new(0.86, 0.8, 0.68) }
    }

    fn bounds(&self) -> DAabb {
        let half = DVec3::new(self.half.0 + EAVES, self.half.1 + EAVES, 0.0);
        let top = DVec3::Z * (self.wall_height + self.roof_height + 2.0 * ROOF_THICKNESS);
        DAabb { min: self.base - half, max: self.base + half + top }
    }

    fn class(&self) -> u8 {
        BUILDING
    }
}

#[cfg(test)]
mod tests {
    //! Recesses, eaves and the ridge of the house.

    use super::*;

    #[test]
    fn windows_are_recessed_and_the_roof_overhangs() {
        let house =
            House { base: DVec3::ZERO, half: (5.0, 4.0), wall_height: 5.6, roof_height: 2.5 };
        let on_wall = DVec3::new(1.1, -4.0, 4.2);
        assert!(house.distance(on_wall).abs() < 1e-9);
        let in_window = DVec3::new(0.0, -4.0 + RECESS_DEPTH, 1.4);
        assert!(house.distance(in_window).abs() < 1e-9);
        assert!(0.1 < house.distance(DVec3::new(0.0, -4.0, 1.4)));
        let under_ridge = DVec3::new(0.0, 0.0, 8.0);
        assert!(house.distance(under_ridge) < 0.0);
        assert!(house.distance(DVec3::new(5.3, 0.0, 8.15)) < 0.0);
        assert!(0.0 < house.distance(DVec3::new(5.3, 0.0, 4.0)));
    }
}
