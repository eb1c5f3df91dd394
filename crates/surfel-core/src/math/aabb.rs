//! Axis-aligned boxes.

use super::{Ray, Vec3, clip_to_slab};

/// The box of all points between `min` and `max`, faces included.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box: it contains nothing, and growing it by a point gives that point.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Returns the smallest box around points.
    pub fn of_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    /// Returns the smallest box around this box and a point.
    pub fn including(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Returns the smallest box around both boxes.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// True if the box contains no point.
    pub fn is_empty(self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// True if `other` lies within this box.
    pub fn contains(self, other: Self) -> bool {
        self.min.cmple(other.min).all() && other.max.cmple(self.max).all()
    }

    /// Returns the midpoint.
    pub fn center(self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Returns the lengths of the sides.
    pub fn size(self) -> Vec3 {
        self.max - self.min
    }

    /// Returns the length of the diagonal, 0 for an empty box.
    pub fn diagonal(self) -> f32 {
        if self.is_empty() { 0.0 } else { self.size().length() }
    }

    /// Returns half the surface area.
    pub fn half_area(self) -> f32 {
        let size = self.size();
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Returns the length of the part of a ray's range that lies inside.
    pub fn length_along(self, ray: &Ray) -> f32 {
        let mut range = (ray.t_min, ray.t_max);
        for axis in 0..3 {
            let side = |side: Vec3| (side[axis] - ray.origin[axis]) / ray.direction[axis];
            let (low, high) = (side(self.min), side(self.max));
            // NaN means that the ray lies in the plane of a side, which does not clip it.
            if !(low.is_nan() || high.is_nan()) {
                range = clip_to_slab(range, low, high);
            }
        }
        (range.1 - range.0).max(0.0)
    }

    /// Returns the index of the longest side.
    pub fn longest_axis(self) -> usize {
        self.size().max_position()
    }
}

#[cfg(test)]
mod tests {
    //! Rays are clipped to boxes.

    use super::*;

    #[test]
    fn length_inside_respects_the_range_of_the_ray() {
        let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        let from = |x: f32, y: f32| Ray::new(Vec3::new(x, y, 0.5), Vec3::X);
        assert_eq!(unit.length_along(&from(-2.0, 0.5)), 1.0);
        assert_eq!(unit.length_along(&from(0.25, 0.5)), 0.75);
        assert_eq!(unit.length_along(&Ray { t_max: 2.5, ..from(-2.0, 0.5) }), 0.5);
        assert_eq!(unit.length_along(&from(2.0, 0.5)), 0.0);
        assert_eq!(unit.length_along(&from(-2.0, 1.5)), 0.0);
        // These rays run within the plane of a side.
        assert_eq!(unit.length_along(&from(-2.0, 1.0)), 1.0);
        assert_eq!(unit.length_along(&from(-2.0, 0.0)), 1.0);
    }
}
