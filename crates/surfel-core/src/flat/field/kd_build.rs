//! Construction of the kd-tree: cells are halved, empty space is cut off, and cells without a zero are dropped.

use super::kd_tree::{FieldTree, KdNode, MAX_BYTES_PER_POINT, MAX_KD_DEPTH};
use super::points::{CellPoints, FieldPoints};
use crate::error::{Error, Result};
use crate::flat::points::FlatPoints;
use crate::math::{Aabb, LANES};
use crate::progress::Progress;

/// Maximum length of a leaf's sides, in mean supports of its points. Measured on the bunny and the ruin: smaller leaves
/// have fewer points, but rays visit more of them.
const MAX_LEAF_SIZE: f32 = 0.8;
/// Minimum fraction of a cell that is cut off as empty space.
const MIN_EMPTY_FRACTION: f32 = 0.2;
/// Minimum number of points of a cell whose children are built in parallel.
const MIN_PARALLEL: usize = 4096;
/// Bytes of the two nodes below a plane.
const SPLIT_BYTES: usize = 2 * size_of::<KdNode>();

impl FieldTree {
    /// Builds the tree over the field of points. `has_sides` is true if all normals point to the same side of the
    /// surface; if not, those of each leaf are turned to the side of one of them.
    ///
    /// The result does not depend on the number of threads, and takes at most `MAX_BYTES_PER_POINT` bytes a point.
    ///
    /// # Errors
    ///
    /// Fails if `progress` is cancelled, or if there are more entries than 30-bit indices.
    pub fn new(points: &FlatPoints, has_sides: bool, progress: &dyn Progress) -> Result<Self> {
        let field = FieldPoints::new(points, has_sides);
        let all = field.all();
        if all.is_empty() || !all.bounds.size().is_finite() {
            return Ok(Self::default());
        }
        progress.begin("build field", all.slots.len() as u64);
        let cell = all.bounds;
        let budget = (MAX_BYTES_PER_POINT * all.slots.len()).max(leaf_bytes(&all));
        let builder = Builder { field: &field, progress };
        let root = builder.subtree(cell, all, budget, 0);
        progress.check()?;
        let mut tree = Self { bounds: Some(cell), nodes: vec![KdNode::EMPTY], ..Self::default() };
        tree.leaf_starts.push(0);
        tree.add(0, root)?;
        if tree.n_leaves() == 0 {
            return Ok(Self::default());
        }
        Ok(tree)
    }

    fn add(&mut self, node_idx: usize, subtree: Subtree) -> Result<()> {
        match subtree {
            Subtree::Empty => {}
            Subtree::Leaf(entries) => {
                self.nodes[node_idx] = KdNode::leaf(self.n_leaves() as u32);
                for Entry { block, lanes, flips } in entries {
                    self.blocks.push(block);
                    self.lanes.push(lanes);
                    self.flips.push(flips);
                }
                self.leaf_starts.push(self.blocks.len() as u32);
            }
            Subtree::Split { axis, at, children } => {
                let first_child = self.nodes.len();
                if 1 << 30 <= first_child.max(self.blocks.len()) {
                    return Err(Error::TooManyBlocks { found: self.blocks.len(), limit: 1 << 30 });
                }
                self.nodes[node_idx] = KdNode::plane(axis, at, first_child as u32);
                self.nodes.extend([KdNode::EMPTY; 2]);
                let [below, above] = *children;
                self.add(first_child, below)?;
                self.add(first_child + 1, above)?;
            }
        }
        Ok(())
    }
}

/// A part of the tree before it is laid out.
enum Subtree {
    Empty,
    Leaf(Vec<Entry>),
    Split { axis: usize, at: f32, children: Box<[Subtree; 2]> },
}

/// The points of a leaf in one block.
struct Entry {
    block: u32,
    lanes: u8,
    flips: u8,
}

struct Builder<'a> {
    field: &'a FieldPoints,
    progress: &'a dyn Progress,
}

impl Builder<'_> {
    /// Builds the tree below a cell. It takes at most `budget` bytes, which suffice for a leaf.
    fn subtree(&self, cell: Aabb, points: CellPoints, budget: usize, depth: usize) -> Subtree {
        if points.is_empty() || !self.may_have_zero(&points, &cell) {
            return Subtree::Empty;
        }
        let is_small = cell.size().max_element() <= MAX_LEAF_SIZE * points.mean_support();
        if is_small || depth == MAX_KD_DEPTH || self.progress.is_cancelled() {
            return self.leaf(&cell, &points);
        }
        let (axis, at) = plane(&cell, &points);
        let [mut below, mut above] = [cell; 2];
        (below.max[axis], above.min[axis]) = (at, at);
        let parts = [&below, &above].map(|part| self.field.within(&points, part));
        let bytes = parts.each_ref().map(leaf_bytes);
        let [bytes_below, bytes_above] = bytes;
        let needed = SPLIT_BYTES + bytes_below + bytes_above;
        let is_between = cell.min[axis] < at && at < cell.max[axis];
        if budget < needed || !is_between {
            return self.leaf(&cell, &points);
        }
        let is_parallel = MIN_PARALLEL <= points.slots.len();
        drop(points);
        let spare = (budget - needed) as u128;
        let budget_of = |part: usize| {
            part + (spare * part as u128 / (bytes_below + bytes_above) as u128) as usize
        };
        let [points_below, points_above] = parts;
        let build_below = || self.subtree(below, points_below, budget_of(bytes_below), depth + 1);
        let build_above = || self.subtree(above, points_above, budget_of(bytes_above), depth + 1);
        let children = match is_parallel {
            true => rayon::join(build_below, build_above),
            false => (build_below(), build_above()),
        };
        if let (Subtree::Empty, Subtree::Empty) = children {
            return Subtree::Empty;
        }
        Subtree::Split { axis, at, children: Box::new([children.0, children.1]) }
    }

    /// Returns false if the field surely has no zero in a cell and in none of its parts.
    fn may_have_zero(&self, points: &CellPoints, cell: &Aabb) -> bool {
        if !self.field.agree(points) {
            return true;
        }
        let flips = self.field.flips(points, cell);
        let (low, high) = self.field.range(points, &flips, cell);
        low <= 0.0 && 0.0 <= high
    }

    fn leaf(&self, cell: &Aabb, points: &CellPoints) -> Subtree {
        let flips = self.field.flips(points, cell);
        let (low, high) = self.field.range(points, &flips, cell);
        if 0.0 < low || high < 0.0 {
            return Subtree::Empty;
        }
        let mut entries: Vec<Entry> = Vec::with_capacity(points.n_blocks());
        for (slot, is_flipped) in points.slots.iter().zip(flips) {
            let (block, lane) = (slot / LANES as u32, slot % LANES as u32);
            if entries.last().is_none_or(|last| last.block != block) {
                entries.push(Entry { block, lanes: 0, flips: 0 });
            }
            if let Some(entry) = entries.last_mut() {
                entry.lanes |= 1 << lane;
                entry.flips |= u8::from(is_flipped) << lane;
            }
        }
        Subtree::Leaf(entries)
    }
}

/// Returns the bytes that a leaf of these points takes with its node.
fn leaf_bytes(points: &CellPoints) -> usize {
    size_of::<KdNode>() + size_of::<u32>() + points.n_blocks() * (size_of::<u32>() + 2)
}

/// Returns the plane that cuts off the widest empty space, if that is wide enough, or else halves the longest side.
fn plane(cell: &Aabb, points: &CellPoints) -> (usize, f32) {
    let (size, margin) = (cell.size(), 2.0 * points.margin());
    let bounds = Aabb { min: points.bounds.min - margin, max: points.bounds.max + margin };
    let mut widest = (MIN_EMPTY_FRACTION, None);
    for axis in 0..3 {
        let below = (bounds.min[axis] - cell.min[axis]) / size.max_element();
        let above = (cell.max[axis] - bounds.max[axis]) / size.max_element();
        for (empty, at) in [(below, bounds.min[axis]), (above, bounds.max[axis])] {
            if widest.0 < empty {
                widest = (empty, Some((axis, at)));
            }
        }
    }
    let longest = cell.longest_axis();
    widest.1.unwrap_or((longest, 0.5 * (cell.min[longest] + cell.max[longest])))
}
