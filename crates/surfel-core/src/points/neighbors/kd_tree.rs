//! A balanced kd-tree without pointers.

use super::candidate_set::{CandidateSet, KNearest, MANY, ManyNearest, NearestSet};
use super::neighbor::{Neighbor, key};
use crate::error::Result;
use crate::math::{Aabb, Vec3, Vec4, set_bits};
use crate::points::check_count;
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of points of a leaf: two registers of four.
pub(super) const LANES: usize = 8;

/// A kd-tree over the finite points of a cloud. Takes 23 bytes per point.
///
/// Median splits bound the depth by 30 for any outliers or duplicates.
pub struct KdTree<'a> {
    positions: &'a [Vec3],
    /// Number of points in the tree.
    pub(super) n_points: usize,
    /// Leaves, of which only the last may have unused lanes.
    pub(super) leaves: Vec<Leaf>,
    /// Nodes in depth-first order: the left child of a node follows it, the right one follows the left subtree.
    pub(super) nodes: Vec<Node>,
}

/// Eight points by component. An unused lane has the position NaN, which fails all comparisons.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Leaf {
    x: [Vec4; 2],
    y: [Vec4; 2],
    z: [Vec4; 2],
    index: [[u32; 4]; 2],
}

/// A point while the tree is built, in the memory of the leaves.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Entry {
    position: Vec3,
    index: u32,
}

#[derive(Clone, Copy)]
pub(super) struct Node {
    /// Bounds of the points.
    pub(super) bounds: Aabb,
    /// Lowest point index in the subtree, which lets a search stop among thousands of equally distant points.
    min_index: u32,
}

/// A subtree: its node, and the range of its leaves.
#[derive(Clone, Copy, Default)]
pub(super) struct Subtree {
    /// Index of the node at its top.
    pub(super) node: u32,
    /// Index of its first leaf.
    pub(super) first_leaf: u32,
    /// Number of its leaves.
    pub(super) n_leaves: u32,
}

impl<'a> KdTree<'a> {
    /// Builds a tree.
    ///
    /// # Errors
    ///
    /// Returns [`Error::TooManyPoints`](crate::Error::TooManyPoints) beyond 32-bit indices and
    /// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn new(positions: &'a [Vec3], progress: &dyn Progress) -> Result<Self> {
        check_count(positions.len())?;
        let n_points = positions.par_iter().filter(|p| p.is_finite()).count();
        let empty = Entry { position: Vec3::NAN, index: u32::MAX };
        let n_leaves = n_points.div_ceil(LANES);
        let mut leaves: Vec<Leaf> = vec![bytemuck::cast([empty; LANES]); n_leaves];
        let entries: &mut [Entry] = bytemuck::cast_slice_mut(&mut leaves);
        let finite = positions.iter().enumerate().filter(|(_, p)| p.is_finite());
        for (entry, (index, &position)) in entries.iter_mut().zip(finite) {
            *entry = Entry { position, index: index as u32 };
        }
        let unset = Node { bounds: Aabb::EMPTY, min_index: u32::MAX };
        let mut nodes = vec![unset; (2 * n_leaves).saturating_sub(1)];
        if 0 < n_leaves {
            build(&mut entries[..n_points], &mut nodes, progress)?;
        }
        leaves.par_iter_mut().for_each(|leaf| *leaf = by_component(bytemuck::cast(*leaf)));
        Ok(Self { positions, n_points, leaves, nodes })
    }

    /// Returns the k points nearest to `position`, nearest first, without the one of index `excluded`.
    pub fn nearest(&self, position: Vec3, k: usize, excluded: Option<u32>) -> Vec<Neighbor> {
        let k = k.min(self.n_points);
        if k == 0 || !position.is_finite() {
            return Vec::new();
        }
        let target = Target { position, own: excluded.unwrap_or(u32::MAX) };
        if k < MANY {
            self.neighbors(&target, KNearest::new(k))
        } else {
            self.neighbors(&target, ManyNearest::new(k))
        }
    }

    /// Returns the k points nearest to `position` among those within a distance, nearest first.
    pub fn nearest_within(&self, position: Vec3, k: usize, distance: f32) -> Vec<Neighbor> {
        let k = k.min(self.n_points);
        if k == 0 || !position.is_finite() {
            return Vec::new();
        }
        let target = Target { position, own: u32::MAX };
        let mut candidates = KNearest::new(k);
        candidates.limit_to(distance * distance);
        let mut neighbors = self.neighbors(&target, candidates);
        // Where fewer points are near, the last entries stand for the limit.
        neighbors.retain(|neighbor| neighbor.index != u32::MAX);
        neighbors
    }

    fn neighbors(&self, target: &Target, mut candidates: impl CandidateSet) -> Vec<Neighbor> {
        let mut neighbors = Vec::new();
        self.search(self.root(), target, &mut candidates);
        candidates.drain_sorted(&mut neighbors);
        neighbors
    }

    /// Returns the positions that the tree was built over.
    pub fn positions(&self) -> &'a [Vec3] {
        self.positions
    }

    /// Returns the indices of all finite points so that points near each other follow each other.
    pub fn order(&self) -> Vec<u32> {
        let indices = self.leaves.iter().flat_map(|leaf| leaf.index.as_flattened());
        indices.take(self.n_points).copied().collect()
    }

    /// Returns the whole tree.
    pub(super) fn root(&self) -> Subtree {
        Subtree { node: 0, first_leaf: 0, n_leaves: self.leaves.len() as u32 }
    }

    /// Lists the siblings along the path from the root to a leaf. Together with the leaf they hold all points.
    pub(super) fn siblings(&self, leaf: u32, siblings: &mut Vec<Subtree>) {
        siblings.clear();
        let mut subtree = self.root();
        while 1 < subtree.n_leaves {
            let (left, right) = subtree.children();
            let (inside, outside) =
                if leaf < right.first_leaf { (left, right) } else { (right, left) };
            siblings.push(outside);
            subtree = inside;
        }
    }

    /// Inserts all points of a subtree that are candidates.
    pub(super) fn search(
        &self,
        subtree: Subtree,
        target: &Target,
        candidates: &mut impl CandidateSet,
    ) {
        let mut stack = [(0, Subtree::default()); 32];
        let mut n_stacked = 0;
        let (mut bound, mut subtree) = (self.min_key(subtree, target), subtree);
        loop {
            while bound < candidates.bound() && 1 < subtree.n_leaves {
                let (left, right) = subtree.children();
                let near = (self.min_key(left, target), left);
                let far = (self.min_key(right, target), right);
                let (near, far) = if far.0 < near.0 { (far, near) } else { (near, far) };
                stack[n_stacked] = far;
                n_stacked += 1;
                (bound, subtree) = near;
            }
            if bound < candidates.bound() {
                self.scan(subtree.first_leaf, target, candidates);
            }
            if n_stacked == 0 {
                return;
            }
            n_stacked -= 1;
            (bound, subtree) = stack[n_stacked];
        }
    }

    /// Returns a key that no point of the subtree is below. Rounding is monotonic, so this holds to the last bit.
    #[inline]
    pub(super) fn min_key(&self, subtree: Subtree, target: &Target) -> u64 {
        let node = &self.nodes[subtree.node as usize];
        let (below, above) = (node.bounds.min - target.position, target.position - node.bounds.max);
        let gap = below.max(above).max(Vec3::ZERO);
        key(gap.x * gap.x + gap.y * gap.y + gap.z * gap.z, node.min_index)
    }

    /// Inserts all points of a leaf that are candidates.
    #[inline]
    pub(super) fn scan(&self, leaf: u32, target: &Target, candidates: &mut impl CandidateSet) {
        let leaf = &self.leaves[leaf as usize];
        for (half, indices) in leaf.index.iter().enumerate() {
            let x = leaf.x[half] - target.position.x;
            let y = leaf.y[half] - target.position.y;
            let z = leaf.z[half] - target.position.z;
            let distances = x * x + y * y + z * z;
            let near = distances.cmple(Vec4::splat(candidates.max_distance_squared())).bitmask();
            let distances = distances.to_array();
            for lane in set_bits::<4>(near) {
                let key = key(distances[lane], indices[lane]);
                if key < candidates.bound() && indices[lane] != target.own {
                    candidates.insert(key);
                }
            }
        }
    }
}

impl Leaf {
    /// Returns the point of a lane as the target of a search.
    pub(super) fn target(&self, lane: usize) -> Target {
        let (half, lane) = (lane / 4, lane % 4);
        let position = Vec3::new(self.x[half][lane], self.y[half][lane], self.z[half][lane]);
        Target { position, own: self.index[half][lane] }
    }
}

impl Subtree {
    /// Returns the two halves.
    #[inline]
    pub(super) fn children(self) -> (Self, Self) {
        let n_left = self.n_leaves / 2;
        let left = Self { node: self.node + 1, first_leaf: self.first_leaf, n_leaves: n_left };
        let right = Self {
            node: self.node + 2 * n_left,
            first_leaf: self.first_leaf + n_left,
            n_leaves: self.n_leaves - n_left,
        };
        (left, right)
    }
}

fn build(entries: &mut [Entry], nodes: &mut [Node], progress: &dyn Progress) -> Result<()> {
    let bounds = Aabb::of_points(entries.iter().map(|entry| entry.position));
    let lowest = entries.iter().map(|entry| entry.index).min();
    nodes[0] = Node { bounds, min_index: lowest.unwrap_or(u32::MAX) };
    let n_leaves = entries.len().div_ceil(LANES);
    if n_leaves < 2 {
        return Ok(());
    }
    let n_left = n_leaves / 2;
    let axis = bounds.longest_axis();
    // Ties are broken by index, so that low indices are found first among equal points.
    entries.select_nth_unstable_by_key(n_left * LANES, |entry| {
        (u64::from(ordered_bits(entry.position[axis])) << 32) | u64::from(entry.index)
    });
    let (left, right) = entries.split_at_mut(n_left * LANES);
    let (left_nodes, right_nodes) = nodes[1..].split_at_mut(2 * n_left - 1);
    if n_leaves < 512 {
        build(left, left_nodes, progress)?;
        return build(right, right_nodes, progress);
    }
    progress.check()?;
    let (left, right) =
        rayon::join(|| build(left, left_nodes, progress), || build(right, right_nodes, progress));
    left.and(right)
}

/// Returns bits that sort as finite numbers do, with -0 just below 0.
fn ordered_bits(value: f32) -> u32 {
    let bits = value.to_bits();
    bits ^ (((bits as i32) >> 31) as u32 | 0x8000_0000)
}

fn by_component(entries: [Entry; LANES]) -> Leaf {
    Leaf {
        x: bytemuck::cast(entries.map(|entry| entry.position.x)),
        y: bytemuck::cast(entries.map(|entry| entry.position.y)),
        z: bytemuck::cast(entries.map(|entry| entry.position.z)),
        index: bytemuck::cast(entries.map(|entry| entry.index)),
    }
}

/// The point whose neighbours are searched.
pub(super) struct Target {
    /// Position of the point.
    pub(super) position: Vec3,
    /// Index of the point, which is not its own neighbour.
    pub(super) own: u32,
}
