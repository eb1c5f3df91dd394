//! Packets side by side: what they share is worked out once.
//!
//! Rays through neighbouring pixels come by the same nodes on their way down the tree. A frustum around all of
//! them goes there first (after Reshetov, Soupikov and Hurley, Multi-Level Ray Tracing Algorithm, 2005), down to
//! nodes about as wide as itself, and the search of each packet begins with these.

use super::frustum::{self, Anchor, Frustum};
use super::memory::Memory;
use super::packet::{ChildBox, ChildRows, Met, Packet, WideRays};
use crate::bvh::{Child, Node};
use crate::flat::BlockTree;
use crate::math::{LANES, Lanes, Ray, WIDE, Wide};

/// Rays of a group.
pub const GROUP: usize = 16 * WIDE;
/// Boxes with which a search begins. With 16, camera rays are up to a tenth slower.
pub const MOST_STARTS: usize = 32;

/// Rays of which packets are made.
pub struct Group<W> {
    ends_meet: bool,
    /// Of use where there is an `anchor`: then all are alike.
    wide: Vec<WideRays<W>>,
    anchor: Option<Anchor>,
    starts: [ChildRows; MOST_STARTS / LANES],
    /// Of `starts`, in use.
    n_rows: usize,
}

impl<W: Wide> Group<W> {
    /// `ends_meet` says that rays' far ends may be closer to each other than their origins, as at a light.
    pub fn new(ends_meet: bool) -> Self {
        let wide = Vec::with_capacity(GROUP / WIDE);
        let starts = [ChildRows::NONE; MOST_STARTS / LANES];
        Self { ends_meet, wide, anchor: None, starts, n_rows: 0 }
    }

    /// Takes one to `GROUP` rays instead of those before.
    #[inline(always)]
    pub fn take<L: Lanes<Wide = W>, T: BlockTree>(&mut self, tree: &T, rays: &[Ray]) {
        self.wide.clear();
        self.anchor = None;
        if rays.len() <= WIDE || !frustum::may_be_alike(rays) {
            return;
        }
        for rays in rays.chunks(WIDE) {
            self.wide.push(WideRays::new(rays));
        }
        let Some(anchor) = Anchor::new(&rays[0], &self.wide, self.ends_meet) else { return };
        let Some(frustum) = Frustum::new(&tree.nodes()[0], &anchor, &self.wide) else { return };
        self.anchor = Some(anchor);
        let mut starts = Starts::at_root();
        starts.go_down::<L, T>(tree, &frustum);
        if !self.ends_meet {
            starts.sort();
        }
        self.n_rows = 0;
        for boxes in starts.boxes().chunks(LANES) {
            self.starts[self.n_rows] = ChildRows::new(boxes);
            self.n_rows += 1;
        }
    }

    /// Of `rays`, the ones in this sixteenth of the group, if they are alike enough.
    #[inline(always)]
    pub fn packet<'p, T: BlockTree>(
        &'p self,
        tree: &T,
        place: usize,
        rays: &'p [Ray],
    ) -> Option<Packet<'p, W>> {
        let root = &tree.nodes()[0];
        if let Some(anchor) = &self.anchor {
            let starts = Some(&self.starts[..self.n_rows]);
            return Packet::new(root, rays, self.wide[place], anchor, starts);
        }
        if !frustum::may_be_alike(rays) {
            return None;
        }
        let wide = WideRays::new(rays);
        let anchor = Anchor::new(&rays[0], std::slice::from_ref(&wide), self.ends_meet)?;
        Packet::new(root, rays, wide, &anchor, None)
    }
}

/// Boxes that hold all that rays may meet.
struct Starts {
    boxes: [ChildBox; MOST_STARTS],
    n: usize,
}

impl Starts {
    fn at_root() -> Self {
        Self { boxes: [ChildBox::ROOT; MOST_STARTS], n: 1 }
    }

    fn boxes(&self) -> &[ChildBox] {
        &self.boxes[..self.n]
    }

    /// Puts in the place of the root, and of nodes wider than the frustum, those of their children that it
    /// meets.
    #[inline(always)]
    fn go_down<L: Lanes, T: BlockTree>(&mut self, tree: &T, frustum: &Frustum) {
        let (nodes, memory) = (tree.nodes(), Memory::new(tree));
        self.open::<L>(0, &nodes[0], frustum, &memory);
        let mut place = 0;
        while place < self.n && self.n + LANES <= MOST_STARTS {
            let next = &self.boxes[place];
            match Child::unpack(next.child) {
                Child::Node(node_idx) if frustum.is_narrower(&next.min, &next.max) => {
                    self.open::<L>(place, &nodes[node_idx as usize], frustum, &memory);
                }
                _ => place += 1,
            }
        }
    }

    #[inline(always)]
    fn open<L: Lanes>(&mut self, place: usize, node: &Node, frustum: &Frustum, memory: &Memory) {
        self.n -= 1;
        self.boxes[place] = self.boxes[self.n];
        let mut children = Met::<L>::new(node, frustum, frustum.reach()).children();
        while let Some(child) = children.next() {
            memory.prefetch::<L>(child.child);
            self.boxes[self.n] = child;
            self.n += 1;
        }
    }

    /// Near ones last, to be looked at first. Not for rays that look for any hit: in either order they were
    /// slower, by 2 to 13 %.
    #[inline(always)]
    fn sort(&mut self) {
        for end in 1..self.n {
            let next = self.boxes[end];
            let mut place = end;
            while 0 < place && self.boxes[place - 1].entry < next.entry {
                self.boxes[place] = self.boxes[place - 1];
                place -= 1;
            }
            self.boxes[place] = next;
        }
    }
}
