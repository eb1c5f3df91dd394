//! The leaves around one leaf, listed once for all points in it.

use super::found::Found;
use super::knn::{Subtree, Target, Tree};
use crate::math::{Aabb, Vec3, Vec4};

/// Leaves listed at most. Clouds where thousands of leaves meet at one place, as those of equal points
/// do, are searched through the tree, which stops early among them.
const MOST: usize = 256;

/// The boxes of leaves, by component: four are tested together.
#[derive(Clone, Copy)]
struct Boxes {
    min: [Vec4; 3],
    max: [Vec4; 3],
    leaf: [u32; 4],
}

/// All leaves other than one that are within some distance of it.
pub(super) struct Surroundings {
    boxes: Vec<Boxes>,
    n_leaves: usize,
}

impl Surroundings {
    pub fn new() -> Self {
        Self { boxes: Vec::new(), n_leaves: 0 }
    }

    /// Lists the leaves below `siblings` that come as near to `bounds` as `distance_squared`, the last
    /// sibling's first. False if they are too many.
    pub fn list(
        &mut self,
        tree: &Tree,
        siblings: &[Subtree],
        bounds: Aabb,
        distance_squared: f32,
    ) -> bool {
        self.boxes.clear();
        self.n_leaves = 0;
        let mut waiting = [Subtree::default(); 32];
        for &sibling in siblings.iter().rev() {
            waiting[0] = sibling;
            let mut n_waiting = 1;
            while 0 < n_waiting {
                n_waiting -= 1;
                let subtree = waiting[n_waiting];
                let other = tree.nodes[subtree.node as usize].bounds;
                if distance_squared < gap_squared(bounds, other) {
                    continue;
                }
                if 1 < subtree.n_leaves {
                    let (left, right) = subtree.children();
                    waiting[n_waiting] = right;
                    waiting[n_waiting + 1] = left;
                    n_waiting += 2;
                } else if self.n_leaves == MOST {
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
            // An inverted box is infinitely far from everything.
            let (min, max) = ([Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]);
            self.boxes.push(Boxes { min, max, leaf: [0; 4] });
        }
        let boxes = &mut self.boxes[self.n_leaves / 4];
        for axis in 0..3 {
            boxes.min[axis][lane] = bounds.min[axis];
            boxes.max[axis][lane] = bounds.max[axis];
        }
        boxes.leaf[lane] = leaf;
        self.n_leaves += 1;
    }

    /// Offers to `found` all listed points that can still be among the sought.
    pub fn search(&self, tree: &Tree, target: &Target, found: &mut impl Found) {
        for boxes in &self.boxes {
            let gaps = gaps_squared(boxes, target.position);
            let mut near = gaps.cmple(Vec4::splat(found.limit())).bitmask();
            let gaps = gaps.to_array();
            while near != 0 {
                let lane = near.trailing_zeros() as usize % 4;
                near &= near - 1;
                if gaps[lane] <= found.limit() {
                    tree.scan(boxes.leaf[lane], target, found);
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
fn gaps_squared(boxes: &Boxes, position: Vec3) -> Vec4 {
    let gap = |axis: usize| {
        let place = Vec4::splat(position[axis]);
        let gap = (boxes.min[axis] - place).max(place - boxes.max[axis]);
        gap.max(Vec4::ZERO)
    };
    let (x, y, z) = (gap(0), gap(1), gap(2));
    x * x + y * y + z * z
}
