//! Many rays that go different ways, each a step at a time in turn.
//!
//! Such rays wait for memory most of the time. While one waits for its next node or block, asked for a
//! round before, the others do their steps.

use super::memory::Memory;
use super::node::{BoxRay, ray_entries};
use crate::bvh::{Child, STACK_SIZE};
use crate::flat::BlockTree;
use crate::math::{LANES, LaneMask, Lanes, Ray};
use std::hint::select_unpredictable;
use std::ops::ControlFlow;

/// Looks at the blocks that a ray comes by.
pub trait RayVisitor {
    type Tree: BlockTree;

    /// Whether near blocks are better seen first.
    const IS_ORDERED: bool;

    fn ray(&self) -> &Ray;

    /// Boxes entered beyond this distance are left out.
    fn limit(&self) -> f32;

    fn visit<L: Lanes>(&mut self, tree: &Self::Tree, block_idx: u32) -> ControlFlow<()>;
}

/// Rays on the way at a time: enough to hide a read from memory, few enough for the first cache.
const IN_FLIGHT: usize = 32;

/// With fewer at nodes, those elsewhere go on first: each change of kind is a branch foretold wrongly.
/// Between 10 and 22 it makes no difference.
const FEW: u32 = 16;

/// Of a stack that is read and written by whole lanes.
const ROOM: usize = STACK_SIZE + LANES;

/// Room for rays on their way, made when it is first needed, and kept from search to search: to clear it takes as
/// long as several rays.
#[derive(Default)]
pub struct Flight(Option<Box<[Flyer; IN_FLIGHT]>>);

/// A ray on its way.
#[derive(Clone, Copy, bytemuck::Zeroable)]
#[repr(align(64))]
struct Flyer {
    ray: BoxRay,
    visitor_idx: u32,
    /// The visitor's.
    limit: f32,
    /// Packed child.
    next: u32,
    n_waiting: u32,
    waiting: Waiting,
}

/// Children to look at later: packed, and where their boxes are entered. The root lies at the bottom:
/// who comes back to it is done. Whole lanes are stored on top, of which the last ones may hold nothing.
#[derive(Clone, Copy, bytemuck::Zeroable)]
struct Waiting {
    children: [f32; ROOM],
    entries: [f32; ROOM],
}

/// Flyers by their next step, a bit each.
#[derive(Clone, Copy)]
struct Steps {
    at_blocks: u32,
    done: u32,
}

impl Steps {
    fn at_nodes(self) -> u32 {
        !(self.at_blocks | self.done)
    }

    /// Without a branch: what comes next cannot be foretold.
    #[inline(always)]
    fn add(&mut self, flyer_idx: usize, next: u32) {
        self.at_blocks |= (next >> 31) << flyer_idx;
        self.done |= u32::from(next == ROOT) << flyer_idx;
    }
}

/// Takes the lowest bit out.
#[inline(always)]
fn pop(flyers: &mut u32) -> Option<usize> {
    if *flyers == 0 {
        return None;
    }
    let flyer_idx = flyers.trailing_zeros() as usize;
    *flyers &= *flyers - 1;
    Some(flyer_idx)
}

/// Lets each of `visitors` see every block whose box its ray enters before its limit, near boxes first if
/// they ask for that.
#[inline(always)]
pub fn fly<L: Lanes, V: RayVisitor>(flight: &mut Flight, tree: &V::Tree, visitors: &mut [V]) {
    if visitors.is_empty() {
        return;
    }
    // Of zeros, so that the root lies at the bottom of each stack.
    let flyers = flight.0.get_or_insert_with(bytemuck::zeroed_box);
    let memory = Memory::new(tree);
    let mut n_started = 0;
    let mut steps = Steps { at_blocks: 0, done: u32::MAX };
    loop {
        let mut done = steps.done;
        while n_started < visitors.len()
            && let Some(flyer_idx) = pop(&mut done)
        {
            flyers[flyer_idx].start(tree, n_started, &visitors[n_started]);
            n_started += 1;
        }
        steps.done = done;
        if done == u32::MAX {
            return;
        }
        loop {
            let mut at_nodes = steps.at_nodes();
            while let Some(flyer_idx) = pop(&mut at_nodes) {
                let flyer = &mut flyers[flyer_idx];
                flyer.enter::<L, V>(tree);
                flyer.go_on::<L>(&memory);
                steps.add(flyer_idx, flyer.next);
            }
            if steps.at_nodes().count_ones() < FEW {
                break;
            }
        }
        let mut at_blocks = std::mem::take(&mut steps.at_blocks);
        while let Some(flyer_idx) = pop(&mut at_blocks) {
            let flyer = &mut flyers[flyer_idx];
            let visitor = &mut visitors[flyer.visitor_idx as usize];
            let block_idx = flyer.next & !Child::BLOCK_BIT;
            let goes_on = visitor.visit::<L>(tree, block_idx).is_continue();
            // As whether something is hit cannot be foretold either.
            flyer.n_waiting = select_unpredictable(goes_on, flyer.n_waiting, 1);
            flyer.limit = visitor.limit();
            if V::IS_ORDERED {
                flyer.forget_far::<L>();
            }
            flyer.go_on::<L>(&memory);
            steps.add(flyer_idx, flyer.next);
        }
    }
}

const ROOT: u32 = 0;

impl Flyer {
    #[inline(always)]
    fn start<V: RayVisitor>(&mut self, tree: &V::Tree, visitor_idx: usize, visitor: &V) {
        self.ray = BoxRay::new(&tree.nodes()[0], visitor.ray());
        self.limit = visitor.limit();
        self.visitor_idx = visitor_idx as u32;
        self.next = ROOT;
        self.n_waiting = 1;
    }

    /// Lets those children of the next node wait that the ray enters.
    #[inline(always)]
    fn enter<L: Lanes, V: RayVisitor>(&mut self, tree: &V::Tree) {
        let node = &tree.nodes()[self.next as usize];
        let (lanes, entries) = ray_entries::<L>(node, &self.ray, self.limit);
        let children = node.packed_children::<L>();
        let top = (self.n_waiting as usize).min(STACK_SIZE - LANES);
        let place = &mut self.waiting.children[top..top + LANES];
        if V::IS_ORDERED {
            let (entries, children) = entries.sort_from_far(lanes, children);
            place.copy_from_slice(&children.store());
            self.waiting.entries[top..top + LANES].copy_from_slice(&entries.store());
        } else {
            place.copy_from_slice(&children.compress(lanes).store());
        }
        self.n_waiting += lanes.bits().count_ones();
    }

    /// Drops what waits beyond the limit: all at once, as a loop that ends at the first child to keep
    /// could not be foretold.
    #[inline(always)]
    fn forget_far<L: Lanes>(&mut self) {
        let Waiting { children, entries } = &mut self.waiting;
        let (mut first, mut n_kept) = (1, 1);
        let n_waiting = self.n_waiting as usize;
        while first < n_waiting {
            let (child, entry) =
                (lanes_from::<L>(children, first), lanes_from::<L>(entries, first));
            let there = L::below::<0>((n_waiting - first).min(LANES) as u32);
            let near = there & entry.less_equal(L::splat(self.limit));
            children[n_kept..n_kept + LANES].copy_from_slice(&child.compress(near).store());
            entries[n_kept..n_kept + LANES].copy_from_slice(&entry.compress(near).store());
            n_kept += near.bits().count_ones() as usize;
            first += LANES;
        }
        self.n_waiting = n_kept as u32;
    }

    /// Takes the next child, and asks for its memory.
    #[inline(always)]
    fn go_on<L: Lanes>(&mut self, memory: &Memory) {
        self.n_waiting -= 1;
        self.next = self.waiting.children[self.n_waiting as usize].to_bits();
        memory.prefetch::<L>(self.next);
    }
}

/// Eight of `values` from `first` on, zeros if there are fewer.
#[inline(always)]
fn lanes_from<L: Lanes>(values: &[f32], first: usize) -> L {
    match values[first..].first_chunk() {
        Some(values) => L::load(values),
        None => L::splat(0.0),
    }
}
