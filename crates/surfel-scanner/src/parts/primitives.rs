//! Shapes with closed forms, for tests.

use crate::sdf::{DAabb, Sdf};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// A ball.
#[derive(Clone, Copy, Debug)]
pub struct SphereSdf {
    /// Centre.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
    /// sRGB-encoded colour.
    pub color: Vec3,
}

/// The half space below the plane `normal . x = offset`.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Unit normal, which points out of the half space.
    pub normal: DVec3,
    /// Offset of the plane along the normal.
    pub offset: f64,
    /// sRGB-encoded colour.
    pub color: Vec3,
}

impl Sdf for SphereSdf {
    fn distance(&self, point: DVec3) -> f64 {
        (point - self.center).length() - self.radius
    }

    fn color(&self, _point: DVec3, _normal: DVec3) -> Vec3 {
        self.color
    }

    fn bounds(&self) -> DAabb {
        DAabb::around(self.center, DVec3::splat(self.radius))
    }
}

impl Sdf for Plane {
    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    fn color(&self, _point: DVec3, _normal: DVec3) -> Vec3 {
        self.color
    }

    fn bounds(&self) -> DAabb {
        DAabb::EVERYWHERE
    }
}
