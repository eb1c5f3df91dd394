//! Building: top down by the surface area heuristic, in parallel, with full leaf blocks.

use super::{Bvh, MAX_DEPTH, NO_PRIMITIVE, Node, Primitive};
use crate::error::Result;
use crate::math::{Aabb, LANES};
use crate::progress::Progress;
use rayon::prelude::*;

/// Bins a split is chosen from (Wald 2007).
const N_BINS: usize = 16;
/// Below this many primitives a range is worked on by one thread.
const PARALLEL_MIN: usize = 8192;
/// Up to this many primitives a split is moved so that blocks and the nodes over them come out full.
const ROUNDED_MAX: usize = 4096;
/// Primitives of a node with eight full blocks.
const FULL_NODE: usize = LANES * LANES;
/// From this level on ranges are halved by count, which keeps `MAX_DEPTH` for any input.
const HALVING_DEPTH: usize = 20;

/// Builds the tree over `primitives`, reordering them.
///
/// `fits` says whether up to eight primitives may share a block; a single one always may.
/// The same input gives the same tree on any number of threads.
pub fn build(
    primitives: &mut [Primitive],
    fits: impl Fn(&[Primitive]) -> bool + Sync,
    progress: &dyn Progress,
) -> Result<Bvh> {
    if primitives.is_empty() {
        return Ok(Bvh::default());
    }
    progress.begin("build tree", primitives.len() as u64);
    let range = Range { offset: 0, bounds: bounds_of(primitives) };
    let root = Builder { fits, progress }.branch(primitives, range, 0);
    progress.check()?;
    let bvh = flatten(&root, primitives);
    if cfg!(debug_assertions) {
        bvh.validate(primitives);
    }
    Ok(bvh)
}

struct Builder<'a, F> {
    fits: F,
    progress: &'a dyn Progress,
}

/// Primitives `offset ..` of the whole array, as many as the slice beside it holds.
#[derive(Clone, Copy)]
struct Range {
    offset: usize,
    bounds: Aabb,
}

/// A node before its children have their places.
struct Branch {
    children: Vec<(Aabb, Subtree)>,
}

enum Subtree {
    Branch(Branch),
    Block { offset: usize, len: usize },
}

/// A child of a branch on its way to eight of them.
struct Part<'p> {
    primitives: &'p mut [Primitive],
    range: Range,
    is_block: bool,
}

impl<F: Fn(&[Primitive]) -> bool + Sync> Builder<'_, F> {
    fn branch(&self, primitives: &mut [Primitive], range: Range, depth: usize) -> Branch {
        let n = primitives.len();
        let children = self.split_in_eight(primitives, range, depth);
        let finish = |part: Part| (part.range.bounds, self.subtree(part, depth + 1));
        let children = if n < PARALLEL_MIN {
            children.into_iter().map(finish).collect()
        } else {
            children.into_par_iter().map(finish).collect()
        };
        Branch { children }
    }

    fn subtree(&self, part: Part, depth: usize) -> Subtree {
        if part.is_block {
            return Subtree::Block { offset: part.range.offset, len: part.primitives.len() };
        }
        if self.progress.is_cancelled() {
            return Subtree::Block { offset: part.range.offset, len: 0 };
        }
        let n = part.primitives.len();
        let branch = self.branch(part.primitives, part.range, depth);
        if n < PARALLEL_MIN && PARALLEL_MIN <= n * LANES {
            self.progress.advance(n as u64);
        }
        Subtree::Branch(branch)
    }

    /// Splits parts until there are eight or all are blocks.
    fn split_in_eight<'p>(
        &self,
        primitives: &'p mut [Primitive],
        range: Range,
        depth: usize,
    ) -> Vec<Part<'p>> {
        let mut parts = vec![self.part(primitives, range)];
        while parts.len() < LANES {
            let Some(next) = next_to_split(&parts, depth) else { break };
            let part = parts.swap_remove(next);
            let n_left = split(part.primitives, depth);
            let (left, right) = part.primitives.split_at_mut(n_left);
            let left_range = Range { offset: part.range.offset, bounds: bounds_of(left) };
            let right_range =
                Range { offset: part.range.offset + n_left, bounds: bounds_of(right) };
            parts.push(self.part(left, left_range));
            parts.push(self.part(right, right_range));
        }
        parts.sort_by_key(|part| part.range.offset);
        parts
    }

    fn part<'p>(&self, primitives: &'p mut [Primitive], range: Range) -> Part<'p> {
        let n = primitives.len();
        let is_block = n == 1 || (n <= LANES && (self.fits)(primitives));
        Part { primitives, range, is_block }
    }
}

/// The widest part that needs more than one node below it; where there is none, the smallest whose
/// blocks still find room here. Nodes over blocks come out full that way: 1.7 bytes a point, against
/// 3.5 if the widest part is always the next.
fn next_to_split(parts: &[Part], depth: usize) -> Option<usize> {
    let weight = |part: &Part| match depth {
        0..HALVING_DEPTH => part.range.bounds.half_area(),
        _ => part.primitives.len() as f32,
    };
    let open = || parts.iter().enumerate().filter(|(_, part)| !part.is_block);
    let large = open().filter(|(_, part)| FULL_NODE < part.primitives.len());
    if let Some((widest, _)) = large.max_by(|(_, a), (_, b)| weight(a).total_cmp(&weight(b))) {
        return Some(widest);
    }
    let room = LANES - parts.len() + 1;
    let fitting = open().filter(|(_, part)| part.primitives.len().div_ceil(LANES) <= room);
    fitting.min_by_key(|(_, part)| part.primitives.len()).map(|(smallest, _)| smallest)
}

/// Reorders `primitives` about a good split and returns the size of its left side, never 0 or all.
fn split(primitives: &mut [Primitive], depth: usize) -> usize {
    let n = primitives.len();
    let centers = centers_of(primitives);
    let axis = centers.longest_axis();
    let key = |primitive: &Primitive| primitive.bounds.min[axis] + primitive.bounds.max[axis];
    let by_key =
        |a: &Primitive, b: &Primitive| key(a).total_cmp(&key(b)).then(a.index.cmp(&b.index));
    let binning = Binning::new(2.0 * centers.min[axis], 2.0 * centers.max[axis]);
    let best = if n <= LANES || HALVING_DEPTH <= depth {
        None
    } else {
        best_split(&bins_of(primitives, |primitive| binning.bin(key(primitive))))
    };
    let Some((n_left, first_right_bin)) = best else {
        let half = if n <= LANES { n / 2 } else { (n / 2).next_multiple_of(LANES).min(n - 1) };
        primitives.select_nth_unstable_by(half, by_key);
        return half;
    };
    if n <= ROUNDED_MAX {
        let unit = if FULL_NODE < n { FULL_NODE } else { LANES };
        let rounded = ((n_left + unit / 2) / unit * unit).clamp(unit, (n - 1) / unit * unit);
        primitives.select_nth_unstable_by(rounded, by_key);
        return rounded;
    }
    partition(primitives, |primitive| binning.bin(key(primitive)) < first_right_bin)
}

/// Moves the primitives that `is_left` to the front and returns their number.
fn partition(primitives: &mut [Primitive], is_left: impl Fn(&Primitive) -> bool) -> usize {
    let (mut left, mut right) = (0, primitives.len());
    while left < right {
        if is_left(&primitives[left]) {
            left += 1;
        } else {
            right -= 1;
            primitives.swap(left, right);
        }
    }
    left
}

/// Maps keys to equal intervals.
#[derive(Clone, Copy)]
struct Binning {
    min: f32,
    per_unit: f32,
}

impl Binning {
    fn new(min: f32, max: f32) -> Self {
        let per_unit = N_BINS as f32 / (max - min);
        Self { min, per_unit: if per_unit.is_finite() { per_unit } else { 0.0 } }
    }

    fn bin(self, key: f32) -> usize {
        (((key - self.min) * self.per_unit) as usize).min(N_BINS - 1)
    }
}

#[derive(Clone, Copy)]
struct Bin {
    n: usize,
    bounds: Aabb,
}

type Bins = [Bin; N_BINS];
const NO_BINS: Bins = [Bin { n: 0, bounds: Aabb::EMPTY }; N_BINS];

fn bins_of(primitives: &[Primitive], bin: impl Fn(&Primitive) -> usize + Sync) -> Bins {
    let count = |chunk: &[Primitive]| {
        let mut bins = NO_BINS;
        for primitive in chunk {
            let bin = &mut bins[bin(primitive)];
            bin.n += 1;
            bin.bounds = bin.bounds.union(primitive.bounds);
        }
        bins
    };
    let merge = |a: Bins, b: Bins| {
        std::array::from_fn(|i| Bin { n: a[i].n + b[i].n, bounds: a[i].bounds.union(b[i].bounds) })
    };
    reduce(primitives, count, merge, NO_BINS)
}

/// The cheapest split by area times blocks: points on its left and the first bin on its right.
fn best_split(bins: &Bins) -> Option<(usize, usize)> {
    let blocks = |n: usize| n.div_ceil(LANES) as f32;
    let mut right_costs = [0.0; N_BINS];
    let (mut n, mut bounds) = (0, Aabb::EMPTY);
    for i in (1..N_BINS).rev() {
        n += bins[i].n;
        bounds = bounds.union(bins[i].bounds);
        right_costs[i] = if n == 0 { f32::INFINITY } else { bounds.half_area() * blocks(n) };
    }
    let (mut n, mut bounds) = (0, Aabb::EMPTY);
    let mut best = (f32::INFINITY, None);
    for i in 1..N_BINS {
        n += bins[i - 1].n;
        bounds = bounds.union(bins[i - 1].bounds);
        let cost = bounds.half_area() * blocks(n) + right_costs[i];
        if 0 < n && cost < best.0 {
            best = (cost, Some((n, i)));
        }
    }
    best.1
}

fn bounds_of(primitives: &[Primitive]) -> Aabb {
    let union = |chunk: &[Primitive]| chunk.iter().fold(Aabb::EMPTY, |all, p| all.union(p.bounds));
    reduce(primitives, union, Aabb::union, Aabb::EMPTY)
}

fn centers_of(primitives: &[Primitive]) -> Aabb {
    let union = |chunk: &[Primitive]| {
        chunk.iter().fold(Aabb::EMPTY, |all, p| all.including(p.bounds.center()))
    };
    reduce(primitives, union, Aabb::union, Aabb::EMPTY)
}

/// Minima, maxima and counts do not depend on the order of reduction, so neither does the tree.
fn reduce<T: Copy + Send + Sync>(
    primitives: &[Primitive],
    part: impl Fn(&[Primitive]) -> T + Sync + Send,
    merge: impl Fn(T, T) -> T + Sync + Send,
    identity: T,
) -> T {
    if primitives.len() < PARALLEL_MIN {
        return part(primitives);
    }
    primitives.par_chunks(PARALLEL_MIN).map(part).reduce(|| identity, merge)
}

/// Gives nodes and blocks their places: the children of a node beside each other, level by level.
fn flatten(root: &Branch, primitives: &[Primitive]) -> Bvh {
    let mut bvh = Bvh { nodes: vec![Node::default()], blocks: Vec::new() };
    let mut open = std::collections::VecDeque::from([(0, root)]);
    while let Some((node_idx, branch)) = open.pop_front() {
        let first_node = bvh.nodes.len() as u32;
        let first_block = bvh.blocks.len() as u32;
        let mut boxes = Vec::with_capacity(LANES);
        for (bounds, child) in &branch.children {
            boxes.push((*bounds, matches!(child, Subtree::Branch(_))));
            match child {
                Subtree::Branch(child) => {
                    open.push_back((bvh.nodes.len(), child));
                    bvh.nodes.push(Node::default());
                }
                Subtree::Block { offset, len } => {
                    let mut block = [NO_PRIMITIVE; LANES];
                    for (lane, primitive) in primitives[*offset..offset + len].iter().enumerate() {
                        block[lane] = primitive.index;
                    }
                    bvh.blocks.push(block);
                }
            }
        }
        bvh.nodes[node_idx] = Node::new(&boxes, first_node, first_block);
    }
    bvh
}

const _: () =
    assert!(HALVING_DEPTH + 32 <= MAX_DEPTH, "a halved range of u32 indices has at most 32 levels");
