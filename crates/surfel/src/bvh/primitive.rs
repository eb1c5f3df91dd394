//! What is sorted into the tree: boxes in two SIMD registers each.

use crate::math::{Aabb, Vec3, Vec4};

/// A box to be sorted into the tree, with the index of what it bounds.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    /// The index stands in the fourth lane, as bits.
    lower: Vec4,
    /// The scale stands in the fourth lane.
    upper: Vec4,
}

/// A box whose fourth lanes are of no account.
#[derive(Clone, Copy, Debug)]
pub(super) struct WideBox {
    pub lower: Vec4,
    pub upper: Vec4,
}

/// What a range of primitives covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub bounds: WideBox,
    /// Of the centres, times two.
    pub centers: WideBox,
}

impl Primitive {
    /// `scale` is carried along for the caller's `fits`.
    ///
    /// Boxes that are empty or not finite stay out of the tree.
    pub fn new(bounds: Aabb, index: u32, scale: f32) -> Self {
        Self { lower: bounds.min.extend(f32::from_bits(index)), upper: bounds.max.extend(scale) }
    }

    pub fn index(&self) -> u32 {
        self.lower.w.to_bits()
    }

    pub fn scale(&self) -> f32 {
        self.upper.w
    }

    pub fn bounds(&self) -> Aabb {
        Aabb { min: self.lower.truncate(), max: self.upper.truncate() }
    }

    pub fn center(&self) -> Vec3 {
        0.5 * self.doubled_center().truncate()
    }

    pub(super) fn is_solid(&self) -> bool {
        let Aabb { min, max } = self.bounds();
        min.cmple(max).all() && (max - min).is_finite()
    }

    #[inline(always)]
    pub(super) fn wide(&self) -> WideBox {
        WideBox { lower: self.lower, upper: self.upper }
    }

    #[inline(always)]
    pub(super) fn doubled_center(&self) -> Vec4 {
        self.lower + self.upper
    }

    #[inline(always)]
    pub(super) fn doubled_center_along(&self, axis: usize) -> f32 {
        // As arrays: to index a `Vec4` is a jump.
        let (lower, upper): (&[f32; 4], &[f32; 4]) = (self.lower.as_ref(), self.upper.as_ref());
        lower[axis] + upper[axis]
    }
}

impl WideBox {
    pub const EMPTY: Self = Self { lower: Vec4::INFINITY, upper: Vec4::NEG_INFINITY };

    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    #[inline(always)]
    pub fn half_area(self) -> f32 {
        let size = self.upper - self.lower;
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    pub fn longest_axis(self) -> usize {
        (self.upper - self.lower).truncate().max_position()
    }
}

impl Extent {
    pub const EMPTY: Self = Self { bounds: WideBox::EMPTY, centers: WideBox::EMPTY };

    pub fn of(primitives: &[Primitive]) -> Self {
        let mut extent = Self::EMPTY;
        for primitive in primitives {
            let center = primitive.doubled_center();
            extent.bounds = extent.bounds.union(primitive.wide());
            extent.centers = extent.centers.union(WideBox { lower: center, upper: center });
        }
        extent
    }

    pub fn union(self, other: Self) -> Self {
        Self { bounds: self.bounds.union(other.bounds), centers: self.centers.union(other.centers) }
    }
}
