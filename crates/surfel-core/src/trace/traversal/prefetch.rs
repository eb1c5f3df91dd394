//! Prefetches of nodes and blocks.

use crate::bvh::{BvhNode, Child};
use crate::flat::BlockTree;
use crate::math::{LANES, Lanes, set_bits};

/// Prefetches the nodes and blocks of a tree.
///
/// It holds the addresses and the sizes of both in a table, as a branch between the two is unpredictable: it
/// costs interleaved rays a sixth of their time.
pub struct Prefetcher {
    starts: [*const u8; 2],
    sizes: [usize; 2],
}

impl Prefetcher {
    /// Returns the prefetcher of `tree`.
    pub fn new<T: BlockTree>(tree: &T) -> Self {
        const BLOCK_BIT: usize = Child::BLOCK_BIT as usize;
        let (nodes, blocks) = (tree.nodes().as_ptr().cast(), tree.blocks().as_ptr().cast::<u8>());
        let block_size = size_of::<T::Block>();
        // The address that block 0 would have if there were a block for each word without the bit, too.
        let before = blocks.wrapping_sub(BLOCK_BIT.wrapping_mul(block_size));
        Self { starts: [nodes, before], sizes: [size_of::<BvhNode>(), block_size] }
    }

    /// Prefetches the first two cache lines of a packed child.
    #[inline(always)]
    pub fn prefetch<L: Lanes>(&self, child: u32) {
        let is_block = (child >> 31) as usize;
        let address =
            self.starts[is_block].wrapping_add((child as usize).wrapping_mul(self.sizes[is_block]));
        L::prefetch(address.cast::<[u8; 128]>());
    }

    /// Prefetches the children of a node in `lanes`.
    #[inline(always)]
    pub fn prefetch_children<L: Lanes>(&self, node: &BvhNode, lanes: u32) {
        let children = node.packed_children::<L>().store();
        for lane in set_bits::<LANES>(lanes) {
            self.prefetch::<L>(children[lane].to_bits());
        }
    }
}
