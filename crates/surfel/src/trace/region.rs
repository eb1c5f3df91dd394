//! The blocks in a region.

use super::node::box_overlaps;
use crate::bvh::{Child, STACK_SIZE};
use crate::flat::FlatPoints;
use crate::math::{Aabb, LANES, Lanes};

/// Looks at blocks.
pub trait RegionVisitor {
    fn visit(&mut self, points: &FlatPoints, block_idx: u32);
}

/// Shows `visitor` every block whose box overlaps `region`.
#[inline(always)]
pub fn within<L: Lanes>(points: &FlatPoints, region: &Aabb, visitor: &mut impl RegionVisitor) {
    if points.nodes.is_empty() {
        return;
    }
    let mut stack = [0u32; STACK_SIZE];
    let mut size = 1;
    while 0 < size {
        size -= 1;
        let node = &points.nodes[stack[size] as usize];
        let mut lanes = box_overlaps::<L>(node, region);
        let children = node.packed_children::<L>().store();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            match Child::unpack(children[lane].to_bits()) {
                Child::Node(node_idx) => {
                    stack[size] = node_idx;
                    size += 1;
                }
                Child::Block(block_idx) => visitor.visit(points, block_idx),
            }
        }
    }
}
