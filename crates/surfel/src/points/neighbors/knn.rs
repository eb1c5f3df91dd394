//! A balanced kd-tree without pointers: the nearest k points, or all within a distance.

use super::{Index, Neighbor, Query, check_count, checked_square, key, map, neighbor};
use crate::error::{Error, Result};
use crate::math::{Aabb, Vec3};
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;

/// Points a leaf holds: two SSE or one AVX register. 16 was slower: twice the distances, as many insertions.
const LANES: usize = 8;

/// A tree over the finite points of a cloud: 22 bytes a point.
///
/// Halving by count bounds the depth by 30, whatever outliers or duplicates there are.
pub struct Tree<'a> {
    positions: &'a [Vec3],
    n_points: usize,
    /// All full but the last.
    leaves: Vec<Leaf>,
    /// In depth-first order: the left child of a node follows it, the right one follows the left's subtree.
    nodes: Vec<Node>,
}

/// Eight points by component. An empty place has the position NaN, which no comparison lets in.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Leaf {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
    index: [u32; LANES],
}

/// The same memory while the tree is built.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Entry {
    position: Vec3,
    index: u32,
}

#[derive(Clone, Copy)]
struct Node {
    bounds: Aabb,
    /// Lowest point index below: it lets a search stop among thousands of equally distant points.
    first_index: u32,
}

/// A subtree: its node, and the leaves it spans.
#[derive(Clone, Copy, Default)]
struct Subtree {
    node: u32,
    first_leaf: u32,
    n_leaves: u32,
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
        if !found.keys.is_empty() && position.is_finite() {
            let query = Target { position, own: without.unwrap_or(u32::MAX) };
            self.descend(self.root(), &query, &mut found);
        }
        found.keys.iter().filter(|&&key| key < UNFILLED).map(|&key| neighbor(key)).collect()
    }

    /// Those it was built over.
    pub fn positions(&self) -> &'a [Vec3] {
        self.positions
    }

    fn root(&self) -> Subtree {
        Subtree { node: 0, first_leaf: 0, n_leaves: self.leaves.len() as u32 }
    }

    /// The siblings along the way from the root to a leaf: together with it they hold all points.
    fn siblings(&self, leaf: u32, siblings: &mut Vec<Subtree>) {
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
    fn descend(&self, subtree: Subtree, target: &Target, found: &mut impl Found) {
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
    fn lowest_key(&self, subtree: Subtree, target: &Target) -> u64 {
        let node = &self.nodes[subtree.node as usize];
        let (below, above) = (node.bounds.min - target.position, target.position - node.bounds.max);
        let gap = below.max(above).max(Vec3::ZERO);
        key(gap.x * gap.x + gap.y * gap.y + gap.z * gap.z, node.first_index)
    }

    #[inline]
    fn scan(&self, leaf: u32, target: &Target, found: &mut impl Found) {
        let leaf = &self.leaves[leaf as usize];
        let mut distances = [0.0; LANES];
        for lane in 0..LANES {
            let x = leaf.x[lane] - target.position.x;
            let y = leaf.y[lane] - target.position.y;
            let z = leaf.z[lane] - target.position.z;
            distances[lane] = x * x + y * y + z * z;
        }
        let limit = f32::from_bits((found.worst() >> 32) as u32);
        for lane in 0..LANES {
            if distances[lane] <= limit && leaf.index[lane] != target.own {
                found.offer(key(distances[lane], leaf.index[lane]));
            }
        }
    }
}

impl Subtree {
    #[inline]
    fn children(self) -> (Self, Self) {
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
        x: entries.map(|entry| entry.position.x),
        y: entries.map(|entry| entry.position.y),
        z: entries.map(|entry| entry.position.z),
        index: entries.map(|entry| entry.index),
    }
}

struct Target {
    position: Vec3,
    own: u32,
}

/// What a search has found so far.
trait Found {
    /// Only lower keys are still sought.
    fn worst(&self) -> u64;
    fn offer(&mut self, key: u64);
}

/// Infinitely far, of an index that no point has.
const UNFILLED: u64 = ((f32::INFINITY.to_bits() as u64) << 32) | u32::MAX as u64;

/// The k lowest keys in rising order.
struct Nearest {
    keys: Vec<u64>,
}

impl Nearest {
    fn new(k: usize) -> Self {
        Self { keys: vec![UNFILLED; k] }
    }
}

impl Found for Nearest {
    #[inline]
    fn worst(&self) -> u64 {
        self.keys[self.keys.len() - 1]
    }

    #[inline]
    fn offer(&mut self, key: u64) {
        let mut place = self.keys.len() - 1;
        if self.keys[place] <= key {
            return;
        }
        while 0 < place && key < self.keys[place - 1] {
            self.keys[place] = self.keys[place - 1];
            place -= 1;
        }
        self.keys[place] = key;
    }
}

/// All keys below a fixed one.
struct Within {
    limit: u64,
    keys: Vec<u64>,
}

impl Found for Within {
    fn worst(&self) -> u64 {
        self.limit
    }

    fn offer(&mut self, key: u64) {
        self.keys.push(key);
    }
}

struct NearestOfAll<'a> {
    tree: &'a Tree<'a>,
    k: usize,
}

struct WithinOfAll<'a> {
    tree: &'a Tree<'a>,
    distance_squared: f32,
}

impl Index for NearestOfAll<'_> {
    fn n_slots(&self) -> usize {
        self.tree.n_points
    }

    fn run_length(&self) -> usize {
        128 * LANES
    }

    fn visit_run(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let mut found = Nearest::new(self.k.min(self.tree.n_points));
        let mut neighbors = Vec::with_capacity(found.keys.len());
        self.tree.search_leaves(slots, progress, &mut found, |found, point| {
            neighbors.clear();
            let filled = found.keys.iter().take_while(|&&key| key < UNFILLED);
            neighbors.extend(filled.map(|&key| neighbor(key)));
            visit(point, &neighbors);
            found.keys.fill(UNFILLED);
        })
    }
}

impl Index for WithinOfAll<'_> {
    fn n_slots(&self) -> usize {
        self.tree.n_points
    }

    fn run_length(&self) -> usize {
        128 * LANES
    }

    fn visit_run(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let limit = key(self.distance_squared, u32::MAX);
        let mut found = Within { limit, keys: Vec::new() };
        let mut neighbors = Vec::new();
        self.tree.search_leaves(slots, progress, &mut found, |found, point| {
            found.keys.sort_unstable();
            neighbors.clear();
            neighbors.extend(found.keys.iter().map(|&key| neighbor(key)));
            visit(point, &neighbors);
            found.keys.clear();
        })
    }
}

impl Tree<'_> {
    /// Searches around each point of `slots`, own leaf first: its points bound all that follows.
    fn search_leaves<F: Found>(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        found: &mut F,
        mut done: impl FnMut(&mut F, u32),
    ) -> Result<()> {
        let mut siblings = Vec::with_capacity(32);
        for first_slot in slots.clone().step_by(LANES) {
            progress.check()?;
            let leaf_idx = (first_slot / LANES) as u32;
            self.siblings(leaf_idx, &mut siblings);
            let leaf = &self.leaves[leaf_idx as usize];
            for lane in 0..LANES.min(slots.end - first_slot) {
                let position = Vec3::new(leaf.x[lane], leaf.y[lane], leaf.z[lane]);
                let target = Target { position, own: leaf.index[lane] };
                self.scan(leaf_idx, &target, found);
                for &sibling in siblings.iter().rev() {
                    self.descend(sibling, &target, found);
                }
                done(found, target.own);
            }
        }
        Ok(())
    }
}
