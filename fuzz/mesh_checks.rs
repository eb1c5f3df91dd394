//! Invariants of every mesh that a reader returns.

use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Geometry, Graph};
use surfel_formats::{LoadOptions, inspect_bytes, load_bytes, load_graph_bytes};

/// Reads the header of `bytes`, and all as a graph and as a point cloud, whole and salvaged, and checks each.
#[allow(dead_code, reason = "the mtl target loads its own file")]
pub fn check_file(name: &str, bytes: &[u8]) {
    let _ = inspect_bytes(name, bytes);
    for salvage in [false, true] {
        let options = LoadOptions { salvage, ..LoadOptions::default() };
        if let Ok((graph, source)) = load_graph_bytes(name, bytes, &options, &NoProgress) {
            let n_triangles = check_graph(&graph);
            assert!(n_triangles <= bytes.len());
            // Points are left of a mesh whose vertices are not whole.
            let is_stated = |n: u64| n == n_triangles as u64 || salvage && n_triangles == 0;
            assert!(source.n_triangles.is_none_or(is_stated));
        }
        if let Ok(loaded) = load_bytes(name, bytes, &options, &NoProgress) {
            assert!(loaded.cloud.len() <= bytes.len());
        }
    }
}

/// Checks the geometry of a graph and returns the number of triangles.
pub fn check_graph(graph: &Graph<PointCloud>) -> usize {
    let mut n_triangles = 0;
    for geometry in &graph.geometries {
        let Geometry::Triangles(mesh) = geometry else { continue };
        assert!(!mesh.triangles.is_empty());
        n_triangles += mesh.triangles.len();
        for vertex in mesh.triangles.as_flattened().iter().map(|vertex| *vertex as usize) {
            assert!(mesh.positions[vertex].is_finite());
            assert!(mesh.normals.iter().all(|normals| normals[vertex].is_normalized()));
        }
        let n_vertices = mesh.positions.len();
        assert!(mesh.normals.iter().all(|column| column.len() == n_vertices));
        assert!(mesh.colors.iter().all(|column| column.len() == n_vertices));
        assert!(mesh.uvs.iter().flatten().all(|column| column.len() == n_vertices));
    }
    for part in graph.nodes.iter().flat_map(|node| &node.primitives) {
        assert!(part.geometry < graph.geometries.len() && part.material < graph.materials.len());
    }
    n_triangles
}
