//! Groups of adjacent packets, whose shared work is done once.
//!
//! Rays through neighbouring pixels pass the same nodes on their way down the tree. A frustum around all of
//! them goes there first (after Reshetov, Soupikov and Hurley, Multi-Level Ray Tracing Algorithm, 2005), down
//! to nodes about as wide as itself. These are the entry points, at which the search of each packet begins.

use crate::bvh::{BvhNode, Child};
use crate::flat::BlockTree;
use crate::math::{LANES, Lanes, PACKET_WIDTH, PacketLanes, Ray};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::traversal::children::{ChildBox, ChildRows, OverlappedChildren};
use crate::trace::traversal::frustum::{Frustum, FrustumApex, is_probably_coherent};
use crate::trace::traversal::packet::Packet;
use crate::trace::traversal::prefetch::Prefetcher;
use crate::trace::traversal::stack::MAX_ENTRY_POINTS;

/// Maximum number of rays in a group.
pub const GROUP_SIZE: usize = 16 * PACKET_WIDTH;

/// Up to sixteen adjacent packets.
pub struct PacketGroup<W> {
    converges_at_end: bool,
    /// The rays of each packet. They are valid only with an `apex`, which says that all are coherent.
    packets: Vec<PacketRays<W>>,
    apex: Option<FrustumApex>,
    entry_points: [ChildRows; MAX_ENTRY_POINTS / LANES],
    /// Number of `entry_points` rows in use.
    n_rows: usize,
}

impl<W: PacketLanes> PacketGroup<W> {
    /// Returns an empty group. `converges_at_end` says that the rays' far ends may be closer to each other
    /// than their origins, like those of shadow rays at a light.
    pub fn new(converges_at_end: bool) -> Self {
        let packets = Vec::with_capacity(GROUP_SIZE / PACKET_WIDTH);
        let entry_points = [ChildRows::NONE; MAX_ENTRY_POINTS / LANES];
        Self { converges_at_end, packets, apex: None, entry_points, n_rows: 0 }
    }

    /// Replaces the rays by one to `GROUP_SIZE` others, and finds their entry points if all are coherent.
    #[inline(always)]
    pub fn load<L: Lanes<PacketLanes = W>, T: BlockTree>(&mut self, tree: &T, rays: &[Ray]) {
        self.packets.clear();
        self.apex = None;
        if rays.len() <= PACKET_WIDTH || !is_probably_coherent(rays) {
            return;
        }
        for rays in rays.chunks(PACKET_WIDTH) {
            self.packets.push(PacketRays::new(rays));
        }
        let Some(apex) = FrustumApex::new(&rays[0], &self.packets, self.converges_at_end) else {
            return;
        };
        let Some(frustum) = Frustum::new(&tree.nodes()[0], &apex, &self.packets) else { return };
        self.apex = Some(apex);
        let mut entry_points = EntryPoints::at_root();
        entry_points.descend::<L, T>(tree, &frustum);
        if !self.converges_at_end {
            entry_points.sort();
        }
        self.n_rows = 0;
        for boxes in entry_points.boxes().chunks(LANES) {
            self.entry_points[self.n_rows] = ChildRows::new(boxes);
            self.n_rows += 1;
        }
    }

    /// Returns the packet of this index in the group, which holds `rays`, or `None` if they are not coherent.
    #[inline(always)]
    pub fn packet<'p, T: BlockTree>(
        &'p self,
        tree: &T,
        packet_idx: usize,
        rays: &'p [Ray],
    ) -> Option<Packet<'p, W>> {
        let root = &tree.nodes()[0];
        if let Some(apex) = &self.apex {
            let entry_points = Some(&self.entry_points[..self.n_rows]);
            return Packet::new(root, rays, self.packets[packet_idx], apex, entry_points);
        }
        if !is_probably_coherent(rays) {
            return None;
        }
        let lanes = PacketRays::new(rays);
        let apex = FrustumApex::new(&rays[0], std::slice::from_ref(&lanes), self.converges_at_end)?;
        Packet::new(root, rays, lanes, &apex, None)
    }
}

/// Boxes that hold everything that the rays of a group may hit.
struct EntryPoints {
    boxes: [ChildBox; MAX_ENTRY_POINTS],
    n: usize,
}

impl EntryPoints {
    fn at_root() -> Self {
        Self { boxes: [ChildBox::ROOT; MAX_ENTRY_POINTS], n: 1 }
    }

    fn boxes(&self) -> &[ChildBox] {
        &self.boxes[..self.n]
    }

    /// Replaces the root, and nodes wider than the frustum, by those of their children that the frustum
    /// overlaps.
    #[inline(always)]
    fn descend<L: Lanes, T: BlockTree>(&mut self, tree: &T, frustum: &Frustum) {
        let (nodes, prefetcher) = (tree.nodes(), Prefetcher::new(tree));
        self.open::<L>(0, &nodes[0], frustum, &prefetcher);
        let mut i = 0;
        while i < self.n && self.n + LANES <= MAX_ENTRY_POINTS {
            let next = &self.boxes[i];
            match Child::unpack(next.child) {
                Child::Node(node_idx) if frustum.is_narrower_than(&next.min, &next.max) => {
                    self.open::<L>(i, &nodes[node_idx as usize], frustum, &prefetcher);
                }
                _ => i += 1,
            }
        }
    }

    /// Replaces the node at `i` by its children.
    #[inline(always)]
    fn open<L: Lanes>(
        &mut self,
        i: usize,
        node: &BvhNode,
        frustum: &Frustum,
        prefetcher: &Prefetcher,
    ) {
        self.n -= 1;
        self.boxes[i] = self.boxes[self.n];
        let children = OverlappedChildren::<L>::new(node, frustum, frustum.max_limit());
        for child in children.iter() {
            prefetcher.prefetch::<L>(child.child);
            self.boxes[self.n] = child;
            self.n += 1;
        }
    }

    /// Sorts the nearest boxes to the end, from which they are visited first. Searches for any hit do not
    /// sort: in either order they were slower, by 2 to 13 %.
    #[inline(always)]
    fn sort(&mut self) {
        for end in 1..self.n {
            let next = self.boxes[end];
            let mut i = end;
            while 0 < i && self.boxes[i - 1].entry < next.entry {
                self.boxes[i] = self.boxes[i - 1];
                i -= 1;
            }
            self.boxes[i] = next;
        }
    }
}
