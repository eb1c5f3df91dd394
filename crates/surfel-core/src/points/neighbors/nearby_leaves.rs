//! The leaves around a leaf, collected once for all of its points.

use super::candidate_set::CandidateSet;
use super::kd_tree::{KdTree, Subtree, Target};
use crate::math::{Aabb, Vec3, Vec4, set_bits};

/// Maximum number of collected leaves. Clouds where thousands of leaves meet at one position, as those of equal
/// points do, are searched through the tree, which stops early among them.
const MAX_LEAVES: usize = 256;

/// The boxes of four leaves by component, which are tested together.
#[derive(Clone, Copy)]
struct LeafBoxes {
    min: [Vec4; 3],
    max: [Vec4; 3],
    leaf: [u32; 4],
}

/// All other leaves within a distance of a leaf.
pub(super) struct NearbyLeaves {
    boxes: Vec<LeafBoxes>,
    n_leaves: usize,
}

impl NearbyLeaves {
    /// Creates an empty list.
    pub fn new() -> Self {
        Self { boxes: Vec::new(), n_leaves: 0 }
    }

    /// Collects the leaves of `siblings` within a distance of `bounds`, those of the last sibling first. Returns
    /// false if there are more than `MAX_LEAVES`.
    pub fn collect(
        &mut self,
        tree: &KdTree,
        siblings: &[Subtree],
        bounds: Aabb,
        distance_squared: f32,
    ) -> bool {
        self.boxes.clear();
        self.n_leaves = 0;
        let mut stack = [Subtree::default(); 32];
        for &sibling in siblings.iter().rev() {
            stack[0] = sibling;
            let mut n_stacked = 1;
            while 0 < n_stacked {
                n_stacked -= 1;
                let subtree = stack[n_stacked];
                let other = tree.nodes[subtree.node as usize].bounds;
                if distance_squared < gap_squared(bounds, other) {
                    continue;
                }
                if 1 < subtree.n_leaves {
                    let (left, right) = subtree.children();
                    stack[n_stacked] = right;
                    stack[n_stacked + 1] = left;
                    n_stacked += 2;
                } else if self.n_leaves == MAX_LEAVES {
                    return false;
                } else {
                    self.push(other, subtree.first_leaf);
                }
            }
        }
        true
    }

    fn push(&mut self, bounds: Aabb, leaf: u32) {
        let lane = self.n_leaves % 4;
        if lane == 0 {
            // An inverted box has an infinite distance to every point.
            let (min, max) = ([Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]);
            self.boxes.push(LeafBoxes { min, max, leaf: [0; 4] });
        }
        let boxes = &mut self.boxes[self.n_leaves / 4];
        for axis in 0..3 {
            boxes.min[axis][lane] = bounds.min[axis];
            boxes.max[axis][lane] = bounds.max[axis];
        }
        boxes.leaf[lane] = leaf;
        self.n_leaves += 1;
    }

    /// Inserts all points of the collected leaves that are candidates.
    pub fn search(&self, tree: &KdTree, target: &Target, candidates: &mut impl CandidateSet) {
        for boxes in &self.boxes {
            let gaps = gaps_squared(boxes, target.position);
            let near = gaps.cmple(Vec4::splat(candidates.max_distance_squared())).bitmask();
            let gaps = gaps.to_array();
            for lane in set_bits::<4>(near) {
                if gaps[lane] <= candidates.max_distance_squared() {
                    tree.scan(boxes.leaf[lane], target, candidates);
                }
            }
        }
    }
}

fn gap_squared(a: Aabb, b: Aabb) -> f32 {
    let gap = (a.min - b.max).max(b.min - a.max).max(Vec3::ZERO);
    gap.x * gap.x + gap.y * gap.y + gap.z * gap.z
}

#[inline]
fn gaps_squared(boxes: &LeafBoxes, position: Vec3) -> Vec4 {
    let gap = |axis: usize| {
        let coordinate = Vec4::splat(position[axis]);
        let gap = (boxes.min[axis] - coordinate).max(coordinate - boxes.max[axis]);
        gap.max(Vec4::ZERO)
    };
    let (x, y, z) = (gap(0), gap(1), gap(2));
    x * x + y * y + z * z
}
