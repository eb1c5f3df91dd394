//! A tree whose leaves are blocks of eight of something.

use crate::bvh::Node;

pub trait BlockTree {
    type Block;

    /// The root first; empty where there is nothing.
    fn nodes(&self) -> &[Node];

    fn blocks(&self) -> &[Self::Block];
}
