//! The bounding volume hierarchy: built from boxes, with eight children per node. It knows no shapes.

mod build;
mod layout;
mod leaf_sweep;
mod node;
mod partition;
mod primitive;
mod refit;
mod split;
mod subtree;
mod tree;
mod validate;

pub use build::build;
pub use node::{BvhNode, Child};
pub use primitive::BvhPrimitive;
pub use refit::refit_boxes;
pub use tree::{Bvh, MAX_DEPTH, NO_PRIMITIVE, STACK_SIZE};
pub use validate::validate_boxes;
