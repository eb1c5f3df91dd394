//! Asking for nodes and blocks before they are needed.

use crate::bvh::{Child, Node};
use crate::flat::{FlatPoints, PointBlock};
use crate::math::Lanes;

/// Where nodes and blocks lie: start, and size of one. A table, as a branch between the two could not be
/// foretold; it costs rays in flight a sixth of their time.
pub struct Memory([(*const u8, usize); 2]);

impl Memory {
    pub fn new(points: &FlatPoints) -> Self {
        Self([
            (points.nodes.as_ptr().cast(), size_of::<Node>()),
            (points.blocks.as_ptr().cast(), size_of::<PointBlock>()),
        ])
    }

    /// Asks for the two cache lines of a packed child.
    #[inline(always)]
    pub fn prefetch<L: Lanes>(&self, child: u32) {
        let (start, size) = self.0[(child >> 31) as usize];
        let place = start.wrapping_add((child & !Child::BLOCK_BIT) as usize * size);
        L::prefetch(place.cast::<[u8; 128]>());
    }
}
