//! The blocks in a region.

use crate::bvh::{Child, Node, STACK_SIZE};
use crate::flat::FlatPoints;
use crate::math::{Aabb, LANES, LaneMask, Lanes};

/// Looks at blocks.
pub trait RegionVisitor {
    /// `bounds` are lower and upper, axis by axis.
    fn visit(&mut self, points: &FlatPoints, block_idx: u32, bounds: [[f32; 2]; 3]);
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
        let sides = [node.sides::<L, 0>(), node.sides::<L, 1>(), node.sides::<L, 2>()];
        let mut lanes = overlapping(node, &sides, region);
        let children = node.packed_children::<L>().store();
        let [x, y, z] = sides;
        let low = [x.0.store(), y.0.store(), z.0.store()];
        let high = [x.1.store(), y.1.store(), z.1.store()];
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            match Child::unpack(children[lane].to_bits()) {
                Child::Node(node_idx) => {
                    stack[size] = node_idx;
                    size += 1;
                }
                Child::Block(block_idx) => {
                    let bounds = |axis: usize| [low[axis][lane], high[axis][lane]];
                    visitor.visit(points, block_idx, [bounds(0), bounds(1), bounds(2)]);
                }
            }
        }
    }
}

/// The lanes whose boxes overlap `region`.
#[inline(always)]
fn overlapping<L: Lanes>(node: &Node, sides: &[(L, L); 3], region: &Aabb) -> u32 {
    let mut overlaps = node.filled::<L>();
    for axis in 0..3 {
        let (low, high) = sides[axis];
        let (min, max) = (L::splat(region.min[axis]), L::splat(region.max[axis]));
        overlaps = overlaps & low.less_equal(max) & min.less_equal(high);
    }
    overlaps.bits()
}
