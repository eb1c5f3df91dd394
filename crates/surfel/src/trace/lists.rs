//! The hits of sixteen rays, each ray's sorted, all at once.

use super::hit::{Gather, Hit};
use crate::math::{WIDE, Wide};
use crate::surface::MAX_GATHERED;

/// Row i holds the i-th hit of each ray.
pub struct Lists {
    distances: [[f32; WIDE]; MAX_GATHERED],
    /// As the bits of floats, which is how lanes hold them.
    slots: [[f32; WIDE]; MAX_GATHERED],
    lens: [usize; WIDE],
}

impl Lists {
    #[inline(always)]
    pub fn new() -> Self {
        Self {
            distances: [[Hit::MISS.distance; WIDE]; MAX_GATHERED],
            slots: [[f32::from_bits(Hit::MISS.slot); WIDE]; MAX_GATHERED],
            lens: [0; WIDE],
        }
    }

    /// Adds a hit to the lists of `lanes`.
    #[inline(always)]
    pub fn add(&mut self, mut lanes: u32, distances: &[f32; WIDE], slot: u32) {
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDE;
            lanes &= lanes - 1;
            // A zero below zero would not sort by its bits.
            let hit = Hit { distance: distances[lane] + 0.0, slot };
            let place = self.lens[lane];
            if place < MAX_GATHERED {
                self.set(lane, place, hit);
                self.lens[lane] += 1;
            } else {
                self.replace_farthest(lane, hit);
            }
        }
    }

    #[cold]
    fn replace_farthest(&mut self, lane: usize, hit: Hit) {
        let mut farthest = 0;
        for place in 1..MAX_GATHERED {
            if self.hit(lane, farthest).is_before(&self.hit(lane, place)) {
                farthest = place;
            }
        }
        if hit.is_before(&self.hit(lane, farthest)) {
            self.set(lane, farthest, hit);
        }
    }

    /// Nearest first: odd-even merge sort (Batcher 1968), each step in all lists.
    #[inline(always)]
    pub fn sort<W: Wide>(&mut self) {
        let n = self.lens.into_iter().fold(0, usize::max);
        let mut merged = 1;
        while merged < n {
            let mut step = merged;
            while 0 < step {
                let mut first = step % merged;
                while first + step < n {
                    for place in first..(first + step).min(n - step) {
                        if place / (2 * merged) == (place + step) / (2 * merged) {
                            self.exchange::<W>(place, place + step);
                        }
                    }
                    first += 2 * step;
                }
                step /= 2;
            }
            merged *= 2;
        }
    }

    /// Puts the nearer of two hits first.
    #[inline(always)]
    fn exchange<W: Wide>(&mut self, a: usize, b: usize) {
        let (near, far) = (W::load(&self.distances[a]), W::load(&self.distances[b]));
        let (slot, other) = (W::load(&self.slots[a]), W::load(&self.slots[b]));
        let is_wrong = far.less(near) | (far.less_equal(near) & other.less_bits(slot));
        self.distances[a] = W::select(is_wrong, far, near).store();
        self.distances[b] = W::select(is_wrong, near, far).store();
        self.slots[a] = W::select(is_wrong, other, slot).store();
        self.slots[b] = W::select(is_wrong, slot, other).store();
    }

    #[inline(always)]
    pub fn copy_to(&self, lane: usize, gather: &mut Gather) {
        *gather = Gather::EMPTY;
        for place in 0..self.lens[lane] {
            gather.push(self.hit(lane, place));
        }
    }

    fn hit(&self, lane: usize, place: usize) -> Hit {
        let (distance, slot) = (self.distances[place][lane], self.slots[place][lane]);
        Hit { distance, slot: slot.to_bits() }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, place: usize, hit: Hit) {
        self.distances[place][lane] = hit.distance;
        self.slots[place][lane] = f32::from_bits(hit.slot);
    }
}
