//! The field of weighted planes: at each position the mean of the signed distances from the planes of the points
//! around, whose zeros are the surface (Wald and Seidel, Interactive Ray Tracing of Point-based Models, 2005).

use super::align::MIN_ALIGNED_COSINE;
use crate::math::{Aabb, Floats, Vec3};

/// Radius of a point's weight function, in radii of the point.
pub const FIELD_SUPPORT: f32 = 1.2;
/// Minimum weight of all points at a position where the field has a value.
pub const MIN_FIELD_WEIGHT: f32 = 0.05;

/// Least distance of a point from the plane of another, relative to the distance between them, that tells the side of an
/// edge. Positions and normals are stored with errors a tenth as large.
const MIN_HEIGHT: f32 = 0.02;

/// A point of the field.
#[derive(Clone, Copy, Debug, Default)]
pub struct FieldPoint {
    /// Centre.
    pub center: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Radius of the weight function, 0 where there is no point.
    pub support: f32,
}

/// Sums over points, whose quotient is the field.
#[derive(Clone, Copy)]
pub struct FieldSums<F> {
    /// Sum of the weights.
    pub weight: F,
    /// Weighted sum of the distances from the points' planes.
    pub height: F,
}

impl<F: Floats> FieldSums<F> {
    /// Returns the sums over no points.
    #[inline(always)]
    pub fn new() -> Self {
        Self { weight: F::splat(0.0), height: F::splat(0.0) }
    }

    /// Adds a point of a weight, whose plane is `height` below the position.
    #[inline(always)]
    pub fn add(&mut self, weight: F, height: F) {
        self.weight = self.weight + weight;
        self.height = self.height + weight * height;
    }

    /// Returns the field, and the lanes in which it has a value.
    #[inline(always)]
    pub fn value(&self) -> (F, F::Mask) {
        (self.height / self.weight, F::splat(MIN_FIELD_WEIGHT).le(self.weight))
    }
}

impl<F: Floats> Default for FieldSums<F> {
    fn default() -> Self {
        Self::new()
    }
}

impl FieldPoint {
    /// True if the ball of the weight function overlaps a box.
    #[inline]
    pub fn overlaps(&self, cell: &Aabb) -> bool {
        let nearest = self.center.clamp(cell.min, cell.max);
        (nearest - self.center).length_squared() < self.support * self.support
    }

    /// Returns the least and greatest distance of the positions in a box from the point's plane.
    #[inline]
    pub fn heights(&self, cell: &Aabb) -> (f32, f32) {
        let height = self.normal.dot(cell.center() - self.center);
        let extent = self.normal.abs().dot(0.5 * cell.size());
        (height - extent, height + extent)
    }

    /// True if this point's normal is on the other side of the surface than that of `guide`. Normals at a wide angle,
    /// as on both sides of an edge, are on the same side if each point is below the other's plane, or each above.
    #[inline]
    pub fn is_flipped(&self, guide: &Self) -> bool {
        let cosine = self.normal.dot(guide.normal);
        if MIN_ALIGNED_COSINE <= cosine.abs() {
            return cosine < 0.0;
        }
        let offset = guide.center - self.center;
        let heights = [self.normal.dot(offset), guide.normal.dot(-offset)];
        // Points on the edge itself tell nothing.
        let tells = heights.iter().all(|height| MIN_HEIGHT * offset.length() < height.abs());
        tells && (heights[0] < 0.0) != (heights[1] < 0.0)
    }
}
