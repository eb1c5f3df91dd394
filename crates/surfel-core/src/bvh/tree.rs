//! The finished tree and its limits.

use super::node::BvhNode;
use crate::math::LANES;

/// An eight-wide tree over blocks of up to eight primitives.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    /// Nodes, the root first. A tree without primitives has none. All nodes below a node form one range behind it.
    pub nodes: Vec<BvhNode>,
    /// Primitive indices of each block, with `NO_PRIMITIVE` in unused lanes at its end.
    pub blocks: Vec<[u32; LANES]>,
}

/// Marks an unused lane of a block.
pub const NO_PRIMITIVE: u32 = u32::MAX;

/// Maximum number of levels of nodes. `build` stays within it for any input.
pub const MAX_DEPTH: usize = 56;

/// Maximum number of stack entries of a traversal that pops one entry and pushes at most eight.
pub const STACK_SIZE: usize = MAX_DEPTH * 7 + 8;
