//! Blocks that few rays of a packet enter: each ray looks at its own.
//!
//! Where many points lie behind a pixel, hardly two rays of a packet meet the same discs. To put the blocks of
//! a node on the stack one by one, and to try each of their discs on all rays, then costs more than to find out
//! which ray enters which block. Rays that look for any hit go without: shadow rays of clouds of a million
//! points were a tenth slower.

use super::frustum::Boxes;
use super::memory::Memory;
use super::packet::{Packet, PacketVisitor};
use crate::bvh::{Child, Node};
use crate::math::{LaneMask, Lanes, WIDE, Wide};

/// Up to as many rays, on average, are quicker shown a block one by one. Between 3.5 and 5 it makes no difference.
const FEW: f32 = 4.5;
/// Blocks after which those before count half.
const LONG_AGO: u32 = 256;

/// How many rays entered the blocks of late. What a search costs depends on it, what it finds does not.
pub struct Density {
    n_rays: u32,
    n_blocks: u32,
}

impl Density {
    pub fn new() -> Self {
        Self { n_rays: 0, n_blocks: 0 }
    }

    #[inline(always)]
    pub fn add(&mut self, n_rays: u32, n_blocks: u32) {
        self.n_rays += n_rays;
        self.n_blocks += n_blocks;
    }

    #[inline(always)]
    pub fn forget_old(&mut self) {
        if LONG_AGO < self.n_blocks {
            self.n_rays /= 2;
            self.n_blocks /= 2;
        }
    }

    /// Not before the first block: in crowds, the blocks of one node shown to each ray cost as much as a
    /// whole packet.
    #[inline(always)]
    pub fn is_low(&self) -> bool {
        (self.n_rays as f32) < FEW * self.n_blocks as f32
    }
}

/// Shows the blocks below a node, which has no other children, to those of the rays in `lanes` that enter
/// their boxes.
#[inline(always)]
pub fn show_each<L: Lanes, V: PacketVisitor<L>>(
    tree: &V::Tree,
    node: &Node,
    packet: &Packet<L::Wide>,
    mut lanes: u32,
    memory: &Memory,
    density: &mut Density,
    visitor: &mut V,
) {
    let boxes = packet.frustum.boxes::<L>(node);
    let lines = LinesByLane::new(packet);
    let first_block = node.first_block();
    let mut rays = [(0, 0); WIDE];
    let (mut n_rays, mut n_entered, mut all) = (0, 0, 0);
    // All boxes before the first block, so that no branch on them waits for a hit: limits asked for in between
    // cost all that is gained.
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize % WIDE;
        lanes &= lanes - 1;
        let entered = lines.entered::<L>(lane, &boxes, visitor.limits()[lane]) & node.occupied();
        rays[n_rays % WIDE] = (lane, entered);
        n_rays += 1;
        n_entered += entered.count_ones();
        all |= entered;
    }
    density.add(n_entered, all.count_ones());
    while all != 0 {
        memory.prefetch::<L>(Child::Block(first_block + all.trailing_zeros()).pack());
        all &= all - 1;
    }
    for &(lane, entered) in &rays[..n_rays] {
        let mut entered = entered;
        while entered != 0 {
            visitor.visit_alone(tree, first_block + entered.trailing_zeros(), lane);
            entered &= entered - 1;
        }
    }
}

/// Rays of a packet relative to its frustum's anchor, axes in the order of the frustum's.
struct LinesByLane {
    from_anchor: [[f32; WIDE]; 3],
    inverse: [[f32; WIDE]; 3],
    t_min: [f32; WIDE],
}

impl LinesByLane {
    #[inline(always)]
    fn new<W: Wide>(packet: &Packet<W>) -> Self {
        let ([a, b, c], [d, e, f]) = (packet.from_anchor, packet.inverse);
        Self {
            from_anchor: [a.store(), b.store(), c.store()],
            inverse: [d.store(), e.store(), f.store()],
            t_min: packet.wide.t_min.store(),
        }
    }

    /// The boxes that the ray in `lane` passes before `limit`, as `Packet::passing` tells it.
    #[inline(always)]
    fn entered<L: Lanes>(&self, lane: usize, boxes: &Boxes<L>, limit: f32) -> u32 {
        let (mut enter, mut leave) = (L::splat(self.t_min[lane]), L::splat(limit));
        for axis in 0..3 {
            let from_anchor = L::splat(self.from_anchor[axis][lane]);
            let inverse = L::splat(self.inverse[axis][lane]);
            let low = (boxes.min[axis] - from_anchor) * inverse;
            let high = (boxes.max[axis] - from_anchor) * inverse;
            enter = low.min(high).max(enter);
            leave = low.max(high).min(leave);
        }
        enter.less_equal(leave).bits()
    }
}
