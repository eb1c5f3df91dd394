//! Asking for nodes and blocks before they are needed.

use crate::bvh::{Child, Node};
use crate::flat::BlockTree;
use crate::math::{LANES, Lanes};

/// Where nodes and blocks lie: start, and size of one. A table, as a branch between the two could not be
/// foretold; it costs rays in flight a sixth of their time.
pub struct Memory {
    starts: [*const u8; 2],
    sizes: [usize; 2],
}

impl Memory {
    pub fn new<T: BlockTree>(tree: &T) -> Self {
        const BLOCK_BIT: usize = Child::BLOCK_BIT as usize;
        let (nodes, blocks) = (tree.nodes().as_ptr().cast(), tree.blocks().as_ptr().cast::<u8>());
        let block_size = size_of::<T::Block>();
        // As if there were a block for each word without the bit.
        let before = blocks.wrapping_sub(BLOCK_BIT.wrapping_mul(block_size));
        Self { starts: [nodes, before], sizes: [size_of::<Node>(), block_size] }
    }

    /// Asks for the first two cache lines of a packed child.
    #[inline(always)]
    pub fn prefetch<L: Lanes>(&self, child: u32) {
        let is_block = (child >> 31) as usize;
        let place =
            self.starts[is_block].wrapping_add((child as usize).wrapping_mul(self.sizes[is_block]));
        L::prefetch(place.cast::<[u8; 128]>());
    }

    /// Asks for these children of a node.
    #[inline(always)]
    pub fn prefetch_children<L: Lanes>(&self, node: &Node, mut lanes: u32) {
        let children = node.packed_children::<L>().store();
        while lanes != 0 {
            self.prefetch::<L>(children[lanes.trailing_zeros() as usize % LANES].to_bits());
            lanes &= lanes - 1;
        }
    }
}
