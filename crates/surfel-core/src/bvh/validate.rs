//! Checks of a tree's structure, which run after each build in debug and in tests.

use super::node::{BvhNode, Child};
use super::primitive::BvhPrimitive;
use super::tree::{Bvh, MAX_DEPTH, NO_PRIMITIVE};
use crate::math::{Aabb, LANES};

impl Bvh {
    /// Panics unless every primitive is in exactly one block, and every block in one node.
    pub fn validate(&self, primitives: &[BvhPrimitive]) {
        let n_blocks = visit(&self.nodes, |_, _| ());
        assert_eq!(n_blocks, self.blocks.len(), "number of blocks reached");
        let is_used = |index: &&u32| **index != NO_PRIMITIVE;
        let mut found: Vec<u32> =
            self.blocks.as_flattened().iter().filter(is_used).copied().collect();
        let mut expected: Vec<u32> = primitives.iter().map(BvhPrimitive::index).collect();
        found.sort_unstable();
        expected.sort_unstable();
        assert!(found == expected, "each primitive is in exactly one block");
    }
}

/// Panics unless the box of every block is inside all boxes above it.
pub fn validate_boxes(nodes: &[BvhNode], block_bounds: impl Fn(u32) -> Aabb) {
    // Children and their parent are encoded on different grids, so that only blocks have to be inside.
    visit(nodes, |path, block| {
        let inside = block_bounds(block);
        for (node_idx, lane) in path {
            let outside = nodes[*node_idx as usize].bounds(*lane);
            assert!(outside.contains(inside), "block {block} is not inside node {node_idx}");
        }
    });
}

/// Calls `visit_block` with the nodes and lanes above each block and returns the number of blocks. Panics unless
/// every node is reached once and after its parent, and every block once.
fn visit(nodes: &[BvhNode], mut visit_block: impl FnMut(&[(u32, usize)], u32)) -> usize {
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
                    visit_block(&path, block);
                    blocks.push(block);
                }
            }
        }
    }
    assert_eq!(n_nodes, nodes.len(), "number of nodes reached");
    blocks.sort_unstable();
    assert!(blocks.iter().copied().eq(0..blocks.len() as u32), "each block is reached once");
    blocks.len()
}
