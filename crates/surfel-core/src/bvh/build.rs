//! Top-down construction by the surface area heuristic, in parallel, with full leaf blocks.

use super::layout::layout;
use super::leaf_sweep::sort_into_blocks;
use super::partition::extent_of;
use super::primitive::{BvhPrimitive, Extent};
use super::split::{FULL_NODE, median_split, split};
use super::subtree::{Branch, Subtree};
use super::tree::{Bvh, MAX_DEPTH};
use crate::error::Result;
use crate::math::LANES;
use crate::progress::Progress;
use rayon::prelude::*;

/// Minimum number of primitives of a range that several threads share.
const MIN_PARALLEL: usize = 4096;
/// The level from which on ranges are split at the median, which keeps the tree within `MAX_DEPTH` for any input.
const MEDIAN_SPLIT_DEPTH: usize = 20;

/// Sorts `primitives` into blocks with nodes over them, whose boxes `refit_boxes` sets. Primitives whose box is
/// empty or not finite stay out of the tree.
///
/// `can_share_block` returns true if a block can hold all of up to eight primitives. A block can always hold a
/// single one. The same input gives the same tree on any number of threads.
///
/// # Errors
///
/// Fails if lanes of blocks exceed 32-bit indices, or if `progress` is cancelled.
pub fn build(
    mut primitives: Vec<BvhPrimitive>,
    can_share_block: impl Fn(&[BvhPrimitive]) -> bool + Sync,
    progress: &dyn Progress,
) -> Result<Bvh> {
    if !primitives.par_iter().all(BvhPrimitive::is_valid) {
        primitives.retain(BvhPrimitive::is_valid);
    }
    if primitives.is_empty() {
        return Ok(Bvh::default());
    }
    progress.begin("build tree", primitives.len() as u64);
    let extent = extent_of(&primitives);
    let builder = Builder { can_share_block, progress };
    let root = builder.branch(builder.range(&mut primitives, 0, extent), 0);
    progress.check()?;
    let bvh = layout(&root, &primitives)?;
    if cfg!(debug_assertions) {
        bvh.validate(&primitives);
    }
    Ok(bvh)
}

struct Builder<'a, F> {
    can_share_block: F,
    progress: &'a dyn Progress,
}

/// A range of primitives below a node.
struct PrimitiveRange<'p> {
    primitives: &'p mut [BvhPrimitive],
    /// Index of the first primitive in the whole array.
    offset: usize,
    extent: Extent,
    /// True if the range is a block and must not be split.
    is_block: bool,
}

impl<F: Fn(&[BvhPrimitive]) -> bool + Sync> Builder<'_, F> {
    fn branch(&self, range: PrimitiveRange, depth: usize) -> Branch {
        let n = range.primitives.len();
        let ranges = self.split_into_eight(range, depth);
        let children = if n < MIN_PARALLEL {
            ranges.into_iter().map(|range| self.subtree(range, depth + 1)).collect()
        } else {
            let finish = |range: PrimitiveRange| {
                let n = range.primitives.len();
                let subtree = self.subtree(range, depth + 1);
                if n < MIN_PARALLEL {
                    self.progress.advance(n as u64);
                }
                subtree
            };
            ranges.into_par_iter().map(finish).collect()
        };
        Branch::over(children)
    }

    fn subtree(&self, range: PrimitiveRange, depth: usize) -> Subtree {
        let n = range.primitives.len();
        if range.is_block {
            return Subtree::Block { offset: range.offset, len: n };
        }
        if FULL_NODE < n && self.progress.is_cancelled() {
            return Subtree::Block { offset: range.offset, len: 0 };
        }
        Subtree::Branch(self.branch(range, depth))
    }

    /// Splits a range until there are eight ranges or all are blocks.
    fn split_into_eight<'p>(
        &self,
        whole: PrimitiveRange<'p>,
        depth: usize,
    ) -> Vec<PrimitiveRange<'p>> {
        let mut ranges = Vec::with_capacity(LANES);
        ranges.push(whole);
        while ranges.len() < LANES {
            let Some(next) = next_to_split(&ranges, depth) else { break };
            let range = ranges.swap_remove(next);
            self.split_range(range, depth, &mut ranges);
        }
        ranges.sort_unstable_by_key(|range| range.offset);
        ranges
    }

    /// Splits a range into two, or into its blocks, and adds them to `ranges`.
    fn split_range<'p>(
        &self,
        range: PrimitiveRange<'p>,
        depth: usize,
        ranges: &mut Vec<PrimitiveRange<'p>>,
    ) {
        let n = range.primitives.len();
        if LANES < n && n <= FULL_NODE {
            sort_into_blocks(range.primitives);
            for (i, block) in range.primitives.chunks_mut(LANES).enumerate() {
                let extent = Extent::of(block);
                ranges.push(self.range(block, range.offset + i * LANES, extent));
            }
            return;
        }
        let sides = if n <= LANES || MEDIAN_SPLIT_DEPTH <= depth {
            median_split(range.primitives, &range.extent)
        } else {
            split(range.primitives, &range.extent)
        };
        let (left, right) = range.primitives.split_at_mut(sides.n_left);
        ranges.push(self.range(left, range.offset, sides.extents[0]));
        ranges.push(self.range(right, range.offset + sides.n_left, sides.extents[1]));
    }

    fn range<'p>(
        &self,
        primitives: &'p mut [BvhPrimitive],
        offset: usize,
        extent: Extent,
    ) -> PrimitiveRange<'p> {
        let n = primitives.len();
        let is_block = n == 1 || (n <= LANES && (self.can_share_block)(primitives));
        PrimitiveRange { primitives, offset, extent, is_block }
    }
}

/// Returns the index of the widest range that needs more than one node below it, or else of the smallest whose
/// blocks this node can still hold. This makes nodes over blocks full: nodes take 1.7 bytes per point, against
/// 3.5 if the widest range is always split next.
fn next_to_split(ranges: &[PrimitiveRange], depth: usize) -> Option<usize> {
    let weight = |range: &PrimitiveRange| match depth {
        0..MEDIAN_SPLIT_DEPTH => range.extent.bounds.half_area(),
        _ => range.primitives.len() as f32,
    };
    let open = || ranges.iter().enumerate().filter(|(_, range)| !range.is_block);
    let large = open().filter(|(_, range)| FULL_NODE < range.primitives.len());
    if let Some((widest, _)) = large.max_by(|(_, a), (_, b)| weight(a).total_cmp(&weight(b))) {
        return Some(widest);
    }
    let n_free = LANES - ranges.len() + 1;
    let fitting = open().filter(|(_, range)| n_children(range) <= n_free);
    fitting.min_by_key(|(_, range)| range.primitives.len()).map(|(smallest, _)| smallest)
}

/// Returns the number of ranges into which a range of up to `FULL_NODE` primitives is split.
fn n_children(range: &PrimitiveRange) -> usize {
    range.primitives.len().div_ceil(LANES).max(2)
}

const _: () = assert!(
    MEDIAN_SPLIT_DEPTH + 32 <= MAX_DEPTH,
    "median splits of a range of u32 indices give at most 32 levels"
);
