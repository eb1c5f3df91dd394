//! Bounding boxes of primitives in two SIMD registers each.

use crate::math::{Aabb, Vec3, Vec4};

/// The bounding box and index of a primitive to be sorted into the tree.
#[derive(Clone, Copy, Debug)]
pub struct BvhPrimitive {
    /// Lower bounds, and the bits of the index in the fourth lane.
    lower: Vec4,
    /// Upper bounds, and the payload in the fourth lane.
    upper: Vec4,
}

/// A bounding box in SIMD registers, whose fourth lanes are ignored.
#[derive(Clone, Copy, Debug)]
pub(super) struct SimdAabb {
    /// Lower bounds of the three axes.
    pub lower: Vec4,
    /// Upper bounds of the three axes.
    pub upper: Vec4,
}

/// The bounding boxes of a range of primitives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// Bounding box of the primitives.
    pub bounds: SimdAabb,
    /// Bounding box of twice the centres of the primitives.
    pub centers: SimdAabb,
}

impl BvhPrimitive {
    /// Returns a primitive. The builder ignores `payload`, which the caller's `can_share_block` can read.
    pub fn new(bounds: Aabb, index: u32, payload: f32) -> Self {
        Self { lower: bounds.min.extend(f32::from_bits(index)), upper: bounds.max.extend(payload) }
    }

    /// Returns the index of the primitive.
    pub fn index(&self) -> u32 {
        self.lower.w.to_bits()
    }

    /// Returns the payload given to `new`.
    pub fn payload(&self) -> f32 {
        self.upper.w
    }

    /// Returns the bounding box.
    pub fn bounds(&self) -> Aabb {
        Aabb { min: self.lower.truncate(), max: self.upper.truncate() }
    }

    /// Returns the centre of the bounding box.
    pub fn center(&self) -> Vec3 {
        0.5 * self.doubled_center().truncate()
    }

    /// Returns true if the box is finite and not empty.
    pub(super) fn is_valid(&self) -> bool {
        let Aabb { min, max } = self.bounds();
        min.cmple(max).all() && (max - min).is_finite()
    }

    /// Returns the bounds in SIMD registers.
    #[inline(always)]
    pub(super) fn simd_bounds(&self) -> SimdAabb {
        SimdAabb { lower: self.lower, upper: self.upper }
    }

    /// Returns twice the center of the bounds.
    #[inline(always)]
    pub(super) fn doubled_center(&self) -> Vec4 {
        self.lower + self.upper
    }

    /// Returns twice the center of the bounds along an axis.
    #[inline(always)]
    pub(super) fn doubled_center_along(&self, axis: usize) -> f32 {
        // Arrays, because indexing a `Vec4` branches.
        let (lower, upper): (&[f32; 4], &[f32; 4]) = (self.lower.as_ref(), self.upper.as_ref());
        lower[axis] + upper[axis]
    }
}

impl SimdAabb {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self { lower: Vec4::INFINITY, upper: Vec4::NEG_INFINITY };

    /// Returns the smallest box that contains both boxes.
    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// Returns half of the surface area.
    #[inline(always)]
    pub fn half_area(self) -> f32 {
        let size = self.upper - self.lower;
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Returns the index of the axis along which the box is longest.
    pub fn longest_axis(self) -> usize {
        (self.upper - self.lower).truncate().max_position()
    }
}

impl Extent {
    /// The extent of no primitives.
    pub const EMPTY: Self = Self { bounds: SimdAabb::EMPTY, centers: SimdAabb::EMPTY };

    /// Returns the extent of `primitives`.
    pub fn of(primitives: &[BvhPrimitive]) -> Self {
        let mut extent = Self::EMPTY;
        for primitive in primitives {
            let center = primitive.doubled_center();
            extent.bounds = extent.bounds.union(primitive.simd_bounds());
            extent.centers = extent.centers.union(SimdAabb { lower: center, upper: center });
        }
        extent
    }

    /// Returns the extent of the primitives of both extents.
    pub fn union(self, other: Self) -> Self {
        Self { bounds: self.bounds.union(other.bounds), centers: self.centers.union(other.centers) }
    }
}
