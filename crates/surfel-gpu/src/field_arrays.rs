//! The structures of surfaces that are zeros of a field, as vectors of four words behind the nodes of the points' tree.

use crate::numbers::VECTOR_BYTES;
use crate::payload::PayloadPart;
use std::sync::OnceLock;
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
pub fn structure(cloud: &FlatCloud) -> Vec<PayloadPart<'_>> {
    match cloud.surface {
        SurfaceKind::Octree | SurfaceKind::OctreeSplat => octree(&cloud.octree),
        SurfaceKind::Implicit => kd_tree(&cloud.field),
        _ => Vec::new(),
    }
}

fn octree(octree: &Octree) -> Vec<PayloadPart<'_>> {
    let (nodes, planes, all_corners) = (octree.nodes(), octree.planes(), octree.all_corners());
    let first_cell = (OCTREE_HEAD_VECTORS + nodes.len()) as u32;
    let cube = octree.cube().unwrap_or(Aabb { min: Vec3::ZERO, max: Vec3::ZERO });
    let head: [Vector; OCTREE_HEAD_VECTORS] = [corner(&cube, cube.size().x), [first_cell, 0, 0, 0]];
    vec![
        PayloadPart::records(1, move |_| head),
        PayloadPart::records(nodes.len(), move |i| node(&nodes[i])),
        PayloadPart::records(planes.len(), move |i| plane(&planes[i])),
        PayloadPart::records(all_corners.len(), move |i| corners(&all_corners[i])),
    ]
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

fn kd_tree(tree: &FieldTree) -> Vec<PayloadPart<'_>> {
    let (n_nodes, leaf_starts, entries) = (tree.n_nodes(), tree.leaf_starts(), tree.entries());
    let n_entries = entries.blocks.len();
    let first_leaf = KD_HEAD_VECTORS + n_vectors(2 * n_nodes);
    let first_entry = first_leaf + n_vectors(leaf_starts.len());
    // A box without an inside contains no surface.
    let nothing = Aabb { min: Vec3::splat(1.0), max: Vec3::splat(-1.0) };
    let bounds = tree.bounds().unwrap_or(nothing);
    let upper = bounds.max.extend(0.0).to_array().map(f32::to_bits);
    let head: [Vector; KD_HEAD_VECTORS] =
        [corner(&bounds, 0.0), upper, [first_leaf as u32, first_entry as u32, 0, 0]];
    // The tree has no list of them. They are far fewer than the entries.
    let nodes = OnceLock::new();
    let node = move |i: usize| -> [u32; 2] {
        nodes.get_or_init(|| tree.node_words().collect::<Vec<_>>())[i]
    };
    let entry = move |i: usize| {
        let lanes = u32::from(entries.lanes[i]) | u32::from(entries.flips[i]) << 8;
        [entries.blocks[i], lanes]
    };
    vec![
        PayloadPart::records(1, move |_| head),
        PayloadPart::records(n_nodes, node),
        padding(2 * n_nodes),
        PayloadPart::Bytes(bytemuck::cast_slice(leaf_starts)),
        padding(leaf_starts.len()),
        PayloadPart::records(n_entries, entry),
        padding(2 * n_entries),
    ]
}

/// Returns the number of vectors of four words that `n_words` take.
fn n_vectors(n_words: usize) -> usize {
    n_words.div_ceil(4)
}

/// Returns the zeros behind `n_words` in their last vector.
fn padding<'a>(n_words: usize) -> PayloadPart<'a> {
    const ZEROS: &[u8] = &[0; VECTOR_BYTES];
    PayloadPart::Bytes(&ZEROS[..VECTOR_BYTES * n_vectors(n_words) - 4 * n_words])
}

#[cfg(test)]
mod tests {
    //! Kernels find the parts of a structure where its head says.

    use super::*;
    use crate::payload::{Payload, bytes_of};
    use crate::test_support::scene_of_points;
    use surfel_core::flat::FlatGeometry;

    /// Calls `read` with a cloud of this surface and the vectors of its structure.
    fn with_structure(kind: SurfaceKind, read: impl FnOnce(&FlatCloud, &[Vector])) {
        let scene = scene_of_points(kind);
        let FlatGeometry::Cloud(cloud) = &*scene.geometries[0] else { panic!() };
        let bytes = bytes_of(&Payload(structure(cloud)));
        read(cloud, &bytemuck::pod_collect_to_vec(&bytes));
    }

    #[test]
    fn cells_of_an_octree_begin_where_its_head_says() {
        for kind in [SurfaceKind::Octree, SurfaceKind::OctreeSplat] {
            with_structure(kind, |cloud, vectors| {
                let octree = &cloud.octree;
                assert_eq!(vectors[OCTREE_HEAD_VECTORS], node(&octree.nodes()[0]));
                let cells = &vectors[vectors[1][0] as usize..];
                let (planes, corner_cells) = cells.split_at(PLANE_VECTORS * octree.planes().len());
                let expected: Vec<_> = octree.planes().iter().flat_map(plane).collect();
                assert_eq!(planes, expected);
                let expected: Vec<_> = octree.all_corners().iter().flat_map(corners).collect();
                assert_eq!(corner_cells, expected);
                assert!(!cells.is_empty());
            });
        }
    }

    #[test]
    fn leaves_and_entries_of_a_kd_tree_begin_where_its_head_says() {
        with_structure(SurfaceKind::Implicit, |cloud, vectors| {
            let (tree, words) = (&cloud.field, vectors.as_flattened());
            let [first_leaf, first_entry, ..] = vectors[2].map(|idx| 4 * idx as usize);
            let nodes: Vec<u32> = tree.node_words().flatten().collect();
            assert_eq!(words[4 * KD_HEAD_VECTORS..][..nodes.len()], nodes);
            assert_eq!(words[first_leaf..][..tree.leaf_starts().len()], *tree.leaf_starts());
            let entries = tree.entries();
            for (i, block) in entries.blocks.iter().enumerate() {
                let lanes = u32::from(entries.lanes[i]) + 256 * u32::from(entries.flips[i]);
                assert_eq!(words[first_entry + 2 * i..][..2], [*block, lanes]);
            }
            assert!(!entries.blocks.is_empty());
            assert_eq!(words.len(), (first_entry + 2 * entries.blocks.len()).next_multiple_of(4));
        });
    }

    #[test]
    fn surfaces_without_a_field_have_no_structure() {
        with_structure(SurfaceKind::Splat, |_, vectors| assert!(vectors.is_empty()));
    }
}
