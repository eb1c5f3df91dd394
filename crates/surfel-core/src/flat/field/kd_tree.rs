//! A kd-tree over the field of weighted planes, whose leaves list the points that have weight in them.

use crate::math::Aabb;

/// Maximum number of nodes above a leaf.
pub const MAX_KD_DEPTH: usize = 96;
/// Maximum size of the tree in bytes for each point. Leaves grow where the tree would exceed it.
pub const MAX_BYTES_PER_POINT: usize = 96;

/// A kd-tree. Leaves in which the field has no zero are empty.
#[derive(Clone, Debug, Default)]
pub struct FieldTree {
    /// The box of the root.
    pub(super) bounds: Option<Aabb>,
    /// Nodes, the root first. The two children of a node are neighbours.
    pub(super) nodes: Vec<KdNode>,
    /// For each leaf the index of its first entry, and the number of entries at the end.
    pub(super) leaf_starts: Vec<u32>,
    /// For each entry a block of the points' tree.
    pub(super) blocks: Vec<u32>,
    /// For each entry the lanes of the points that have weight in the leaf.
    pub(super) lanes: Vec<u8>,
    /// For each entry the lanes of the points whose normal is turned around.
    pub(super) flips: Vec<u8>,
}

/// A node: a plane between two children, or a leaf.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KdNode {
    /// Coordinate of the plane.
    split: f32,
    /// The axis in the two low bits, 3 for a leaf, and above them the index of the first child, or the leaf's plus one.
    data: u32,
}

/// The content of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KdChild {
    /// A leaf without a zero of the field.
    Empty,
    /// The index of a leaf.
    Leaf(u32),
    /// A plane between two nodes.
    Split {
        /// Axis of the plane's normal.
        axis: usize,
        /// Coordinate of the plane.
        at: f32,
        /// Index of the node below the plane; that of the node above follows.
        first_child: u32,
    },
}

impl KdNode {
    pub(super) const EMPTY: Self = Self { split: 0.0, data: 3 };

    pub(super) fn leaf(leaf_idx: u32) -> Self {
        Self { split: 0.0, data: (leaf_idx + 1) << 2 | 3 }
    }

    pub(super) fn plane(axis: usize, at: f32, first_child: u32) -> Self {
        Self { split: at, data: first_child << 2 | axis as u32 }
    }

    /// Returns the content of the node.
    #[inline(always)]
    pub fn decode(&self) -> KdChild {
        match (self.data & 3, self.data >> 2) {
            (3, 0) => KdChild::Empty,
            (3, leaf) => KdChild::Leaf(leaf - 1),
            (axis, first_child) => {
                KdChild::Split { axis: axis as usize, at: self.split, first_child }
            }
        }
    }
}

/// The points that have weight in a leaf, as blocks of the points' tree and lanes of these.
#[derive(Clone, Copy, Debug)]
pub struct FieldLeaf<'t> {
    /// Indices of blocks.
    pub blocks: &'t [u32],
    /// The lanes that count of each block.
    pub lanes: &'t [u8],
    /// The lanes of each block whose normals are turned around.
    pub flips: &'t [u8],
}

impl FieldTree {
    /// Returns the box that contains all of the surface, or none if there is no surface.
    pub fn bounds(&self) -> Option<Aabb> {
        self.bounds
    }

    /// Returns the node at an index.
    #[inline(always)]
    pub fn node(&self, node_idx: u32) -> KdChild {
        self.nodes[node_idx as usize].decode()
    }

    /// Returns the leaf at an index.
    #[inline(always)]
    pub fn leaf(&self, leaf_idx: u32) -> FieldLeaf<'_> {
        let leaf_idx = leaf_idx as usize;
        let entries = self.leaf_starts[leaf_idx] as usize..self.leaf_starts[leaf_idx + 1] as usize;
        FieldLeaf {
            blocks: &self.blocks[entries.clone()],
            lanes: &self.lanes[entries.clone()],
            flips: &self.flips[entries],
        }
    }

    /// Returns the two words of each node, the root first: the bits of the coordinate of the plane between its children, and
    /// the plane's axis (3 for a leaf) in the two low bits, above which is the index of the first child, or of the leaf plus
    /// one, 0 if that is empty.
    pub fn node_words(&self) -> impl Iterator<Item = [u32; 2]> {
        self.nodes.iter().map(|node| [node.split.to_bits(), node.data])
    }

    /// Returns for each leaf the index of its first entry, and the number of entries at the end.
    pub fn leaf_starts(&self) -> &[u32] {
        &self.leaf_starts
    }

    /// Returns the entries of all leaves.
    pub fn entries(&self) -> FieldLeaf<'_> {
        FieldLeaf { blocks: &self.blocks, lanes: &self.lanes, flips: &self.flips }
    }

    /// Returns the number of leaves that are not empty.
    pub fn n_leaves(&self) -> usize {
        self.leaf_starts.len().saturating_sub(1)
    }

    /// Returns the number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.leaf_starts.as_slice())
            + size_of_val(self.blocks.as_slice())
            + self.lanes.len()
            + self.flips.len()
    }
}
