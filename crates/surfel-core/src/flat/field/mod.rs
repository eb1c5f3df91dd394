//! Structures over the field of weighted planes: the kd-tree of Wald and Seidel, and the octrees of
//! Kashyap and others.

mod points;
mod kd_tree;
mod kd_build;
mod octree;
mod cube_points;
mod octree_cells;
mod octree_build;

pub use kd_tree::{FieldLeaf, FieldTree, KdChild, MAX_KD_DEPTH};
pub use octree::{CellCorners, CellPlane, MAX_OCTREE_DEPTH, Octree, OctreeNode};
pub use octree_build::OctreeOptions;

use crate::surface::SurfaceKind;

/// Returns the maximum number of bytes for each point that a surface's structure takes beside the points' tree.
pub fn max_field_bytes(kind: SurfaceKind) -> usize {
    match kind {
        SurfaceKind::Implicit => kd_tree::MAX_BYTES_PER_POINT,
        SurfaceKind::Octree | SurfaceKind::OctreeSplat => octree::MAX_OCTREE_BYTES_PER_POINT,
        _ => 0,
    }
}
