//! What the searches find.

use crate::flat::Slot;
use crate::math::Floats;
use crate::surface::MAX_GATHERED;

/// The nearest shape on a ray: the one in the lower slot where two are equally near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Infinite if nothing was hit.
    pub distance: f32,
    /// Where the point or triangle lies; `id` of `FlatPoints` or `FlatTriangles` tells its index.
    pub slot: Slot,
}

impl Hit {
    pub const MISS: Self = Self { distance: f32::INFINITY, slot: Slot::MAX };

    pub fn is_miss(&self) -> bool {
        self.slot == Slot::MAX
    }

    #[inline(always)]
    pub(super) fn is_before(&self, other: &Self) -> bool {
        self.key() < other.key()
    }

    #[inline(always)]
    pub(super) fn nearer(self, other: Self) -> Self {
        let key = self.key().min(other.key());
        Self { distance: f32::from_bits((key >> 32) as u32), slot: key as u32 }
    }

    /// Orders hits by distance, which is never negative, then by slot: the bits of positive floats are
    /// ordered as the floats are. In one number, as a branch here could not be foretold.
    #[inline(always)]
    pub(super) fn key(&self) -> u64 {
        u64::from(self.distance.to_bits()) << 32 | u64::from(self.slot)
    }
}

/// The nearest hits in lanes: of sixteen rays, or of one ray in each lane of its blocks.
#[derive(Clone, Copy)]
pub(super) struct NearestHits<F> {
    pub distances: F,
    /// As bits.
    pub slots: F,
}

impl<F: Floats> NearestHits<F> {
    /// Takes what is nearer among `lanes`, or as near and in a lower slot.
    #[inline(always)]
    pub fn take(&mut self, lanes: F::Mask, distances: F, slots: F) {
        let is_first = distances.less(self.distances) | slots.less_bits(self.slots);
        let nearer = lanes & distances.less_equal(self.distances) & is_first;
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
    pub const EMPTY: Self = Self { hits: [Hit::MISS; MAX_GATHERED], len: 0 };

    pub fn hits(&self) -> &[Hit] {
        &self.hits[..self.len]
    }

    /// Takes `hit` in if it is among the nearest.
    #[inline(always)]
    pub(super) fn insert(&mut self, hit: Hit) {
        let mut place = self.len.min(MAX_GATHERED - 1);
        if self.len == MAX_GATHERED && !hit.is_before(&self.hits[place]) {
            return;
        }
        while 0 < place && hit.is_before(&self.hits[place - 1]) {
            self.hits[place] = self.hits[place - 1];
            place -= 1;
        }
        self.hits[place] = hit;
        self.len = (self.len + 1).min(MAX_GATHERED);
    }

    #[inline(always)]
    pub(super) fn drop_beyond(&mut self, limit: f32) {
        while 0 < self.len && limit < self.hits[self.len - 1].distance {
            self.len -= 1;
        }
    }

    /// Once full, nothing beyond the last is taken in any more.
    #[inline(always)]
    pub(super) fn reach(&self) -> f32 {
        if self.len == MAX_GATHERED { self.hits[MAX_GATHERED - 1].distance } else { f32::INFINITY }
    }
}
