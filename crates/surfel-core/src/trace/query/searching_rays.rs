//! Rays that search for a surface near the shapes that they hit, one shape after the other.

use crate::flat::Slot;
use crate::math::{PACKET_WIDTH, Ray};
use crate::trace::query::hit::Hit;

/// Rays whose search goes on behind the shapes that were tried.
pub struct SearchingRays<'r> {
    all_rays: &'r [Ray],
    /// The rays that search, from where they go on.
    pub rays: Vec<Ray>,
    /// The nearest shape of each of them.
    pub nearest: Vec<Hit>,
    ray_indices: Vec<u32>,
    n_restarted: usize,
}

/// The candidates of up to sixteen rays.
pub struct CandidatePacket {
    /// Number of rays.
    pub len: usize,
    /// The rays in their whole length: the surface may lie before a shape, and even before those that were rejected.
    pub rays: [Ray; PACKET_WIDTH],
    /// Slots of the shapes that the rays hit.
    pub slots: [Slot; PACKET_WIDTH],
    /// Distances of these hits along the rays.
    pub distances: [f32; PACKET_WIDTH],
}

impl<'r> SearchingRays<'r> {
    /// Returns the search of all rays from their beginnings.
    pub fn new(all_rays: &'r [Ray]) -> Self {
        Self {
            all_rays,
            rays: all_rays.to_vec(),
            nearest: vec![Hit::MISS; all_rays.len()],
            ray_indices: (0..all_rays.len() as u32).collect(),
            n_restarted: 0,
        }
    }

    /// Ends the search of rays that hit no shape, and returns the number of those left.
    #[inline(always)]
    pub fn drop_misses(&mut self) -> usize {
        let mut n_left = 0;
        for i in 0..self.rays.len() {
            if !self.nearest[i].is_miss() {
                self.move_ray(i, n_left);
                self.nearest[n_left] = self.nearest[i];
                n_left += 1;
            }
        }
        self.rays.truncate(n_left);
        self.n_restarted = 0;
        n_left
    }

    /// Returns up to sixteen candidates from the one at an index on.
    #[inline(always)]
    pub fn packet(&self, first: usize) -> CandidatePacket {
        let mut packet = CandidatePacket {
            len: PACKET_WIDTH.min(self.rays.len() - first),
            rays: [self.all_rays[0]; PACKET_WIDTH],
            slots: [0; PACKET_WIDTH],
            distances: [0.0; PACKET_WIDTH],
        };
        for lane in 0..packet.len {
            let Hit { distance, slot } = self.nearest[first + lane];
            (packet.slots[lane], packet.distances[lane]) = (slot, distance);
            packet.rays[lane] = self.all_rays[self.ray_idx(first + lane)];
        }
        packet
    }

    /// Returns the index of a candidate's ray among all rays.
    #[inline(always)]
    pub fn ray_idx(&self, candidate_idx: usize) -> usize {
        self.ray_indices[candidate_idx] as usize
    }

    /// Lets the ray of a candidate go on at `t_min`. The candidates must come in their order.
    #[inline(always)]
    pub fn restart(&mut self, candidate_idx: usize, t_min: f32) {
        self.move_ray(candidate_idx, self.n_restarted);
        self.rays[self.n_restarted].t_min = t_min;
        self.n_restarted += 1;
    }

    /// Ends the search of rays that did not restart. Returns true if others are left.
    #[inline(always)]
    pub fn keep_restarted(&mut self) -> bool {
        self.rays.truncate(self.n_restarted);
        self.nearest.truncate(self.n_restarted);
        !self.rays.is_empty()
    }

    #[inline(always)]
    fn move_ray(&mut self, from: usize, to: usize) {
        self.rays[to] = self.rays[from];
        self.ray_indices[to] = self.ray_indices[from];
    }
}

impl CandidatePacket {
    /// Returns the lanes of the rays.
    #[inline(always)]
    pub fn lanes(&self) -> u32 {
        (1 << self.len) - 1
    }
}
