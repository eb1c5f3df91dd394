//! Blocks that few rays of a packet enter: each ray looks at its own.
//!
//! Where many points lie behind a pixel, hardly two rays of a packet meet the same discs. To put the blocks of
//! a node on the stack one by one, and to try each of their discs on all rays, then costs more than to find out
//! which ray enters which block. Rays that look for any hit go without, and those that gather: they were a
//! tenth slower.

use super::frustum::Boxes;
use super::memory::Memory;
use super::packet::{Met, Packet, PacketVisitor};
use crate::bvh::Child;
use crate::math::{LANES, LaneMask, Lanes, WIDE, Wide};

/// Up to as many rays, on average, are quicker shown a block one by one. Between 4.5 and 6.5 it hardly
/// makes a difference.
const FEW: f32 = 5.5;
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

/// Shows the blocks below a node, which has no other children, to those of `rays` that enter their boxes.
#[inline(always)]
pub fn show_each<L: Lanes, V: PacketVisitor<L>>(
    tree: &V::Tree,
    met: &Met<L>,
    packet: &Packet<L::Wide>,
    mut rays: u32,
    memory: &Memory,
    density: &mut Density,
    visitor: &mut V,
) {
    let first_block = met.node.first_block();
    // Before it is known which rays enter: until then the memory is on its way.
    let mut blocks = met.lanes;
    while blocks != 0 {
        memory.prefetch::<L>(Child::Block(first_block + blocks.trailing_zeros()).pack());
        blocks &= blocks - 1;
    }
    // For each ray a byte, in it a bit for each block. All of them before the first block, so that no branch
    // waits for a hit: limits asked for in between cost all that is gained.
    let lines = LinesByLane::new(packet);
    let mut entered = [0; WIDE / LANES];
    while rays != 0 {
        let lane = rays.trailing_zeros() as usize % WIDE;
        rays &= rays - 1;
        let bits = lines.entered::<L>(lane, &met.boxes, visitor.limits()[lane]) & met.lanes;
        entered[lane / LANES] |= u64::from(bits) << (lane % LANES * LANES);
        blocks |= bits;
    }
    let [low, high] = entered;
    density.add(low.count_ones() + high.count_ones(), blocks.count_ones());
    let (low, high) = (transposed(low), transposed(high));
    while blocks != 0 {
        let block = blocks.trailing_zeros();
        blocks &= blocks - 1;
        let rays = low >> (8 * block) & 0xff | (high >> (8 * block) & 0xff) << 8;
        visitor.visit_each(tree, first_block + block, rays as u32);
    }
}

/// Of eight rows of eight bits, the columns (Warren 2012, Hacker's Delight, 7-3).
#[inline(always)]
fn transposed(mut bits: u64) -> u64 {
    for (mask, shift) in
        [(0x00aa_00aa_00aa_00aa, 7), (0x0000_cccc_0000_cccc, 14), (0x0000_0000_f0f0_f0f0, 28)]
    {
        let moved = (bits ^ bits >> shift) & mask;
        bits ^= moved ^ moved << shift;
    }
    bits
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bit_of_eight_rows_goes_to_its_column() {
        for row in 0..8 {
            for column in 0..8 {
                assert_eq!(transposed(1 << (8 * row + column)), 1 << (8 * column + row));
            }
        }
        assert_eq!(transposed(0xff), 0x0101_0101_0101_0101);
    }
}
