//! The nearest Gaussians of a ray that have not been composited yet.

use crate::flat::Slot;

/// Number of Gaussians that are held at a time.
pub const BUFFER_SIZE: usize = 16;

/// A Gaussian that a ray passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianHit {
    /// Distance along the ray in world space at which the Gaussian is densest.
    pub distance: f32,
    /// Index of the cloud among those that are traced.
    pub cloud_idx: u32,
    /// Slot in its cloud.
    pub slot: Slot,
    /// Square of the distance from the Gaussian's centre, in deviations.
    pub squared: f32,
}

impl GaussianHit {
    /// A hit that comes before all others.
    pub const BEFORE_ALL: Self = Self { distance: -1.0, cloud_idx: 0, slot: 0, squared: 0.0 };

    /// Returns a number that orders hits by distance, which is never negative, then by cloud and slot.
    #[inline(always)]
    fn key(&self) -> u128 {
        let index = u64::from(self.cloud_idx) << 32 | u64::from(self.slot);
        u128::from(self.distance.to_bits()) << 64 | u128::from(index)
    }

    /// Returns true if this hit comes before another one.
    #[inline(always)]
    pub fn is_before(&self, other: &Self) -> bool {
        self.distance < other.distance
            || self.distance == other.distance && self.key() < other.key()
    }
}

/// The nearest Gaussians behind a hit, nearest first.
#[derive(Clone, Copy, Debug)]
pub struct GaussianBuffer {
    hits: [GaussianHit; BUFFER_SIZE],
    len: usize,
}

impl GaussianBuffer {
    /// A buffer without hits.
    pub const EMPTY: Self = Self { hits: [GaussianHit::BEFORE_ALL; BUFFER_SIZE], len: 0 };

    /// Returns the hits, nearest first.
    #[inline(always)]
    pub fn hits(&self) -> &[GaussianHit] {
        &self.hits[..self.len]
    }

    /// Returns true if there may be more hits behind those that are held.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.len == BUFFER_SIZE
    }

    /// Returns the distance beyond which `insert` takes nothing: that of the last hit once the buffer is full.
    #[inline(always)]
    pub fn bound(&self) -> f32 {
        if self.is_full() { self.hits[BUFFER_SIZE - 1].distance } else { f32::INFINITY }
    }

    /// Inserts a hit if it is among the nearest.
    #[inline(always)]
    pub fn insert(&mut self, hit: GaussianHit) {
        let mut i = self.len.min(BUFFER_SIZE - 1);
        if self.is_full() && !hit.is_before(&self.hits[i]) {
            return;
        }
        while 0 < i && hit.is_before(&self.hits[i - 1]) {
            self.hits[i] = self.hits[i - 1];
            i -= 1;
        }
        self.hits[i] = hit;
        self.len = (self.len + 1).min(BUFFER_SIZE);
    }
}
