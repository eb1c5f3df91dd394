//! Axis-aligned boxes.

use super::Vec3;

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

    /// Index of the longest side.
    pub fn longest_axis(self) -> usize {
        self.size().max_position()
    }
}
