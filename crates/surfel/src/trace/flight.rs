//! Many rays that go different ways, each a step at a time in turn.
//!
//! Such rays wait for memory most of the time. While one waits for its next node or block, asked for a
//! round before, the others do their steps.

use super::memory::Memory;
use super::node::{BoxRay, ray_entries};
use super::traverse::RayVisitor;
use crate::bvh::{Child, STACK_SIZE};
use crate::flat::FlatPoints;
use crate::math::{LANES, LaneMask, Lanes};
use std::ops::ControlFlow;

/// Rays on the way at a time: enough to hide a read from memory, few enough for the first cache.
const IN_FLIGHT: usize = 32;

/// A ray on its way.
#[derive(Clone, Copy)]
struct Flyer {
    ray: BoxRay,
    visitor_idx: u32,
    /// The visitor's.
    limit: f32,
    /// Packed child.
    next: u32,
    n_waiting: usize,
    waiting: Waiting,
}

/// Children to look at later: packed, and where their boxes are entered. Whole lanes are stored on top,
/// of which the last ones may hold nothing.
#[derive(Clone, Copy)]
struct Waiting {
    children: [f32; STACK_SIZE],
    entries: [f32; STACK_SIZE],
}

/// The flyers whose next step is a node, and those whose is a block.
#[derive(Clone, Copy)]
struct Queues {
    at_nodes: [u8; IN_FLIGHT],
    at_blocks: [u8; IN_FLIGHT],
    n_nodes: usize,
    n_blocks: usize,
}

impl Queues {
    /// Writes to both and counts in one: which one it is cannot be foretold.
    #[inline(always)]
    fn push(&mut self, flyer_idx: usize, child: u32) {
        let is_block = (child >> 31) as usize;
        self.at_nodes[self.n_nodes % IN_FLIGHT] = flyer_idx as u8;
        self.at_blocks[self.n_blocks % IN_FLIGHT] = flyer_idx as u8;
        self.n_nodes += 1 - is_block;
        self.n_blocks += is_block;
    }
}

/// Lets each of `visitors` see every block whose box its ray enters before its limit, near boxes first if
/// they ask for that.
#[inline(always)]
pub fn fly<L: Lanes, V: RayVisitor>(points: &FlatPoints, visitors: &mut [V]) {
    let Some(first) = visitors.first() else { return };
    let waiting = Waiting { children: [0.0; STACK_SIZE], entries: [0.0; STACK_SIZE] };
    let mut flyers = [Flyer {
        ray: BoxRay::new(&points.nodes[0], first.ray()),
        visitor_idx: 0,
        limit: 0.0,
        next: ROOT,
        n_waiting: 0,
        waiting,
    }; IN_FLIGHT];
    let memory = Memory::new(points);
    let mut n_started = 0;
    let nobody = [0; IN_FLIGHT];
    let mut queues = Queues { at_nodes: nobody, at_blocks: nobody, n_nodes: 0, n_blocks: 0 };
    for (flyer_idx, flyer) in flyers.iter_mut().enumerate() {
        if flyer.start(points, visitors, &mut n_started) {
            queues.push(flyer_idx, flyer.next);
        }
    }
    while 0 < queues.n_nodes + queues.n_blocks {
        let (at_nodes, n_nodes) = (queues.at_nodes, queues.n_nodes);
        queues.n_nodes = 0;
        for place in 0..n_nodes {
            let flyer_idx = usize::from(at_nodes[place % IN_FLIGHT]) % IN_FLIGHT;
            let flyer = &mut flyers[flyer_idx];
            flyer.enter::<L, V>(points);
            if flyer.go_on::<L, V>(&memory) || flyer.start(points, visitors, &mut n_started) {
                queues.push(flyer_idx, flyer.next);
            }
        }
        let (at_blocks, n_blocks) = (queues.at_blocks, queues.n_blocks);
        queues.n_blocks = 0;
        for place in 0..n_blocks {
            let flyer_idx = usize::from(at_blocks[place % IN_FLIGHT]) % IN_FLIGHT;
            let flyer = &mut flyers[flyer_idx];
            let visitor = &mut visitors[flyer.visitor_idx as usize];
            let block_idx = flyer.next & !Child::BLOCK_BIT;
            if visitor.visit::<L>(points, block_idx) == ControlFlow::Break(()) {
                flyer.n_waiting = 0;
            }
            flyer.limit = visitor.limit();
            if flyer.go_on::<L, V>(&memory) || flyer.start(points, visitors, &mut n_started) {
                queues.push(flyer_idx, flyer.next);
            }
        }
    }
}

const ROOT: u32 = 0;

impl Flyer {
    /// Begins with the next ray that waits; false if none does.
    #[inline(always)]
    fn start(
        &mut self,
        points: &FlatPoints,
        visitors: &[impl RayVisitor],
        n_started: &mut usize,
    ) -> bool {
        let Some(visitor) = visitors.get(*n_started) else { return false };
        self.ray = BoxRay::new(&points.nodes[0], visitor.ray());
        self.limit = visitor.limit();
        self.visitor_idx = *n_started as u32;
        self.next = ROOT;
        *n_started += 1;
        true
    }

    /// Lets those children of the next node wait that the ray enters.
    #[inline(always)]
    fn enter<L: Lanes, V: RayVisitor>(&mut self, points: &FlatPoints) {
        let node = &points.nodes[self.next as usize];
        let (lanes, entries) = ray_entries::<L>(node, &self.ray, self.limit);
        let children = node.packed_children::<L>();
        let top = self.n_waiting.min(STACK_SIZE - LANES);
        let place = &mut self.waiting.children[top..top + LANES];
        if V::IS_ORDERED {
            let (entries, children) = entries.sort_from_far(lanes, children);
            place.copy_from_slice(&children.store());
            self.waiting.entries[top..top + LANES].copy_from_slice(&entries.store());
        } else {
            place.copy_from_slice(&children.compress(lanes.bits()).store());
        }
        self.n_waiting += lanes.bits().count_ones() as usize;
    }

    /// Takes the next child, and asks for its memory; false if none waits.
    #[inline(always)]
    fn go_on<L: Lanes, V: RayVisitor>(&mut self, memory: &Memory) -> bool {
        loop {
            if self.n_waiting == 0 {
                return false;
            }
            self.n_waiting -= 1;
            if !V::IS_ORDERED || self.waiting.entries[self.n_waiting] <= self.limit {
                break;
            }
        }
        self.next = self.waiting.children[self.n_waiting].to_bits();
        memory.prefetch::<L>(self.next);
        true
    }
}
