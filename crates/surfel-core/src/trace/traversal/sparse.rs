//! Blocks that few rays of a packet enter: each ray is tested against its own blocks.
//!
//! Hardly two rays of a packet hit the same discs if many points lie behind a pixel. To push the blocks of a
//! node on the stack one by one, and to test each of their discs against all rays, then costs more than to
//! find out which ray enters which block. Searches for any hit and gathers do not use this: they became a
//! tenth slower.

use crate::bvh::Child;
use crate::math::{LANES, Lanes};
use crate::trace::traversal::children::OverlappedChildren;
use crate::trace::traversal::packet::{Packet, PacketVisitor};

/// Number of blocks after which the counts are halved.
const DECAY_INTERVAL: u32 = 256;

/// The average number of rays that entered the recent blocks. The cost of a search depends on it, its result
/// does not.
pub struct LeafOccupancy {
    n_rays: u32,
    n_blocks: u32,
}

impl LeafOccupancy {
    /// Returns the occupancy before the first block.
    pub fn new() -> Self {
        Self { n_rays: 0, n_blocks: 0 }
    }

    /// Counts blocks and the rays that enter them.
    #[inline(always)]
    pub fn add(&mut self, n_rays: u32, n_blocks: u32) {
        self.n_rays += n_rays;
        self.n_blocks += n_blocks;
    }

    /// Lets old blocks count less.
    #[inline(always)]
    pub fn decay(&mut self) {
        if DECAY_INTERVAL < self.n_blocks {
            self.n_rays /= 2;
            self.n_blocks /= 2;
        }
    }

    /// True if fewer than `n_rays` rays entered a block on average.
    ///
    /// It is false before the first block: with many instances, testing each ray against the blocks of one
    /// node costs as much as a whole packet.
    #[inline(always)]
    pub fn is_below(&self, n_rays: f32) -> bool {
        (self.n_rays as f32) < n_rays * self.n_blocks as f32
    }
}

/// Tests the blocks below a node, which has no other children, against each of `rays` that enters their
/// boxes.
#[inline(always)]
pub fn test_rays_individually<L: Lanes, V: PacketVisitor<L>>(
    tree: &V::Tree,
    children: &OverlappedChildren<L>,
    packet: &Packet<L::PacketLanes>,
    rays: u32,
    occupancy: &mut LeafOccupancy,
    visitor: &mut V,
) {
    // All boxes come before the first block, so that no branch waits for a hit: to update the limits in
    // between would cost all that is gained.
    let mut entered = [(0, 0); LANES];
    let (mut n_rays, mut n_blocks) = (0, 0);
    for child in children.iter() {
        let lanes = packet.intersect_box(&child, visitor.limits()) & rays;
        entered[n_blocks] = (child.child & !Child::BLOCK_BIT, lanes);
        n_rays += lanes.count_ones();
        n_blocks += usize::from(lanes != 0);
    }
    occupancy.add(n_rays, n_blocks as u32);
    visitor.visit_sparse(tree, &entered[..n_blocks]);
}
