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
/// The tree is walked in breadth: the next node is known before the last one is done, and no branch depends
/// on what a node holds, so that the processor works on several nodes, and then blocks, at once.
#[inline(always)]
pub fn within<L: Lanes>(points: &FlatPoints, region: &Aabb, visitor: &mut impl RegionVisitor) {
    if points.nodes.is_empty() {
        return;
    }
    let mut nodes = Row::EMPTY;
    let mut blocks = Row::EMPTY;
    // Nodes for which there was no room: hardly ever any.
    let mut left: Vec<f32> = Vec::new();
    nodes.ends_at = 1;
    loop {
        let mut place = 0;
        while place < nodes.ends_at {
            if nodes.is_full() {
                left.extend(&nodes.children[place..nodes.ends_at]);
                break;
            }
            if blocks.is_full() {
                blocks.show(points, visitor);
            }
            let node = &points.nodes[nodes.children[place].to_bits() as usize];
            let overlapping = box_overlaps::<L>(node, region);
            let children = node.packed_children::<L>();
            let are_blocks = L::splat(f32::from_bits(Child::BLOCK_BIT - 1)).less_bits(children);
            nodes.add(children, overlapping & node.nodes::<L>());
            blocks.add(children, overlapping & are_blocks);
            place += 1;
        }
        blocks.show(points, visitor);
        let Some(node) = left.pop() else { return };
        (nodes.children[0], nodes.ends_at) = (node, 1);
    }
}

/// Packed children, as the bits of floats, one after the other.
struct Row {
    children: [f32; Self::ROOM],
    ends_at: usize,
}

impl Row {
    const ROOM: usize = 128;
    const EMPTY: Self = Self { children: [0.0; Self::ROOM], ends_at: 0 };

    #[inline(always)]
    fn is_full(&self) -> bool {
        Self::ROOM - LANES < self.ends_at
    }

    /// Stores whole lanes, of which the last ones may hold nothing.
    #[inline(always)]
    fn add<L: Lanes>(&mut self, children: L, lanes: L::Mask) {
        let end = self.ends_at.min(Self::ROOM - LANES);
        self.children[end..end + LANES].copy_from_slice(&children.compress(lanes).store());
        self.ends_at = end + lanes.bits().count_ones() as usize;
    }

    /// Shows the blocks, and forgets them.
    #[inline(always)]
    fn show(&mut self, points: &FlatPoints, visitor: &mut impl RegionVisitor) {
        for child in &self.children[..self.ends_at] {
            visitor.visit(points, child.to_bits() & !Child::BLOCK_BIT);
        }
        self.ends_at = 0;
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
        // Of 20,000 points a row of nodes holds only a part.
        let points = cloud(20_000);
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
