//! The results of the searches for shapes.

use crate::flat::Slot;
use crate::math::Floats;
use crate::surface::MAX_GATHERED;

/// Maximum number of rejected hits of a ray. A ray with more runs along a rim, where each step is tiny, and
/// is taken to miss.
pub const MAX_REJECTED_HITS: usize = 48;
/// Distance behind a rejected hit at which the search restarts, in radii.
pub const RESTART_OFFSET: f32 = 0.05;

/// The nearest shape on a ray. Of two equally near shapes it is the one in the lower slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, infinite if nothing was hit.
    pub distance: f32,
    /// Slot of the point or triangle; `id` of `FlatPoints` or `FlatTriangles` returns its index.
    pub slot: Slot,
}

impl Hit {
    /// The result of a ray that hits nothing.
    pub const MISS: Self = Self { distance: f32::INFINITY, slot: Slot::MAX };

    /// True if nothing was hit.
    pub fn is_miss(&self) -> bool {
        self.slot == Slot::MAX
    }

    /// Returns true if this hit is nearer, or as near and earlier in the tree.
    #[inline(always)]
    pub(in crate::trace) fn is_before(&self, other: &Self) -> bool {
        self.key() < other.key()
    }

    /// Returns the nearer of two hits.
    #[inline(always)]
    pub(in crate::trace) fn nearer(self, other: Self) -> Self {
        let key = self.key().min(other.key());
        Self { distance: f32::from_bits((key >> 32) as u32), slot: key as u32 }
    }

    /// Returns a number that orders hits by distance, which is never negative, then by slot: the bits of
    /// positive floats have the order of the floats. It is one number, as a branch here would be
    /// unpredictable.
    #[inline(always)]
    pub(in crate::trace) fn key(&self) -> u64 {
        u64::from(self.distance.to_bits()) << 32 | u64::from(self.slot)
    }
}

/// The nearest hits in lanes: those of sixteen rays, or of one ray in each lane of its blocks.
#[derive(Clone, Copy)]
pub(in crate::trace) struct NearestHits<F> {
    /// Distances along the rays.
    pub distances: F,
    /// Slots, as bits.
    pub slots: F,
}

impl<F: Floats> NearestHits<F> {
    /// Takes those hits in `lanes` that are nearer, or equally near and in a lower slot.
    #[inline(always)]
    pub fn merge(&mut self, lanes: F::Mask, distances: F, slots: F) {
        let is_first = distances.lt(self.distances) | slots.lt_u32(self.slots);
        let nearer = lanes & distances.le(self.distances) & is_first;
        self.distances = F::select(nearer, distances, self.distances);
        self.slots = F::select(nearer, slots, self.slots);
    }
}

/// The nearest shapes on a ray, nearest first, none farther than the least `gather_limit` of them.
#[derive(Clone, Copy, Debug)]
pub struct Gather {
    hits: [Hit; MAX_GATHERED],
    len: usize,
}

impl Gather {
    /// The result of a ray that hits nothing.
    pub const EMPTY: Self = Self { hits: [Hit::MISS; MAX_GATHERED], len: 0 };

    /// Returns the hits, nearest first.
    pub fn hits(&self) -> &[Hit] {
        &self.hits[..self.len]
    }

    /// Inserts `hit` if it is among the nearest.
    #[inline(always)]
    pub(in crate::trace) fn insert(&mut self, hit: Hit) {
        let mut i = self.len.min(MAX_GATHERED - 1);
        if self.len == MAX_GATHERED && !hit.is_before(&self.hits[i]) {
            return;
        }
        while 0 < i && hit.is_before(&self.hits[i - 1]) {
            self.hits[i] = self.hits[i - 1];
            i -= 1;
        }
        self.hits[i] = hit;
        self.len = (self.len + 1).min(MAX_GATHERED);
    }

    /// Drops the hits beyond a distance.
    #[inline(always)]
    pub(in crate::trace) fn drop_beyond(&mut self, limit: f32) {
        while 0 < self.len && limit < self.hits[self.len - 1].distance {
            self.len -= 1;
        }
    }

    /// Returns the distance beyond which `insert` takes nothing: that of the last hit once the list is full.
    #[inline(always)]
    pub(in crate::trace) fn bound(&self) -> f32 {
        if self.len == MAX_GATHERED { self.hits[MAX_GATHERED - 1].distance } else { f32::INFINITY }
    }
}
