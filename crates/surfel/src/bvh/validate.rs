//! Checks that a tree is one: run after each build in debug, and by tests.

use super::{Bvh, Child, MAX_DEPTH, NO_PRIMITIVE, Node, Primitive};
use crate::math::{Aabb, LANES};

impl Bvh {
    /// Panics unless every primitive is in exactly one block, and every block in one node.
    pub fn validate(&self, primitives: &[Primitive]) {
        let n_blocks = visit(&self.nodes, |_, _| ());
        assert_eq!(n_blocks, self.blocks.len(), "blocks reached");
        let is_used = |index: &&u32| **index != NO_PRIMITIVE;
        let mut found: Vec<u32> =
            self.blocks.as_flattened().iter().filter(is_used).copied().collect();
        let mut expected: Vec<u32> = primitives.iter().map(Primitive::index).collect();
        found.sort_unstable();
        expected.sort_unstable();
        assert!(found == expected, "each primitive stands in one block");
    }
}

/// Panics unless every block's box is inside all boxes above it.
pub fn validate_boxes(nodes: &[Node], block_box: impl Fn(u32) -> Aabb) {
    // Children are encoded on another grid than their parent: what counts is that all contain the block.
    visit(nodes, |path, block| {
        let inside = block_box(block);
        for (node_idx, lane) in path {
            let outside = nodes[*node_idx as usize].bounds(*lane);
            assert!(outside.contains(inside), "block {block} sticks out of node {node_idx}");
        }
    });
}

/// Shows the nodes and lanes above each block and returns the number of blocks; panics unless every
/// node is reached once, after its parent, and every block once, in order of the nodes.
fn visit(nodes: &[Node], mut see: impl FnMut(&[(u32, usize)], u32)) -> usize {
    let (mut n_nodes, mut blocks) = (nodes.len().min(1), Vec::new());
    let mut open: Vec<Vec<(u32, usize)>> = (0..nodes.len().min(1)).map(|_| vec![(0, 0)]).collect();
    while let Some(path) = open.pop() {
        assert!(path.len() <= MAX_DEPTH, "{} levels", path.len());
        let Some(&(node_idx, _)) = path.last() else { break };
        for lane in 0..LANES {
            let mut path = path.clone();
            path.last_mut().into_iter().for_each(|last| last.1 = lane);
            match nodes[node_idx as usize].child(lane) {
                None => {}
                Some(Child::Node(child)) => {
                    assert!(node_idx < child, "node {child} before its parent");
                    n_nodes += 1;
                    path.push((child, 0));
                    open.push(path);
                }
                Some(Child::Block(block)) => {
                    see(&path, block);
                    blocks.push(block);
                }
            }
        }
    }
    assert_eq!(n_nodes, nodes.len(), "nodes reached");
    blocks.sort_unstable();
    assert!(blocks.iter().copied().eq(0..blocks.len() as u32), "each block once");
    blocks.len()
}
