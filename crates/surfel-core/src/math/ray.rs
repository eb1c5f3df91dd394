//! Rays with a range of distances.

use super::Vec3;

/// A ray: the points `origin + t * direction` for `t_min <= t <= t_max`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Ray {
    /// The point at distance 0.
    pub origin: Vec3,
    /// Least distance at which a hit counts.
    pub t_min: f32,
    /// Unit direction.
    pub direction: Vec3,
    /// Greatest distance at which a hit counts.
    pub t_max: f32,
}

impl Ray {
    /// Returns a ray with the range from 0 to infinity.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// Returns the point at a distance along the ray.
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + distance * self.direction
    }
}
