//! Fuzzes the glTF reader: each graph that it returns must be valid.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel_core::progress::NoProgress;
use surfel_core::scene::Geometry;
use surfel_formats::load_gltf_bytes;

fuzz_target!(|bytes: &[u8]| {
    if let Ok((graph, _)) = load_gltf_bytes("fuzz.glb", bytes, &NoProgress) {
        graph.validate();
        let n_vertices = graph.geometries.iter().map(|geometry| match geometry {
            Geometry::Points(cloud) => cloud.len(),
            Geometry::Triangles(mesh) => mesh.positions.len(),
        });
        // The memory budget of the reader: a constant and a multiple of the file size.
        assert!(12 * n_vertices.sum::<usize>() <= (64 << 20) + 64 * bytes.len());
    }
});
