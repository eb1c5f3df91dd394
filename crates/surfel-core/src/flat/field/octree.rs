//! Octrees whose cells hold the surface themselves: a plane, or the field at their corners (Kashyap, Goradia, Chaudhuri and
//! Chandran, Implicit Surface Octrees for Ray Tracing Point Models, 2010).

use crate::math::{Aabb, Vec3};

/// Maximum depth of an octree.
pub const MAX_OCTREE_DEPTH: usize = 16;
/// Maximum size of an octree in bytes for each point. Deeper levels are left out where it would exceed it.
pub const MAX_OCTREE_BYTES_PER_POINT: usize = 192;

/// An octree over the cube around a cloud.
#[derive(Clone, Debug, Default)]
pub struct Octree {
    /// The cube of the root.
    pub(super) cube: Option<Aabb>,
    /// The depth of the deepest cells.
    pub(super) depth: usize,
    /// Nodes level by level, the root first.
    pub(super) nodes: Vec<OctreeNode>,
    /// Planes of cells, if these hold splats.
    pub(super) planes: Vec<CellPlane>,
    /// Corners of cells, if these hold the field.
    pub(super) corners: Vec<CellCorners>,
}

/// A node of an octree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OctreeNode {
    /// Index of the first child; the others follow in the order of their bits.
    pub first_child: u32,
    /// Index of the node's cell plus one, 0 if it has none.
    pub cell: u32,
    /// A bit for each child that there is. Child 1 lies at greater X, child 2 at greater Y, child 4 at greater Z.
    pub children: u8,
    /// True if the cell is as fine as the points there; children of other nodes refine it.
    pub is_finest: bool,
}

/// A splat that fills a cell: a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPlane {
    /// Unit normal.
    pub normal: Vec3,
    /// Height of the middle of the cell above the plane.
    pub height: f32,
    /// Slot of the point nearest to the middle.
    pub slot: u32,
}

/// The field at the corners of a cell, in the order of children.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellCorners {
    /// Values of the field in steps of `CellCorners::STEP` sides of the cell.
    pub values: [i16; 8],
    /// Normals, 127 long.
    pub normals: [[i8; 3]; 8],
    /// Slot of the point nearest to the middle.
    pub slot: u32,
}

impl CellCorners {
    /// The step of the values in sides of the cell.
    pub const STEP: f32 = 2.0 / 32767.0;
}

impl Octree {
    /// Returns the cube that contains the octree, or none if there is no surface.
    pub fn cube(&self) -> Option<Aabb> {
        self.cube
    }

    /// Returns the depth of the deepest cells.
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Returns the nodes level by level, the root first.
    pub fn nodes(&self) -> &[OctreeNode] {
        &self.nodes
    }

    /// Returns the planes of the cells; none if they hold the field at their corners.
    pub fn planes(&self) -> &[CellPlane] {
        &self.planes
    }

    /// Returns the corners of all cells; none if they hold planes.
    pub fn all_corners(&self) -> &[CellCorners] {
        &self.corners
    }

    /// Returns the node at an index.
    #[inline(always)]
    pub fn node(&self, node_idx: u32) -> &OctreeNode {
        &self.nodes[node_idx as usize]
    }

    /// Returns the plane of a cell.
    #[inline(always)]
    pub fn plane(&self, cell_idx: u32) -> &CellPlane {
        &self.planes[cell_idx as usize]
    }

    /// Returns the corners of a cell.
    #[inline(always)]
    pub fn corners(&self, cell_idx: u32) -> &CellCorners {
        &self.corners[cell_idx as usize]
    }

    /// Returns the number of cells.
    pub fn n_cells(&self) -> usize {
        self.planes.len() + self.corners.len()
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.planes.as_slice())
            + size_of_val(self.corners.as_slice())
    }
}
