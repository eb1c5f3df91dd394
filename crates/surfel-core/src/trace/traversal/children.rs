//! The children of nodes whose boxes a packet's frustum overlaps.

use crate::bvh::BvhNode;
use crate::math::{LANES, Lanes, SetBits, set_bits};
use crate::trace::traversal::frustum::{ChildBoxes, Frustum};
use std::borrow::Borrow;

/// A node or block that is still to be visited, with its box in the form of `ChildBoxes`.
#[derive(Clone, Copy)]
pub struct ChildBox {
    /// The packed child.
    pub child: u32,
    /// Distance along the frustum's main axis at which the box begins.
    pub entry: f32,
    /// Lower corner.
    pub min: [f32; 3],
    /// Upper corner.
    pub max: [f32; 3],
}

impl ChildBox {
    /// The root, whose box holds everything.
    pub const ROOT: Self =
        Self { child: 0, entry: 0.0, min: [f32::NEG_INFINITY; 3], max: [f32::INFINITY; 3] };
}

/// Eight children with their boxes.
#[derive(Clone, Copy)]
pub struct ChildRows {
    /// The packed children, as the bits of floats.
    children: [f32; LANES],
    min: [[f32; LANES]; 3],
    max: [[f32; LANES]; 3],
}

impl ChildRows {
    /// Eight empty boxes, which no frustum overlaps.
    pub const NONE: Self = Self {
        children: [0.0; LANES],
        min: [[f32::INFINITY; LANES]; 3],
        max: [[f32::NEG_INFINITY; LANES]; 3],
    };

    /// Puts up to eight children side by side.
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

    /// Iterates over the children whose boxes the frustum overlaps up to `limit` along its main axis.
    #[inline(always)]
    pub fn overlapped_by<L: Lanes>(&self, frustum: &Frustum, limit: f32) -> ChildIter<&Self> {
        let (lanes, entries) = frustum.overlaps::<L>(&self.boxes(), limit);
        ChildIter { rows: self, entries, lanes: set_bits(lanes) }
    }

    #[inline(always)]
    fn boxes<L: Lanes>(&self) -> ChildBoxes<L> {
        let ([a, b, c], [d, e, f]) = (&self.min, &self.max);
        ChildBoxes {
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

/// The children of a node whose boxes a packet's frustum overlaps.
pub struct OverlappedChildren<'n, L> {
    node: &'n BvhNode,
    boxes: ChildBoxes<L>,
    entries: [f32; LANES],
    /// The mask of these children.
    pub lanes: u32,
}

impl<'n, L: Lanes> OverlappedChildren<'n, L> {
    /// Tests the children of `node` against the frustum up to `limit` along its main axis.
    #[inline(always)]
    pub fn new(node: &'n BvhNode, frustum: &Frustum, limit: f32) -> Self {
        let boxes = frustum.child_boxes::<L>(node);
        let (lanes, entries) = frustum.overlaps::<L>(&boxes, limit);
        Self { node, boxes, entries, lanes: lanes & node.occupied_lanes() }
    }

    /// Iterates over the children.
    #[inline(always)]
    pub fn iter(&self) -> ChildIter<ChildRows> {
        let (min, max) = self.boxes.store();
        let children = self.node.packed_children::<L>().store();
        let rows = ChildRows { children, min, max };
        ChildIter { rows, entries: self.entries, lanes: set_bits(self.lanes) }
    }
}

/// An iterator over children.
pub struct ChildIter<R> {
    rows: R,
    entries: [f32; LANES],
    lanes: SetBits<LANES>,
}

impl<R: Borrow<ChildRows>> Iterator for ChildIter<R> {
    type Item = ChildBox;

    #[inline(always)]
    fn next(&mut self) -> Option<ChildBox> {
        let lane = self.lanes.next()?;
        Some(self.rows.borrow().child(lane, self.entries[lane]))
    }
}
