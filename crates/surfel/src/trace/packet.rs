//! Sixteen rays that go much the same way, walked through the tree together.

use super::boxes::inverse;
use super::frustum::{Anchor, Boxes, Frustum};
use super::group::MOST_STARTS;
use super::memory::Memory;
use super::sparse::{self, Density};
use crate::bvh::{Child, Node, STACK_SIZE};
use crate::flat::BlockTree;
use crate::math::{LANES, LaneMask, Lanes, Ray, Vec3, Vec3Lanes, WIDE, Wide};
use crate::surface::RayLanes;
use std::borrow::Borrow;

/// Sixteen rays in lanes.
#[derive(Clone, Copy)]
pub struct WideRays<W> {
    pub origin: [W; 3],
    pub direction: [W; 3],
    pub t_min: W,
    pub t_max: W,
}

/// Up to sixteen rays that are alike.
pub struct Packet<'r, W> {
    pub rays: &'r [Ray],
    /// Where the search begins, if not at the root.
    starts: Option<&'r [ChildRows]>,
    pub wide: WideRays<W>,
    pub frustum: Frustum,
    /// Of the directions, in the order of the frustum's axes.
    inverse: [W; 3],
    /// Origins relative to the frustum's anchor, in the same order.
    from_anchor: [W; 3],
    /// Where all rays start, if that is one place.
    pub common_origin: Option<Vec3>,
}

/// What is looked for along the rays of a packet.
pub trait PacketVisitor<L: Lanes> {
    type Tree: BlockTree;
    /// Whether near boxes come first.
    const IS_ORDERED: bool;
    /// Blocks that fewer rays enter, on average, are shown to these alone, a node's all at once (`sparse`); none
    /// of them if this is 0.
    const FEW_RAYS: f32;

    /// A box entered beyond this is left out; below any distance where the ray needs nothing more.
    fn limits(&self) -> &[f32; WIDE];

    fn visit(&mut self, tree: &Self::Tree, block_idx: u32);

    /// Shows the block to the ray in this lane alone.
    fn visit_alone(&mut self, tree: &Self::Tree, block_idx: u32, lane: usize);

    /// Shows blocks, each to some lanes' rays alone.
    #[inline(always)]
    fn visit_each(&mut self, tree: &Self::Tree, blocks: &[(u32, u32)]) {
        for &(block_idx, mut lanes) in blocks {
            while lanes != 0 {
                self.visit_alone(tree, block_idx, lanes.trailing_zeros() as usize % WIDE);
                lanes &= lanes - 1;
            }
        }
    }
}

impl<W: Wide> WideRays<W> {
    /// Of one to sixteen rays; the last one fills the lanes that are left.
    #[inline(always)]
    pub fn new(rays: &[Ray]) -> Self {
        let mut filled = [rays[rays.len() - 1]; WIDE];
        let rays: &[Ray; WIDE] = match rays.first_chunk() {
            Some(rays) => rays,
            None => {
                filled[..rays.len()].copy_from_slice(rays);
                &filled
            }
        };
        let [x, y, z, t_min, to_x, to_y, to_z, t_max] = W::columns(bytemuck::cast_ref(rays));
        Self { origin: [x, y, z], direction: [to_x, to_y, to_z], t_min, t_max }
    }
}

impl<W: Wide> WideRays<W> {
    /// `start` if all rays start there.
    #[inline(always)]
    fn common_origin(&self, start: Vec3) -> Option<Vec3> {
        let [x, y, z] = self.origin;
        let (at_x, at_y, at_z) = (W::splat(start.x), W::splat(start.y), W::splat(start.z));
        let not_beyond = x.less_equal(at_x) & y.less_equal(at_y) & z.less_equal(at_z);
        let not_before = at_x.less_equal(x) & at_y.less_equal(y) & at_z.less_equal(z);
        let is_common = (not_beyond & not_before).bits() == (1 << WIDE) - 1;
        if is_common { Some(start) } else { None }
    }

    #[inline(always)]
    pub fn lanes(&self) -> RayLanes<W> {
        RayLanes { direction: self.direction(), t_min: self.t_min }
    }

    #[inline(always)]
    pub fn origin(&self) -> Vec3Lanes<W> {
        let [x, y, z] = self.origin;
        Vec3Lanes { x, y, z }
    }

    #[inline(always)]
    pub fn direction(&self) -> Vec3Lanes<W> {
        let [x, y, z] = self.direction;
        Vec3Lanes { x, y, z }
    }
}

impl<'r, W: Wide> Packet<'r, W> {
    /// One to sixteen rays, which stand in the lanes of `wide`, if they are alike enough.
    #[inline(always)]
    pub fn new(
        root: &Node,
        rays: &'r [Ray],
        wide: WideRays<W>,
        anchor: &Anchor,
        starts: Option<&'r [ChildRows]>,
    ) -> Option<Self> {
        let frustum = Frustum::new(root, anchor, std::slice::from_ref(&wide))?;
        let [a, b, c] = frustum.axes;
        let along = [wide.direction[a], wide.direction[b], wide.direction[c]];
        Some(Self {
            common_origin: wide.common_origin(rays[0].origin),
            rays,
            starts,
            inverse: [inverse(along[0]), inverse(along[1]), inverse(along[2])],
            from_anchor: [
                wide.origin[a] - W::splat(frustum.anchor[a]),
                wide.origin[b] - W::splat(frustum.anchor[b]),
                wide.origin[c] - W::splat(frustum.anchor[c]),
            ],
            wide,
            frustum,
        })
    }

    /// How far each ray looks at first; nowhere in lanes without a ray.
    #[inline(always)]
    pub fn limits(&self) -> [f32; WIDE] {
        let mut limits = self.wide.t_max.store();
        limits[self.rays.len()..].fill(f32::NEG_INFINITY);
        limits
    }

    /// The lanes whose rays pass the box before `limits`.
    #[inline(always)]
    pub fn passing(&self, bounds: &ChildBox, limits: &[f32; WIDE]) -> u32 {
        let (mut enter, mut leave) = (self.wide.t_min, W::load(limits));
        for axis in 0..3 {
            let low = (W::splat(bounds.min[axis]) - self.from_anchor[axis]) * self.inverse[axis];
            let high = (W::splat(bounds.max[axis]) - self.from_anchor[axis]) * self.inverse[axis];
            enter = low.min(high).max(enter);
            leave = low.max(high).min(leave);
        }
        enter.less_equal(leave).bits()
    }
}

/// A node or block that is still to be looked at, with its box as `Boxes` has it.
#[derive(Clone, Copy)]
pub struct ChildBox {
    /// Packed.
    pub child: u32,
    pub entry: f32,
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl ChildBox {
    /// The root's box holds all.
    pub const ROOT: Self =
        Self { child: 0, entry: 0.0, min: [f32::NEG_INFINITY; 3], max: [f32::INFINITY; 3] };
}

/// The children of a node that a packet's frustum meets.
pub struct Met<'n, L> {
    pub node: &'n Node,
    boxes: Boxes<L>,
    entries: [f32; LANES],
    pub lanes: u32,
}

impl<'n, L: Lanes> Met<'n, L> {
    #[inline(always)]
    pub fn new(node: &'n Node, frustum: &Frustum, limit: f32) -> Self {
        let boxes = frustum.boxes::<L>(node);
        let (lanes, entries) = frustum.meets::<L>(&boxes, limit);
        Self { node, boxes, entries, lanes: lanes & node.occupied() }
    }

    #[inline(always)]
    pub fn children(&self) -> MetChildren<ChildRows> {
        let (min, max) = self.boxes.store();
        let children = self.node.packed_children::<L>().store();
        let rows = ChildRows { children, min, max };
        MetChildren { rows, entries: self.entries, lanes: self.lanes }
    }
}

/// Eight children side by side.
#[derive(Clone, Copy)]
pub struct ChildRows {
    /// Packed, as the bits of floats.
    children: [f32; LANES],
    min: [[f32; LANES]; 3],
    max: [[f32; LANES]; 3],
}

impl ChildRows {
    /// No ray meets them.
    pub const NONE: Self = Self {
        children: [0.0; LANES],
        min: [[f32::INFINITY; LANES]; 3],
        max: [[f32::NEG_INFINITY; LANES]; 3],
    };

    pub fn new(children: &[ChildBox]) -> Self {
        let mut rows = Self::NONE;
        for (lane, child) in children.iter().enumerate() {
            rows.children[lane] = f32::from_bits(child.child);
            for axis in 0..3 {
                rows.min[axis][lane] = child.min[axis];
                rows.max[axis][lane] = child.max[axis];
            }
        }
        rows
    }

    #[inline(always)]
    fn boxes<L: Lanes>(&self) -> Boxes<L> {
        let ([a, b, c], [d, e, f]) = (&self.min, &self.max);
        Boxes {
            min: [L::load(a), L::load(b), L::load(c)],
            max: [L::load(d), L::load(e), L::load(f)],
        }
    }

    #[inline(always)]
    fn child(&self, lane: usize, entry: f32) -> ChildBox {
        let (min, max) = (&self.min, &self.max);
        ChildBox {
            child: self.children[lane].to_bits(),
            entry,
            min: [min[0][lane], min[1][lane], min[2][lane]],
            max: [max[0][lane], max[1][lane], max[2][lane]],
        }
    }
}

/// Children that are met, one by one: a list to loop over, as `HitList` is.
pub struct MetChildren<R> {
    rows: R,
    entries: [f32; LANES],
    lanes: u32,
}

impl<R: Borrow<ChildRows>> MetChildren<R> {
    #[inline(always)]
    pub fn next(&mut self) -> Option<ChildBox> {
        if self.lanes == 0 {
            return None;
        }
        let lane = self.lanes.trailing_zeros() as usize % LANES;
        self.lanes &= self.lanes - 1;
        Some(self.rows.borrow().child(lane, self.entries[lane]))
    }
}

/// What a search of a packet has still to look at. Kept from packet to packet.
pub struct PacketStack {
    boxes: [ChildBox; STACK_SIZE + MOST_STARTS],
    size: usize,
    /// The node whose children have been asked for ahead of time, packed.
    asked: Option<u32>,
    density: Density,
}

impl PacketStack {
    pub fn new() -> Self {
        let boxes = [ChildBox::ROOT; STACK_SIZE + MOST_STARTS];
        Self { boxes, size: 0, asked: None, density: Density::new() }
    }

    /// Begins with what the packet's frustum meets of its starts, or with the root.
    #[inline(always)]
    fn start<L: Lanes>(&mut self, packet: &Packet<L::Wide>, limit: f32) {
        self.density.forget_old();
        self.asked = None;
        self.boxes[0] = ChildBox::ROOT;
        self.size = 1;
        let Some(starts) = packet.starts else { return };
        self.size = 0;
        for rows in starts {
            let (lanes, entries) = packet.frustum.meets::<L>(&rows.boxes(), limit);
            let mut children = MetChildren { rows, entries, lanes };
            while let Some(child) = children.next() {
                self.boxes[self.size] = child;
                self.size += 1;
            }
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<ChildBox> {
        self.size = self.size.checked_sub(1)?;
        Some(self.boxes[self.size])
    }

    /// Asks for the children of the node that is looked at next, if it is one: they take longer to come than
    /// the node before it takes to look at.
    #[inline(always)]
    fn ask_ahead<L: Lanes>(&mut self, nodes: &[Node], memory: &Memory, limit: f32) {
        let Some(next) = self.boxes[..self.size].last() else { return };
        if let Child::Node(node_idx) = Child::unpack(next.child)
            && next.entry <= limit
        {
            let node = &nodes[node_idx as usize];
            memory.prefetch_children::<L>(node, node.occupied());
            self.asked = Some(next.child);
        }
    }

    /// Pushes children and asks for their memory.
    #[inline(always)]
    fn push<L: Lanes>(&mut self, met: &Met<L>, memory: &Memory, is_ordered: bool) {
        let first = self.size;
        let mut children = met.children();
        while let Some(next) = children.next() {
            memory.prefetch::<L>(next.child);
            let mut place = self.size;
            if is_ordered {
                while first < place && self.boxes[place - 1].entry < next.entry {
                    self.boxes[place] = self.boxes[place - 1];
                    place -= 1;
                }
            }
            self.boxes[place] = next;
            self.size += 1;
        }
    }
}

/// Shows `visitor` every block whose box a ray of the packet enters before its limit.
#[inline(always)]
pub fn along_packet<L: Lanes, V: PacketVisitor<L>>(
    tree: &V::Tree,
    packet: &Packet<L::Wide>,
    stack: &mut PacketStack,
    visitor: &mut V,
) {
    let memory = Memory::new(tree);
    let mut limit = packet.frustum.limit(&packet.wide, visitor.limits());
    let mut is_limit_old = false;
    stack.start::<L>(packet, limit);
    while let Some(next) = stack.pop() {
        if V::IS_ORDERED && limit < next.entry {
            continue;
        }
        let lanes = packet.passing(&next, visitor.limits());
        if lanes == 0 {
            continue;
        }
        match Child::unpack(next.child) {
            Child::Node(node_idx) => {
                // Not after each block: so it took a tenth of the time of dense clouds.
                if is_limit_old {
                    limit = packet.frustum.limit(&packet.wide, visitor.limits());
                    is_limit_old = false;
                }
                let is_asked = stack.asked == Some(next.child);
                stack.ask_ahead::<L>(tree.nodes(), &memory, limit);
                let node = &tree.nodes()[node_idx as usize];
                let met = Met::<L>::new(node, &packet.frustum, limit);
                if 0.0 < V::FEW_RAYS
                    && node.has_only_blocks()
                    && stack.density.is_below(V::FEW_RAYS)
                {
                    // Before it is known which rays enter: until then the memory is on its way.
                    if !is_asked {
                        memory.prefetch_children::<L>(node, met.lanes);
                    }
                    let density = &mut stack.density;
                    sparse::show_each::<L, V>(tree, &met, packet, lanes, density, visitor);
                    is_limit_old = true;
                } else {
                    stack.push(&met, &memory, V::IS_ORDERED);
                }
            }
            Child::Block(block_idx) => {
                if lanes.is_power_of_two() {
                    visitor.visit_alone(tree, block_idx, lanes.trailing_zeros() as usize);
                } else {
                    visitor.visit(tree, block_idx);
                }
                if 0.0 < V::FEW_RAYS {
                    stack.density.add(lanes.count_ones(), 1);
                }
                if V::IS_ORDERED {
                    is_limit_old = true;
                    continue;
                }
                limit = packet.frustum.limit(&packet.wide, visitor.limits());
                if limit == f32::NEG_INFINITY {
                    return;
                }
            }
        }
    }
}
