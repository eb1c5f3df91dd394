//! Queries for the blocks that overlap a box.

use crate::bvh::Child;
use crate::flat::FlatPoints;
use crate::math::{Aabb, LANES, LaneMask, Lanes};
use crate::trace::simd::node_boxes::overlapping_children;

/// Receives the blocks that overlap a box.
pub trait BoxVisitor {
    /// Receives one block.
    fn visit(&mut self, points: &FlatPoints, block_idx: u32);
}

/// Passes every block whose box overlaps `region` to `visitor`.
///
/// The traversal is breadth-first: the next node is known before the last one is done, and there is no branch
/// on single children, so that the processor works on several nodes, and then blocks, at once.
#[inline(always)]
pub fn query_box<L: Lanes>(points: &FlatPoints, region: &Aabb, visitor: &mut impl BoxVisitor) {
    if points.nodes.is_empty() {
        return;
    }
    let mut nodes = ChildQueue::new();
    let mut blocks = ChildQueue::new();
    // Nodes beyond the capacity of the queue: hardly ever any.
    let mut overflow: Vec<f32> = Vec::new();
    let mut start = Some(f32::from_bits(Child::Node(0).pack()));
    while let Some(node) = start {
        nodes.reset(node);
        let mut next = 0;
        while next < nodes.end {
            if nodes.is_full() {
                overflow.extend(&nodes.children[next..nodes.end]);
                break;
            }
            if blocks.is_full() {
                blocks.flush(points, visitor);
            }
            let node = &points.nodes[nodes.children[next].to_bits() as usize];
            let overlapping = overlapping_children::<L>(node, region);
            let children = node.packed_children::<L>();
            nodes.add(children, overlapping & node.node_mask::<L>());
            blocks.add(children, overlapping & node.block_mask::<L>());
            next += 1;
        }
        blocks.flush(points, visitor);
        start = overflow.pop();
    }
}

/// A queue of packed children, as the bits of floats.
struct ChildQueue {
    children: [f32; Self::CAPACITY],
    end: usize,
}

impl ChildQueue {
    const CAPACITY: usize = 128;

    #[inline(always)]
    fn new() -> Self {
        Self { children: [0.0; Self::CAPACITY], end: 0 }
    }

    /// Replaces the contents by one child.
    #[inline(always)]
    fn reset(&mut self, child: f32) {
        (self.children[0], self.end) = (child, 1);
    }

    /// True if there may be no capacity for the children of another node.
    #[inline(always)]
    fn is_full(&self) -> bool {
        Self::CAPACITY - LANES < self.end
    }

    /// Adds the children in `lanes` to a queue that is not full. All lanes are stored, but only the chosen
    /// ones, which come first, are kept.
    #[inline(always)]
    fn add<L: Lanes>(&mut self, children: L, lanes: L::Mask) {
        debug_assert!(!self.is_full());
        // Spares the bounds check.
        let end = self.end.min(Self::CAPACITY - LANES);
        self.children[end..end + LANES].copy_from_slice(&children.compress(lanes).store());
        self.end = end + lanes.bits().count_ones() as usize;
    }

    /// Passes the blocks to `visitor` and empties the queue.
    #[inline(always)]
    fn flush(&mut self, points: &FlatPoints, visitor: &mut impl BoxVisitor) {
        for child in &self.children[..self.end] {
            visitor.visit(points, child.to_bits() & !Child::BLOCK_BIT);
        }
        self.end = 0;
    }
}

#[cfg(test)]
mod tests {
    //! Box queries find all blocks that overlap.

    use super::*;
    use crate::flat::PointColumns;
    use crate::math::{PortableLanes, Random, Vec3};
    use crate::progress::NoProgress;
    use crate::surface::SurfaceKind;

    struct BlockList(Vec<u32>);

    impl BoxVisitor for BlockList {
        fn visit(&mut self, _: &FlatPoints, block_idx: u32) {
            self.0.push(block_idx);
        }
    }

    fn cloud(n: usize) -> FlatPoints {
        let mut random = Random::new(4, 0);
        let mut vector = || Vec3::new(random.next_f32(), random.next_f32(), random.next_f32());
        let positions: Vec<Vec3> = (0..n).map(|_| vector()).collect();
        let (normals, radii, colors) = (vec![Vec3::Z; n], vec![0.01; n], vec![[0; 3]; n]);
        let columns =
            PointColumns::new(SurfaceKind::Sphere, &positions, &normals, &radii, &colors).unwrap();
        FlatPoints::new(columns, &NoProgress).unwrap()
    }

    #[test]
    fn box_queries_visit_each_overlapping_block_once() {
        let points = cloud(20_000);
        assert!(2 * ChildQueue::CAPACITY < points.nodes.len());
        let mut random = Random::new(5, 0);
        let mut regions = vec![Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(2.0) }];
        for _ in 0..200 {
            let mut corner = || Vec3::new(random.next_f32(), random.next_f32(), random.next_f32());
            regions.push(Aabb::of_points([corner(), corner()]));
        }
        for region in regions {
            let mut found = BlockList(Vec::new());
            query_box::<PortableLanes>(&points, &region, &mut found);
            found.0.sort_unstable();
            assert!(found.0.windows(2).all(|pair| pair[0] < pair[1]), "{region:?}");
            for (block_idx, block) in points.blocks.iter().enumerate() {
                if block.lanes_within::<PortableLanes>(&region) != 0 {
                    assert!(found.0.binary_search(&(block_idx as u32)).is_ok(), "{region:?}");
                }
            }
        }
    }
}
