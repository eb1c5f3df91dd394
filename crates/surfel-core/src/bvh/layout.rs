//! The order of nodes and blocks in memory.

use super::node::BvhNode;
use super::primitive::BvhPrimitive;
use super::subtree::{Branch, Subtree};
use super::tree::{Bvh, NO_PRIMITIVE};
use crate::error::{Error, Result};
use crate::math::LANES;
use rayon::prelude::*;

/// Minimum number of nodes of a subtree that several threads share.
const MIN_PARALLEL: usize = 1024;

type Block = [u32; LANES];

/// Stores the children of a node next to each other, followed by the descendants of each child in turn. All nodes
/// below a node form one range, and so do all blocks. Fails if lanes of blocks exceed 32-bit indices.
pub(super) fn layout(root: &Branch, primitives: &[BvhPrimitive]) -> Result<Bvh> {
    check_n_blocks(root.n_blocks)?;
    let mut nodes = vec![BvhNode::default(); 1 + root.n_nodes];
    let mut blocks = vec![[NO_PRIMITIVE; LANES]; root.n_blocks];
    let (first, below) = nodes.split_at_mut(1);
    let below = OutputRange { nodes: below, first_node: 1, blocks: &mut blocks, first_block: 0 };
    layout_branch(root, primitives, &mut first[0], below);
    Ok(Bvh { nodes, blocks })
}

/// Fails if lanes of blocks exceed 32-bit indices.
fn check_n_blocks(found: usize) -> Result<()> {
    let limit = u32::MAX as usize / LANES;
    if limit < found { Err(Error::TooManyBlocks { found, limit }) } else { Ok(()) }
}

/// The nodes and blocks below a node.
struct OutputRange<'b> {
    nodes: &'b mut [BvhNode],
    /// Index of the first of `nodes` in the whole tree.
    first_node: usize,
    blocks: &'b mut [Block],
    /// Index of the first of `blocks` in the whole tree.
    first_block: usize,
}

impl OutputRange<'_> {
    /// Splits `n_nodes` nodes and `n_blocks` blocks off the front.
    fn take(&mut self, n_nodes: usize, n_blocks: usize) -> Self {
        let (nodes, blocks) = (std::mem::take(&mut self.nodes), std::mem::take(&mut self.blocks));
        let (nodes, later_nodes) = nodes.split_at_mut(n_nodes);
        let (blocks, later_blocks) = blocks.split_at_mut(n_blocks);
        let taken =
            Self { nodes, first_node: self.first_node, blocks, first_block: self.first_block };
        *self = Self {
            nodes: later_nodes,
            first_node: self.first_node + n_nodes,
            blocks: later_blocks,
            first_block: self.first_block + n_blocks,
        };
        taken
    }
}

/// Writes a node and everything below it.
fn layout_branch(
    branch: &Branch,
    primitives: &[BvhPrimitive],
    node: &mut BvhNode,
    mut below: OutputRange,
) {
    let is_node = |child: &Subtree| matches!(child, Subtree::Branch(_));
    let n_nodes = branch.children.iter().filter(|child| is_node(child)).count();
    let n_blocks = branch.children.len() - n_nodes;
    *node = BvhNode::new(n_nodes, n_blocks, below.first_node as u32, below.first_block as u32);
    let children = below.take(n_nodes, n_blocks);
    let (mut nodes, mut blocks) = (children.nodes.iter_mut(), children.blocks.iter_mut());
    let mut branches = Vec::with_capacity(n_nodes);
    for child in &branch.children {
        match child {
            Subtree::Block { offset, len } => {
                let primitives = &primitives[*offset..offset + len];
                for (lane, primitive) in blocks.next().into_iter().flatten().zip(primitives) {
                    *lane = primitive.index();
                }
            }
            Subtree::Branch(child) => {
                let range = below.take(child.n_nodes, child.n_blocks);
                branches.extend(nodes.next().map(|node| (child, node, range)));
            }
        }
    }
    let finish = |(child, node, range)| layout_branch(child, primitives, node, range);
    if branch.n_nodes < MIN_PARALLEL {
        branches.into_iter().for_each(finish);
    } else {
        branches.into_par_iter().for_each(finish);
    }
}

#[cfg(test)]
mod tests {
    //! Trees with more blocks than 32-bit indices can count.

    use super::*;

    #[test]
    fn too_many_blocks_for_32_bit_indices_are_an_error() {
        let limit = (1 << 29) - 1;
        assert_eq!(check_n_blocks(limit), Ok(()));
        let error = check_n_blocks(limit + 1).unwrap_err();
        assert_eq!(error, Error::TooManyBlocks { found: 1 << 29, limit });
    }
}
