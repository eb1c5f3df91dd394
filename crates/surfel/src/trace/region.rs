//! The blocks in a region.

use super::node::box_overlaps;
use crate::bvh::Child;
use crate::flat::FlatPoints;
use crate::math::{Aabb, LANES, LaneMask, Lanes};

/// Looks at blocks.
pub trait RegionVisitor {
    fn visit(&mut self, points: &FlatPoints, block_idx: u32);
}

/// Shows `visitor` every block whose box overlaps `region`.
///
/// The tree is walked in breadth: the next node is known before the last one is done, and there is no branch
/// on single children, so that the processor works on several nodes, and then blocks, at once.
#[inline(always)]
pub fn within<L: Lanes>(points: &FlatPoints, region: &Aabb, visitor: &mut impl RegionVisitor) {
    if points.nodes.is_empty() {
        return;
    }
    let mut nodes = Row::new();
    let mut blocks = Row::new();
    // Nodes for which there was no room: hardly ever any.
    let mut left: Vec<f32> = Vec::new();
    let mut start = Some(f32::from_bits(Child::Node(0).pack()));
    while let Some(node) = start {
        nodes.begin_with(node);
        let mut place = 0;
        while place < nodes.end {
            if nodes.is_full() {
                left.extend(&nodes.children[place..nodes.end]);
                break;
            }
            if blocks.is_full() {
                blocks.show(points, visitor);
            }
            let node = &points.nodes[nodes.children[place].to_bits() as usize];
            let overlapping = box_overlaps::<L>(node, region);
            let children = node.packed_children::<L>();
            nodes.add(children, overlapping & node.child_nodes::<L>());
            blocks.add(children, overlapping & node.child_blocks::<L>());
            place += 1;
        }
        blocks.show(points, visitor);
        start = left.pop();
    }
}

/// Packed children, as the bits of floats, one after the other.
struct Row {
    children: [f32; Self::ROOM],
    end: usize,
}

impl Row {
    const ROOM: usize = 128;

    #[inline(always)]
    fn new() -> Self {
        Self { children: [0.0; Self::ROOM], end: 0 }
    }

    #[inline(always)]
    fn begin_with(&mut self, child: f32) {
        (self.children[0], self.end) = (child, 1);
    }

    #[inline(always)]
    fn is_full(&self) -> bool {
        Self::ROOM - LANES < self.end
    }

    /// Adds to a row that is not full. Whole lanes are stored, of which the last ones may hold nothing.
    #[inline(always)]
    fn add<L: Lanes>(&mut self, children: L, lanes: L::Mask) {
        debug_assert!(!self.is_full());
        // Says so to the compiler.
        let end = self.end.min(Self::ROOM - LANES);
        self.children[end..end + LANES].copy_from_slice(&children.compress(lanes).store());
        self.end = end + lanes.bits().count_ones() as usize;
    }

    /// Shows the blocks, and forgets them.
    #[inline(always)]
    fn show(&mut self, points: &FlatPoints, visitor: &mut impl RegionVisitor) {
        for child in &self.children[..self.end] {
            visitor.visit(points, child.to_bits() & !Child::BLOCK_BIT);
        }
        self.end = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PortableLanes, Random, Vec3};
    use crate::points::PointCloud;
    use crate::progress::Silent;
    use crate::surface::SurfaceKind;

    struct Seen(Vec<u32>);

    impl RegionVisitor for Seen {
        fn visit(&mut self, _: &FlatPoints, block_idx: u32) {
            self.0.push(block_idx);
        }
    }

    fn cloud(n: usize) -> FlatPoints {
        let mut random = Random::new(4, 0);
        let mut vector = || Vec3::new(random.next_f32(), random.next_f32(), random.next_f32());
        let cloud = PointCloud {
            positions: (0..n).map(|_| vector()).collect(),
            radii: Some(vec![0.01; n]),
            ..PointCloud::default()
        };
        FlatPoints::new(&cloud, SurfaceKind::Sphere, &vec![[0; 3]; n], &Silent).unwrap()
    }

    #[test]
    fn blocks_are_shown_once_each_however_many() {
        let points = cloud(20_000);
        assert!(2 * Row::ROOM < points.nodes.len());
        let mut random = Random::new(5, 0);
        let mut regions = vec![Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(2.0) }];
        for _ in 0..200 {
            let mut corner = || Vec3::new(random.next_f32(), random.next_f32(), random.next_f32());
            regions.push(Aabb::of_points([corner(), corner()]));
        }
        for region in regions {
            let mut seen = Seen(Vec::new());
            within::<PortableLanes>(&points, &region, &mut seen);
            seen.0.sort_unstable();
            assert!(seen.0.windows(2).all(|pair| pair[0] < pair[1]), "{region:?}");
            for (block_idx, block) in points.blocks.iter().enumerate() {
                if block.lanes_within::<PortableLanes>(&region) != 0 {
                    assert!(seen.0.binary_search(&(block_idx as u32)).is_ok(), "{region:?}");
                }
            }
        }
    }
}
