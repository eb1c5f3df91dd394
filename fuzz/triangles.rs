//! What must hold of every mesh that could be read.

use surfel::progress::Silent;
use surfel::scene::{Geometry, Graph};
use surfel_formats::{LoadOptions, load_bytes, load_graph_bytes};

/// Reads `bytes` as a graph and as points.
#[allow(dead_code, reason = "materials are read in a way of their own")]
pub fn read(name: &str, bytes: &[u8]) {
    let options = LoadOptions::default();
    if let Ok((graph, source)) = load_graph_bytes(name, bytes, &options, &Silent) {
        let n_triangles = check(&graph);
        assert!(n_triangles <= bytes.len());
        assert!(source.n_triangles.is_none_or(|n| n == n_triangles as u64));
    }
    if let Ok(loaded) = load_bytes(name, bytes, &options, &Silent) {
        assert!(loaded.cloud.len() <= bytes.len());
    }
}

/// Returns the number of triangles.
pub fn check(graph: &Graph) -> usize {
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
    for part in graph.nodes.iter().flat_map(|node| &node.parts) {
        assert!(part.geometry < graph.geometries.len() && part.material < graph.materials.len());
    }
    n_triangles
}
