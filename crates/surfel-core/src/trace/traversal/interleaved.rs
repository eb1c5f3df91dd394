//! Many incoherent rays, traced one step at a time in turn.
//!
//! Incoherent rays wait for memory most of the time. While one waits for its next node or block, which was
//! prefetched a round before, the others do their steps.

use crate::bvh::{Child, STACK_SIZE};
use crate::flat::BlockTree;
use crate::math::{LANES, LaneMask, Lanes, Ray, set_bits};
use crate::trace::simd::node_boxes::{SlabRay, intersect_children};
use crate::trace::traversal::prefetch::Prefetcher;
use std::hint::select_unpredictable;
use std::ops::ControlFlow;

/// A search along one ray.
pub trait RayVisitor {
    /// The tree that is searched.
    type Tree: BlockTree;

    /// True if near blocks are visited first.
    const IS_ORDERED: bool;

    /// Returns the ray.
    fn ray(&self) -> &Ray;

    /// Returns the distance beyond which the ray ignores boxes.
    fn limit(&self) -> f32;

    /// Tests the ray against a block. A break ends the search.
    fn visit<L: Lanes>(&mut self, tree: &Self::Tree, block_idx: u32) -> ControlFlow<()>;
}

/// Number of rays traced at a time: enough to hide a read from memory, few enough for the first cache.
const N_INTERLEAVED: usize = 32;

/// Minimum number of rays at nodes; with fewer, those at blocks proceed first: each change of kind is a
/// mispredicted branch. Values between 10 and 22 make no difference.
const MIN_AT_NODES: u32 = 16;

/// Capacity of a stack that is read and written by whole lanes.
const STACK_CAPACITY: usize = STACK_SIZE + LANES;

/// The packed root, which lies at the bottom of each stack: a ray that returns to it is done.
const ROOT: u32 = 0;

/// The states of the rays that are traced at a time. They are allocated when first needed and reused from
/// search to search, as clearing them takes as long as several rays.
#[derive(Default)]
pub struct RayPool(Option<Box<[RayState; N_INTERLEAVED]>>);

/// The state of a ray that is being traced.
#[derive(Clone, Copy, bytemuck::Zeroable)]
#[repr(align(64))]
struct RayState {
    ray: SlabRay,
    visitor_idx: u32,
    /// The limit of the visitor.
    limit: f32,
    /// The packed child to visit next.
    next: u32,
    stack_size: u32,
    stack: TraversalStack,
}

/// Children to visit later, packed, and the distances at which their boxes are entered. The root lies at the
/// bottom. Whole lanes are stored on top, of which only the first ones may be valid.
#[derive(Clone, Copy, bytemuck::Zeroable)]
struct TraversalStack {
    children: [f32; STACK_CAPACITY],
    entries: [f32; STACK_CAPACITY],
}

/// The rays by the kind of their next step, one bit each.
#[derive(Clone, Copy)]
struct ReadySets {
    at_blocks: u32,
    done: u32,
}

impl ReadySets {
    fn at_nodes(self) -> u32 {
        !(self.at_blocks | self.done)
    }

    /// Adds a ray by its next child, without a branch, which would be unpredictable.
    #[inline(always)]
    fn add(&mut self, state_idx: usize, next: u32) {
        self.at_blocks |= (next >> 31) << state_idx;
        self.done |= u32::from(next == ROOT) << state_idx;
    }
}

/// Passes every block whose box a visitor's ray enters before its limit to that visitor, for each of
/// `visitors`. Near boxes come first if the visitors are ordered.
#[inline(always)]
pub fn trace_interleaved<L: Lanes, V: RayVisitor>(
    pool: &mut RayPool,
    tree: &V::Tree,
    visitors: &mut [V],
) {
    if visitors.is_empty() {
        return;
    }
    // Zeros put the root at the bottom of each stack.
    let states: &mut [RayState; N_INTERLEAVED] = pool.0.get_or_insert_with(bytemuck::zeroed_box);
    let prefetcher = Prefetcher::new(tree);
    let mut n_started = 0;
    let mut ready = ReadySets { at_blocks: 0, done: u32::MAX };
    loop {
        let mut done = set_bits::<N_INTERLEAVED>(ready.done);
        while n_started < visitors.len()
            && let Some(state_idx) = done.next()
        {
            states[state_idx].start(tree, n_started, &visitors[n_started]);
            n_started += 1;
        }
        ready.done = done.remaining();
        if ready.done == u32::MAX {
            return;
        }
        loop {
            for state_idx in set_bits::<N_INTERLEAVED>(ready.at_nodes()) {
                let state = &mut states[state_idx];
                state.push_children::<L, V>(tree);
                state.pop_next::<L>(&prefetcher);
                ready.add(state_idx, state.next);
            }
            if ready.at_nodes().count_ones() < MIN_AT_NODES {
                break;
            }
        }
        let at_blocks = std::mem::take(&mut ready.at_blocks);
        for state_idx in set_bits::<N_INTERLEAVED>(at_blocks) {
            let state = &mut states[state_idx];
            let visitor = &mut visitors[state.visitor_idx as usize];
            let block_idx = state.next & !Child::BLOCK_BIT;
            let goes_on = visitor.visit::<L>(tree, block_idx).is_continue();
            // A hit is unpredictable, too.
            state.stack_size = select_unpredictable(goes_on, state.stack_size, 1);
            state.limit = visitor.limit();
            if V::IS_ORDERED {
                state.cull_beyond::<L>();
            }
            state.pop_next::<L>(&prefetcher);
            ready.add(state_idx, state.next);
        }
    }
}

impl RayState {
    #[inline(always)]
    fn start<V: RayVisitor>(&mut self, tree: &V::Tree, visitor_idx: usize, visitor: &V) {
        self.ray = SlabRay::new(&tree.nodes()[0], visitor.ray());
        self.limit = visitor.limit();
        self.visitor_idx = visitor_idx as u32;
        self.next = ROOT;
        self.stack_size = 1;
    }

    /// Pushes those children of the next node that the ray enters.
    #[inline(always)]
    fn push_children<L: Lanes, V: RayVisitor>(&mut self, tree: &V::Tree) {
        let node = &tree.nodes()[self.next as usize];
        let (lanes, entries) = intersect_children::<L>(node, &self.ray, self.limit);
        let children = node.packed_children::<L>();
        let top = (self.stack_size as usize).min(STACK_SIZE - LANES);
        let free = &mut self.stack.children[top..top + LANES];
        if V::IS_ORDERED {
            let (entries, children) = entries.sort_descending(lanes, children);
            free.copy_from_slice(&children.store());
            self.stack.entries[top..top + LANES].copy_from_slice(&entries.store());
        } else {
            free.copy_from_slice(&children.compress(lanes).store());
        }
        self.stack_size += lanes.bits().count_ones();
    }

    /// Drops all children that the ray enters beyond its limit. A loop that ended at the first child to keep
    /// would be unpredictable.
    #[inline(always)]
    fn cull_beyond<L: Lanes>(&mut self) {
        let TraversalStack { children, entries } = &mut self.stack;
        let (mut first, mut n_kept) = (1, 1);
        let size = self.stack_size as usize;
        while first < size {
            let (child, entry) =
                (lanes_from::<L>(children, first), lanes_from::<L>(entries, first));
            let valid = L::first_lanes::<0>((size - first).min(LANES) as u32);
            let near = valid & entry.le(L::splat(self.limit));
            children[n_kept..n_kept + LANES].copy_from_slice(&child.compress(near).store());
            entries[n_kept..n_kept + LANES].copy_from_slice(&entry.compress(near).store());
            n_kept += near.bits().count_ones() as usize;
            first += LANES;
        }
        self.stack_size = n_kept as u32;
    }

    /// Takes the next child from the stack and prefetches it.
    #[inline(always)]
    fn pop_next<L: Lanes>(&mut self, prefetcher: &Prefetcher) {
        self.stack_size -= 1;
        self.next = self.stack.children[self.stack_size as usize].to_bits();
        prefetcher.prefetch::<L>(self.next);
    }
}

/// Loads eight of `values` from `first`, or zeros if there are fewer.
#[inline(always)]
fn lanes_from<L: Lanes>(values: &[f32], first: usize) -> L {
    match values[first..].first_chunk() {
        Some(values) => L::load(values),
        None => L::splat(0.0),
    }
}
