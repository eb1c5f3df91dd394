//! The interface of trees whose leaves are blocks of eight primitives.

use crate::bvh::BvhNode;

/// The position of a primitive in a tree: eight times the index of its block, plus its lane.
pub type Slot = u32;

/// A tree whose leaves are blocks of eight primitives.
pub trait BlockTree {
    /// A leaf block.
    type Block;

    /// Returns the nodes, the root first. An empty tree has none.
    fn nodes(&self) -> &[BvhNode];

    /// Returns the leaf blocks.
    fn blocks(&self) -> &[Self::Block];
}
