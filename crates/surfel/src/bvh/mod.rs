//! The tree: built from boxes, eight children a node, and knows no shapes.

mod build;
mod emit;
mod fit;
mod node;
mod partition;
mod primitive;
mod small;
mod split;
mod validate;

pub use build::build;
pub use fit::fit_boxes;
pub use node::{Child, Node};
pub use primitive::Primitive;
pub use validate::validate_boxes;

/// An eight-wide tree over blocks of up to eight primitives.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    /// The root first; empty if there are no primitives. What is below a node stands together behind it.
    pub nodes: Vec<Node>,
    /// Primitive indices, `NO_PRIMITIVE` in unused lanes at a block's end.
    pub blocks: Vec<[u32; crate::math::LANES]>,
}

/// Marks an unused lane of a block.
pub const NO_PRIMITIVE: u32 = u32::MAX;

/// A traversal that pops one entry and pushes at most eight never holds more than this.
pub const STACK_SIZE: usize = MAX_DEPTH * 7 + 8;

/// Levels of nodes; `build` keeps to it for any input.
pub const MAX_DEPTH: usize = 56;
