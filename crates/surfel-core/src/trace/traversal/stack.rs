//! The stack of a packet's traversal, which orders the children of each node.

use crate::bvh::{BvhNode, Child, STACK_SIZE};
use crate::math::Lanes;
use crate::trace::traversal::children::{ChildBox, OverlappedChildren};
use crate::trace::traversal::packet::Packet;
use crate::trace::traversal::prefetch::Prefetcher;
use crate::trace::traversal::sparse::LeafOccupancy;

/// Maximum number of boxes at which the search of a packet begins. With 16, camera rays are up to a tenth
/// slower.
pub const MAX_ENTRY_POINTS: usize = 32;

/// The nodes and blocks that the search of a packet has still to visit. It is reused from packet to packet.
pub struct PacketStack {
    boxes: [ChildBox; STACK_SIZE + MAX_ENTRY_POINTS],
    size: usize,
    /// The packed node whose children have been prefetched.
    prefetched: Option<u32>,
    /// The occupancy of the blocks visited so far.
    pub occupancy: LeafOccupancy,
}

impl PacketStack {
    /// Returns a stack.
    pub fn new() -> Self {
        let boxes = [ChildBox::ROOT; STACK_SIZE + MAX_ENTRY_POINTS];
        Self { boxes, size: 0, prefetched: None, occupancy: LeafOccupancy::new() }
    }

    /// Begins with those of the packet's entry points that its frustum overlaps, or with the root.
    #[inline(always)]
    pub fn start<L: Lanes>(&mut self, packet: &Packet<L::PacketLanes>, limit: f32) {
        self.occupancy.decay();
        self.prefetched = None;
        self.boxes[0] = ChildBox::ROOT;
        self.size = 1;
        let Some(entry_points) = packet.entry_points else { return };
        self.size = 0;
        for rows in entry_points {
            for child in rows.overlapped_by::<L>(&packet.frustum, limit) {
                self.boxes[self.size] = child;
                self.size += 1;
            }
        }
    }

    /// Takes the top of the stack.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<ChildBox> {
        self.size = self.size.checked_sub(1)?;
        Some(self.boxes[self.size])
    }

    /// True if the children of this packed node have been prefetched.
    #[inline(always)]
    pub fn is_prefetched(&self, node: u32) -> bool {
        self.prefetched == Some(node)
    }

    /// Prefetches the children of the top of the stack, if it is a node: they take longer to arrive than the
    /// node before it takes to visit.
    #[inline(always)]
    pub fn prefetch_next<L: Lanes>(
        &mut self,
        nodes: &[BvhNode],
        prefetcher: &Prefetcher,
        limit: f32,
    ) {
        let Some(next) = self.boxes[..self.size].last() else { return };
        if let Child::Node(node_idx) = Child::unpack(next.child)
            && next.entry <= limit
        {
            let node = &nodes[node_idx as usize];
            prefetcher.prefetch_children::<L>(node, node.occupied_lanes());
            self.prefetched = Some(next.child);
        }
    }

    /// Pushes children, the nearest last if `is_ordered`, and prefetches them.
    #[inline(always)]
    pub fn push<L: Lanes>(
        &mut self,
        children: &OverlappedChildren<L>,
        prefetcher: &Prefetcher,
        is_ordered: bool,
    ) {
        let first = self.size;
        for next in children.iter() {
            prefetcher.prefetch::<L>(next.child);
            let mut i = self.size;
            if is_ordered {
                while first < i && self.boxes[i - 1].entry < next.entry {
                    self.boxes[i] = self.boxes[i - 1];
                    i -= 1;
                }
            }
            self.boxes[i] = next;
            self.size += 1;
        }
    }
}
