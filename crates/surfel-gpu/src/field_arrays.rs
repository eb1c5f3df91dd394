//! The structures of surfaces that are zeros of a field, as vectors of four words behind the nodes of the points' tree.

use surfel_core::flat::{CellCorners, CellPlane, FieldTree, FlatCloud, Octree, OctreeNode};
use surfel_core::math::{Aabb, Vec3};
use surfel_core::surface::SurfaceKind;

/// Four words.
type Vector = [u32; 4];

/// Vectors before the nodes of an octree: the cube, and the offset of the cells.
pub const OCTREE_HEAD_VECTORS: usize = 2;
/// Vectors of a cell that holds a plane.
pub const PLANE_VECTORS: usize = 2;
/// Vectors of a cell that holds the field at its corners.
pub const CORNER_CELL_VECTORS: usize = 3;
/// Vectors before the nodes of a kd-tree: the box, and the offsets of what follows the nodes.
pub const KD_HEAD_VECTORS: usize = 3;

/// Returns the structure of a cloud's surface; nothing if it has none beside the points' tree.
pub fn structure(cloud: &FlatCloud) -> Vec<Vector> {
    match cloud.surface {
        SurfaceKind::Octree | SurfaceKind::OctreeSplat => octree(&cloud.octree),
        SurfaceKind::Implicit => kd_tree(&cloud.field),
        _ => Vec::new(),
    }
}

/// Returns the number of vectors of the structure.
pub fn structure_vectors(cloud: &FlatCloud) -> usize {
    match cloud.surface {
        SurfaceKind::Octree | SurfaceKind::OctreeSplat => {
            let octree = &cloud.octree;
            let n_cell_vectors = PLANE_VECTORS * octree.planes().len()
                + CORNER_CELL_VECTORS * octree.all_corners().len();
            OCTREE_HEAD_VECTORS + octree.nodes().len() + n_cell_vectors
        }
        SurfaceKind::Implicit => {
            let tree = &cloud.field;
            let (n_leaf_starts, n_entries) =
                (tree.leaf_starts().len(), tree.entries().blocks.len());
            let words = [2 * tree.n_nodes(), n_leaf_starts, 2 * n_entries];
            KD_HEAD_VECTORS + words.map(|n| n.div_ceil(4)).iter().sum::<usize>()
        }
        _ => 0,
    }
}

fn octree(octree: &Octree) -> Vec<Vector> {
    let first_cell = (OCTREE_HEAD_VECTORS + octree.nodes().len()) as u32;
    let cube = octree.cube().unwrap_or(Aabb { min: Vec3::ZERO, max: Vec3::ZERO });
    let mut vectors = vec![corner(&cube, cube.size().x), [first_cell, 0, 0, 0]];
    vectors.extend(octree.nodes().iter().map(node));
    vectors.extend(octree.planes().iter().flat_map(plane));
    vectors.extend(octree.all_corners().iter().flat_map(corners));
    vectors
}

/// Returns the lower corner of a box, and another number.
fn corner(bounds: &Aabb, last: f32) -> Vector {
    bounds.min.extend(last).to_array().map(f32::to_bits)
}

fn node(node: &OctreeNode) -> Vector {
    let OctreeNode { first_child, cell, children, is_finest } = *node;
    [first_child, cell, u32::from(children) | u32::from(is_finest) << 8, 0]
}

fn plane(plane: &CellPlane) -> [Vector; PLANE_VECTORS] {
    let words = plane.normal.extend(plane.height).to_array().map(f32::to_bits);
    [words, [plane.slot, 0, 0, 0]]
}

fn corners(corners: &CellCorners) -> [Vector; CORNER_CELL_VECTORS] {
    let values = bytemuck::cast(corners.values);
    let normals: [u32; 6] = bytemuck::cast(corners.normals);
    let [a, b, c, d, e, f] = normals;
    [values, [a, b, c, d], [e, f, corners.slot, 0]]
}

fn kd_tree(tree: &FieldTree) -> Vec<Vector> {
    let entries = tree.entries();
    let entry = |i: usize| {
        let lanes = u32::from(entries.lanes[i]) | u32::from(entries.flips[i]) << 8;
        [entries.blocks[i], lanes]
    };
    let nodes = vectors(tree.node_words().flatten().collect());
    let leaf_starts = vectors(tree.leaf_starts().to_vec());
    let entries = vectors((0..entries.blocks.len()).flat_map(entry).collect());
    let first_leaf = KD_HEAD_VECTORS + nodes.len();
    let first_entry = first_leaf + leaf_starts.len();
    // A box without an inside contains no surface.
    let nothing = Aabb { min: Vec3::splat(1.0), max: Vec3::splat(-1.0) };
    let bounds = tree.bounds().unwrap_or(nothing);
    let upper = bounds.max.extend(0.0).to_array().map(f32::to_bits);
    let head = [corner(&bounds, 0.0), upper, [first_leaf as u32, first_entry as u32, 0, 0]];
    head.into_iter().chain(nodes).chain(leaf_starts).chain(entries).collect()
}

/// Returns words as vectors; the last one ends with zeros.
fn vectors(mut words: Vec<u32>) -> Vec<Vector> {
    words.resize(words.len().next_multiple_of(4), 0);
    words.chunks_exact(4).map(|words| [words[0], words[1], words[2], words[3]]).collect()
}

#[cfg(test)]
mod tests {
    //! The size of a structure is known before it is made.

    use super::*;
    use crate::test_support::scene_of_points;
    use surfel_core::flat::FlatGeometry;

    #[test]
    fn the_size_of_a_structure_is_known_before_it_is_made() {
        use SurfaceKind::{Implicit, Octree, OctreeSplat, Splat};
        for kind in [Implicit, Octree, OctreeSplat, Splat] {
            let scene = scene_of_points(kind);
            let FlatGeometry::Cloud(cloud) = &*scene.geometries[0] else { panic!() };
            let n_vectors = structure_vectors(cloud);
            assert_eq!(structure(cloud).len(), n_vectors, "{}", kind.name());
            assert_eq!(0 < n_vectors, kind != Splat);
        }
    }
}
