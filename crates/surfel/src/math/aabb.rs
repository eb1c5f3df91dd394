//! Axis-aligned boxes.

use super::{Ray, Vec3};

/// All points between `min` and `max`, faces included.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Aabb {
    pub min: Vec3,
    pub max: Vec3,
}

impl Aabb {
    /// Contains nothing; growing it by a point gives that point.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    pub fn of_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    pub fn including(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    pub fn is_empty(self) -> bool {
        !self.min.cmple(self.max).all()
    }

    pub fn contains(self, other: Self) -> bool {
        self.min.cmple(other.min).all() && other.max.cmple(self.max).all()
    }

    pub fn center(self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    pub fn size(self) -> Vec3 {
        self.max - self.min
    }

    pub fn diagonal(self) -> f32 {
        if self.is_empty() { 0.0 } else { self.size().length() }
    }

    pub fn half_area(self) -> f32 {
        let size = self.size();
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Length of what a ray's range has inside.
    pub fn length_along(self, ray: &Ray) -> f32 {
        let (mut near, mut far) = (ray.t_min, ray.t_max);
        for axis in 0..3 {
            let side = |side: Vec3| (side[axis] - ray.origin[axis]) / ray.direction[axis];
            let (low, high) = (side(self.min), side(self.max));
            // NaN in the plane of a side, where the ray stays.
            if !(low.is_nan() || high.is_nan()) {
                near = near.max(low.min(high));
                far = far.min(low.max(high));
            }
        }
        (far - near).max(0.0)
    }

    /// Index of the longest side.
    pub fn longest_axis(self) -> usize {
        self.size().max_position()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_has_as_much_inside_as_its_range_says() {
        let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        let from = |x: f32, y: f32| Ray::new(Vec3::new(x, y, 0.5), Vec3::X);
        assert_eq!(unit.length_along(&from(-2.0, 0.5)), 1.0);
        assert_eq!(unit.length_along(&from(0.25, 0.5)), 0.75);
        assert_eq!(unit.length_along(&Ray { t_max: 2.5, ..from(-2.0, 0.5) }), 0.5);
        assert_eq!(unit.length_along(&from(2.0, 0.5)), 0.0);
        assert_eq!(unit.length_along(&from(-2.0, 1.5)), 0.0);
        // Along a side, whose plane it never crosses.
        assert_eq!(unit.length_along(&from(-2.0, 1.0)), 1.0);
        assert_eq!(unit.length_along(&from(-2.0, 0.0)), 1.0);
    }
}
