//! Giving nodes and blocks their places.

use super::build::{Branch, Subtree};
use super::{Bvh, NO_PRIMITIVE, Node, Primitive};
use crate::error::{Error, Result};
use crate::math::LANES;
use rayon::prelude::*;

/// Below this many nodes a subtree is worked on by one thread.
const PARALLEL_MIN: usize = 1024;

type Block = [u32; LANES];

/// Puts the children of a node beside each other and then what is below each of them, depth first:
/// a subtree is one range of nodes and one of blocks.
pub(super) fn emit(root: &Branch, primitives: &[Primitive]) -> Result<Bvh> {
    check_n_blocks(root.n_blocks)?;
    let mut nodes = vec![Node::default(); 1 + root.n_nodes];
    let mut blocks = vec![[NO_PRIMITIVE; LANES]; root.n_blocks];
    let (first, below) = nodes.split_at_mut(1);
    let place = Place { nodes: below, first_node: 1, blocks: &mut blocks, first_block: 0 };
    emit_branch(root, primitives, &mut first[0], place);
    Ok(Bvh { nodes, blocks })
}

/// Every lane of every block has a number of its own.
fn check_n_blocks(found: usize) -> Result<()> {
    let limit = u32::MAX as usize / LANES;
    if limit < found { Err(Error::TooManyBlocks { found, limit }) } else { Ok(()) }
}

/// Where everything below a node goes.
struct Place<'b> {
    nodes: &'b mut [Node],
    /// Index of the first of `nodes` in the whole tree.
    first_node: usize,
    blocks: &'b mut [Block],
    first_block: usize,
}

impl<'b> Place<'b> {
    /// Cuts so many nodes and blocks off the front.
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

fn emit_branch(branch: &Branch, primitives: &[Primitive], node: &mut Node, mut place: Place) {
    let is_node = |child: &Subtree| matches!(child, Subtree::Branch(_));
    let n_nodes = branch.children.iter().filter(|child| is_node(child)).count();
    let n_blocks = branch.children.len() - n_nodes;
    *node = Node::new(n_nodes, n_blocks, place.first_node as u32, place.first_block as u32);
    let own = place.take(n_nodes, n_blocks);
    let (mut nodes, mut blocks) = (own.nodes.iter_mut(), own.blocks.iter_mut());
    let mut branches = Vec::with_capacity(n_nodes);
    for child in &branch.children {
        match child {
            Subtree::Block { offset, len } => {
                let members = &primitives[*offset..offset + len];
                for (slot, primitive) in blocks.next().into_iter().flatten().zip(members) {
                    *slot = primitive.index();
                }
            }
            Subtree::Branch(child) => {
                let below = place.take(child.n_nodes, child.n_blocks);
                branches.extend(nodes.next().map(|node| (child, node, below)));
            }
        }
    }
    let finish = |(child, node, below)| emit_branch(child, primitives, node, below);
    if branch.n_nodes < PARALLEL_MIN {
        branches.into_iter().for_each(finish);
    } else {
        branches.into_par_iter().for_each(finish);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_blocks_than_there_are_numbers_are_refused() {
        let limit = (1 << 29) - 1;
        assert_eq!(check_n_blocks(limit), Ok(()));
        let error = check_n_blocks(limit + 1).unwrap_err();
        assert_eq!(error, Error::TooManyBlocks { found: 1 << 29, limit });
    }
}
