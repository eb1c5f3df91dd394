//! A balanced kd-tree without pointers: the nearest k points, or all within a distance.

use super::found::{Found, Nearest};
use super::leafwise::{NearestOfAll, WithinOfAll};
use super::{Neighbor, Query, check_count, checked_square, key, map};
use crate::error::{Error, Result};
use crate::math::{Aabb, Vec3, Vec4};
use crate::progress::Progress;
use rayon::prelude::*;

/// Points a leaf holds: two registers of four.
pub(super) const LANES: usize = 8;

/// A tree over the finite points of a cloud: 23 bytes a point.
///
/// Halving by count bounds the depth by 30, whatever outliers or duplicates there are.
pub struct Tree<'a> {
    positions: &'a [Vec3],
    pub(super) n_points: usize,
    /// All full but the last.
    pub(super) leaves: Vec<Leaf>,
    /// In depth-first order: the left child of a node follows it, the right one follows the left's subtree.
    pub(super) nodes: Vec<Node>,
}

/// Eight points by component. An empty place has the position NaN, which no comparison lets in.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Leaf {
    x: [Vec4; 2],
    y: [Vec4; 2],
    z: [Vec4; 2],
    index: [[u32; 4]; 2],
}

/// The same memory while the tree is built.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Entry {
    position: Vec3,
    index: u32,
}

#[derive(Clone, Copy)]
pub(super) struct Node {
    pub(super) bounds: Aabb,
    /// Lowest point index below: it lets a search stop among thousands of equally distant points.
    first_index: u32,
}

/// A subtree: its node, and the leaves it spans.
#[derive(Clone, Copy, Default)]
pub(super) struct Subtree {
    pub(super) node: u32,
    pub(super) first_leaf: u32,
    pub(super) n_leaves: u32,
}

impl<'a> Tree<'a> {
    pub fn new(positions: &'a [Vec3], progress: &dyn Progress) -> Result<Self> {
        check_count(positions)?;
        let n_points = positions.par_iter().filter(|p| p.is_finite()).count();
        let empty = Entry { position: Vec3::NAN, index: u32::MAX };
        let n_leaves = n_points.div_ceil(LANES);
        let mut leaves: Vec<Leaf> = vec![bytemuck::cast([empty; LANES]); n_leaves];
        let entries: &mut [Entry] = bytemuck::cast_slice_mut(&mut leaves);
        let finite = positions.iter().enumerate().filter(|(_, p)| p.is_finite());
        for (entry, (index, &position)) in entries.iter_mut().zip(finite) {
            *entry = Entry { position, index: index as u32 };
        }
        let unset = Node { bounds: Aabb::EMPTY, first_index: u32::MAX };
        let mut nodes = vec![unset; (2 * n_leaves).saturating_sub(1)];
        if 0 < n_leaves {
            build(&mut entries[..n_points], &mut nodes, progress)?;
        }
        leaves.par_iter_mut().for_each(|leaf| *leaf = by_component(bytemuck::cast(*leaf)));
        Ok(Self { positions, n_points, leaves, nodes })
    }

    /// `visit(point, neighbours)` of every point, in the points' order; neighbours come nearest first.
    pub fn map<T: Copy + Default + Send + Sync>(
        &self,
        query: Query,
        progress: &dyn Progress,
        visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
    ) -> Result<Vec<T>> {
        match query {
            Query::Nearest(0) => Err(Error::Setting {
                name: "number of neighbours",
                found: "0".to_owned(),
                expected: "at least 1",
            }),
            Query::Nearest(k) => {
                map(&NearestOfAll { tree: self, k }, self.positions, progress, visit)
            }
            Query::Within(distance) => {
                let distance_squared = checked_square(distance)?;
                map(&WithinOfAll { tree: self, distance_squared }, self.positions, progress, visit)
            }
        }
    }

    /// The k points nearest to `position`, except the one whose index is `without`.
    pub fn nearest(&self, position: Vec3, k: usize, without: Option<u32>) -> Vec<Neighbor> {
        let mut found = Nearest::new(k.min(self.n_points));
        let mut neighbors = Vec::new();
        if 0 < k.min(self.n_points) && position.is_finite() {
            let target = Target { position, own: without.unwrap_or(u32::MAX) };
            self.descend(self.root(), &target, &mut found);
            found.finish(&mut neighbors);
        }
        neighbors
    }

    /// Those it was built over.
    pub fn positions(&self) -> &'a [Vec3] {
        self.positions
    }

    pub(super) fn root(&self) -> Subtree {
        Subtree { node: 0, first_leaf: 0, n_leaves: self.leaves.len() as u32 }
    }

    /// The siblings along the way from the root to a leaf: together with it they hold all points.
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

    /// Offers to `found` all points below `subtree` that can still be among the sought.
    pub(super) fn descend(&self, subtree: Subtree, target: &Target, found: &mut impl Found) {
        let mut waiting = [(0, Subtree::default()); 32];
        let mut n_waiting = 0;
        let (mut bound, mut subtree) = (self.lowest_key(subtree, target), subtree);
        loop {
            while bound < found.worst() && 1 < subtree.n_leaves {
                let (left, right) = subtree.children();
                let near = (self.lowest_key(left, target), left);
                let far = (self.lowest_key(right, target), right);
                let (near, far) = if far.0 < near.0 { (far, near) } else { (near, far) };
                waiting[n_waiting] = far;
                n_waiting += 1;
                (bound, subtree) = near;
            }
            if bound < found.worst() {
                self.scan(subtree.first_leaf, target, found);
            }
            if n_waiting == 0 {
                return;
            }
            n_waiting -= 1;
            (bound, subtree) = waiting[n_waiting];
        }
    }

    /// No point below `subtree` has a lower key. Rounding keeps order, so this holds to the last bit.
    #[inline]
    pub(super) fn lowest_key(&self, subtree: Subtree, target: &Target) -> u64 {
        let node = &self.nodes[subtree.node as usize];
        let (below, above) = (node.bounds.min - target.position, target.position - node.bounds.max);
        let gap = below.max(above).max(Vec3::ZERO);
        key(gap.x * gap.x + gap.y * gap.y + gap.z * gap.z, node.first_index)
    }

    #[inline]
    pub(super) fn scan(&self, leaf: u32, target: &Target, found: &mut impl Found) {
        let leaf = &self.leaves[leaf as usize];
        for (half, indices) in leaf.index.iter().enumerate() {
            let x = leaf.x[half] - target.position.x;
            let y = leaf.y[half] - target.position.y;
            let z = leaf.z[half] - target.position.z;
            let distances = x * x + y * y + z * z;
            let mut near = distances.cmple(Vec4::splat(found.limit())).bitmask();
            let distances = distances.to_array();
            while near != 0 {
                let lane = near.trailing_zeros() as usize % 4;
                near &= near - 1;
                let key = key(distances[lane], indices[lane]);
                if key < found.worst() && indices[lane] != target.own {
                    found.offer(key);
                }
            }
        }
    }
}

impl Leaf {
    /// The point in a place, as the target of a search.
    pub(super) fn target(&self, lane: usize) -> Target {
        let (half, lane) = (lane / 4, lane % 4);
        let position = Vec3::new(self.x[half][lane], self.y[half][lane], self.z[half][lane]);
        Target { position, own: self.index[half][lane] }
    }
}

impl Subtree {
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
    nodes[0] = Node { bounds, first_index: lowest.unwrap_or(u32::MAX) };
    let n_leaves = entries.len().div_ceil(LANES);
    if n_leaves < 2 {
        return Ok(());
    }
    let n_left = n_leaves / 2;
    let axis = bounds.longest_axis();
    // Ties go by index: among equal points the low indices are then found first.
    entries.select_nth_unstable_by_key(n_left * LANES, |entry| {
        (u64::from(rising_bits(entry.position[axis])) << 32) | u64::from(entry.index)
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

/// Bits that sort as the finite numbers do, with -0 just below 0.
fn rising_bits(value: f32) -> u32 {
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

pub(super) struct Target {
    pub(super) position: Vec3,
    pub(super) own: u32,
}
