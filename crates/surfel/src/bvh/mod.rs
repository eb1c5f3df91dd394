//! The tree: built from boxes, eight children a node, and knows no shapes.

mod build;
mod node;
mod validate;

pub use build::build;
pub use node::{Child, Node};

use crate::math::Aabb;

/// A box to be sorted into the tree, with the index of what it bounds.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    pub bounds: Aabb,
    pub index: u32,
}

/// An eight-wide tree over blocks of up to eight primitives.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    /// The root first; empty if there are no primitives.
    pub nodes: Vec<Node>,
    /// Primitive indices: block b holds entries 8b .. 8b + 8, with `NO_PRIMITIVE` in unused lanes at its end.
    pub blocks: Vec<[u32; crate::math::LANES]>,
}

/// Marks an unused lane of a block.
pub const NO_PRIMITIVE: u32 = u32::MAX;

/// A traversal that pops one entry and pushes at most eight never holds more than this.
pub const STACK_SIZE: usize = MAX_DEPTH * 7 + 8;

/// Levels of nodes; `build` keeps to it for any input.
pub const MAX_DEPTH: usize = 56;
