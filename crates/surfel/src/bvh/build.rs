//! Building: top down by the surface area heuristic, in parallel, with full leaf blocks.

use super::emit::emit;
use super::partition::extent_of;
use super::primitive::{Extent, Primitive};
use super::small::sort_into_blocks;
use super::split::{FULL_NODE, halve, split};
use super::{Bvh, MAX_DEPTH};
use crate::error::Result;
use crate::math::LANES;
use crate::progress::Progress;
use rayon::prelude::*;

/// Below this many primitives a range is worked on by one thread.
const PARALLEL_MIN: usize = 4096;
/// From this level on ranges are halved by count, which keeps `MAX_DEPTH` for any input.
const HALVING_DEPTH: usize = 20;

/// Sorts `primitives` into blocks and the nodes over them, whose boxes `fit_boxes` sets.
///
/// `fits` says whether up to eight primitives may share a block; a single one always may.
/// The same input gives the same tree on any number of threads.
pub fn build(
    mut primitives: Vec<Primitive>,
    fits: impl Fn(&[Primitive]) -> bool + Sync,
    progress: &dyn Progress,
) -> Result<Bvh> {
    if !primitives.par_iter().all(Primitive::is_solid) {
        primitives.retain(Primitive::is_solid);
    }
    if primitives.is_empty() {
        return Ok(Bvh::default());
    }
    progress.begin("build tree", primitives.len() as u64);
    let extent = extent_of(&primitives);
    let builder = Builder { fits, progress };
    let root = builder.branch(builder.part(&mut primitives, 0, extent), 0);
    progress.check()?;
    let bvh = emit(&root, &primitives)?;
    if cfg!(debug_assertions) {
        bvh.validate(&primitives);
    }
    Ok(bvh)
}

/// A node before its children have their places.
pub(super) struct Branch {
    pub children: Vec<Subtree>,
    /// Nodes and blocks below this one.
    pub n_nodes: usize,
    pub n_blocks: usize,
}

pub(super) enum Subtree {
    Branch(Branch),
    /// Primitives from `offset` on.
    Block {
        offset: usize,
        len: usize,
    },
}

struct Builder<'a, F> {
    fits: F,
    progress: &'a dyn Progress,
}

/// A child of a branch on its way to eight of them.
struct Part<'p> {
    primitives: &'p mut [Primitive],
    /// Of the first primitive in the whole array.
    offset: usize,
    extent: Extent,
    is_block: bool,
}

impl<F: Fn(&[Primitive]) -> bool + Sync> Builder<'_, F> {
    fn branch(&self, part: Part, depth: usize) -> Branch {
        let n = part.primitives.len();
        let parts = self.split_in_eight(part, depth);
        let children = if n < PARALLEL_MIN {
            parts.into_iter().map(|part| self.subtree(part, depth + 1)).collect()
        } else {
            let finish = |part: Part| {
                let n = part.primitives.len();
                let subtree = self.subtree(part, depth + 1);
                if n < PARALLEL_MIN {
                    self.progress.advance(n as u64);
                }
                subtree
            };
            parts.into_par_iter().map(finish).collect()
        };
        Branch::over(children)
    }

    fn subtree(&self, part: Part, depth: usize) -> Subtree {
        let n = part.primitives.len();
        if part.is_block {
            return Subtree::Block { offset: part.offset, len: n };
        }
        if FULL_NODE < n && self.progress.is_cancelled() {
            return Subtree::Block { offset: part.offset, len: 0 };
        }
        Subtree::Branch(self.branch(part, depth))
    }

    /// Splits parts until there are eight or all are blocks.
    fn split_in_eight<'p>(&self, whole: Part<'p>, depth: usize) -> Vec<Part<'p>> {
        let mut parts = Vec::with_capacity(LANES);
        parts.push(whole);
        while parts.len() < LANES {
            let Some(next) = next_to_split(&parts, depth) else { break };
            let part = parts.swap_remove(next);
            self.divide(part, depth, &mut parts);
        }
        parts.sort_unstable_by_key(|part| part.offset);
        parts
    }

    fn divide<'p>(&self, part: Part<'p>, depth: usize, parts: &mut Vec<Part<'p>>) {
        let n = part.primitives.len();
        if LANES < n && n <= FULL_NODE {
            sort_into_blocks(part.primitives);
            for (i, block) in part.primitives.chunks_mut(LANES).enumerate() {
                let extent = Extent::of(block);
                parts.push(self.part(block, part.offset + i * LANES, extent));
            }
            return;
        }
        let sides = if n <= LANES || HALVING_DEPTH <= depth {
            halve(part.primitives, &part.extent)
        } else {
            split(part.primitives, &part.extent)
        };
        let (left, right) = part.primitives.split_at_mut(sides.n_left);
        parts.push(self.part(left, part.offset, sides.extents[0]));
        parts.push(self.part(right, part.offset + sides.n_left, sides.extents[1]));
    }

    fn part<'p>(&self, primitives: &'p mut [Primitive], offset: usize, extent: Extent) -> Part<'p> {
        let n = primitives.len();
        let is_block = n == 1 || (n <= LANES && (self.fits)(primitives));
        Part { primitives, offset, extent, is_block }
    }
}

impl Branch {
    fn over(children: Vec<Subtree>) -> Self {
        let (mut n_nodes, mut n_blocks) = (0, 0);
        for child in &children {
            match child {
                Subtree::Branch(branch) => {
                    n_nodes += 1 + branch.n_nodes;
                    n_blocks += branch.n_blocks;
                }
                Subtree::Block { .. } => n_blocks += 1,
            }
        }
        Self { children, n_nodes, n_blocks }
    }
}

/// The widest part that needs more than one node below it; where there is none, the smallest whose
/// blocks still find room here. Nodes over blocks come out full that way: 1.7 bytes a point, against
/// 3.5 if the widest part is always the next.
fn next_to_split(parts: &[Part], depth: usize) -> Option<usize> {
    let weight = |part: &Part| match depth {
        0..HALVING_DEPTH => part.extent.bounds.half_area(),
        _ => part.primitives.len() as f32,
    };
    let open = || parts.iter().enumerate().filter(|(_, part)| !part.is_block);
    let large = open().filter(|(_, part)| FULL_NODE < part.primitives.len());
    if let Some((widest, _)) = large.max_by(|(_, a), (_, b)| weight(a).total_cmp(&weight(b))) {
        return Some(widest);
    }
    let room = LANES - parts.len() + 1;
    let fitting = open().filter(|(_, part)| blocks_of(part) <= room);
    fitting.min_by_key(|(_, part)| part.primitives.len()).map(|(smallest, _)| smallest)
}

/// Parts that dividing this one would give.
fn blocks_of(part: &Part) -> usize {
    part.primitives.len().div_ceil(LANES).max(2)
}

const _: () =
    assert!(HALVING_DEPTH + 32 <= MAX_DEPTH, "a halved range of u32 indices has at most 32 levels");
