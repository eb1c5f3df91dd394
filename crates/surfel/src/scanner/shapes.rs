//! Shapes with closed forms, for tests that know where every point must lie.

use super::site::{Bounds, Solid};
use crate::math::DVec3;
use crate::math::Vec3;

/// A ball.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    pub center: DVec3,
    pub radius: f64,
    pub color: Vec3,
}

/// The half space below `normal . x = offset`; `normal` has unit length.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    pub normal: DVec3,
    pub offset: f64,
    pub color: Vec3,
}

impl Solid for Sphere {
    fn distance(&self, point: DVec3) -> f64 {
        (point - self.center).length() - self.radius
    }

    fn color(&self, _point: DVec3, _normal: DVec3) -> Vec3 {
        self.color
    }

    fn bounds(&self) -> Bounds {
        Bounds::around(self.center, DVec3::splat(self.radius))
    }
}

impl Solid for Plane {
    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    fn color(&self, _point: DVec3, _normal: DVec3) -> Vec3 {
        self.color
    }

    fn bounds(&self) -> Bounds {
        Bounds::EVERYWHERE
    }
}
