//! Blocks that few rays of a packet enter: each ray looks at its own.
//!
//! Where many points lie behind a pixel, hardly two rays of a packet meet the same discs. To put the blocks of
//! a node on the stack one by one, and to try each of their discs on all rays, then costs more than to find out
//! which ray enters which block. Rays that look for any hit go without, and those that gather: they were a
//! tenth slower.

use super::packet::{Met, Packet, PacketVisitor};
use crate::bvh::Child;
use crate::math::{LANES, Lanes};

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
    pub fn is_below(&self, n_rays: f32) -> bool {
        (self.n_rays as f32) < n_rays * self.n_blocks as f32
    }
}

/// Shows the blocks below a node, which has no other children, to those of `rays` that enter their boxes.
#[inline(always)]
pub fn show_each<L: Lanes, V: PacketVisitor<L>>(
    tree: &V::Tree,
    met: &Met<L>,
    packet: &Packet<L::Wide>,
    rays: u32,
    density: &mut Density,
    visitor: &mut V,
) {
    // All of them before the first block, so that no branch waits for a hit: limits asked for in between cost
    // all that is gained.
    let mut children = met.children();
    let mut entered = [(0, 0); LANES];
    let (mut n_rays, mut n_blocks) = (0, 0);
    while let Some(child) = children.next() {
        let lanes = packet.passing(&child, visitor.limits()) & rays;
        entered[n_blocks] = (child.child & !Child::BLOCK_BIT, lanes);
        n_rays += lanes.count_ones();
        n_blocks += usize::from(lanes != 0);
    }
    density.add(n_rays, n_blocks as u32);
    visitor.visit_each(tree, &entered[..n_blocks]);
}
