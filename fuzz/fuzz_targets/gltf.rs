//! Any bytes as glTF, and as the JSON of one: what is read is whole.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel::progress::Silent;
use surfel::scene::Geometry;
use surfel_formats::load_gltf_bytes;

fuzz_target!(|bytes: &[u8]| {
    if let Ok((graph, _)) = load_gltf_bytes("fuzz.glb", bytes, &Silent) {
        graph.validate();
        let n_vertices = graph.geometries.iter().map(|geometry| match geometry {
            Geometry::Points(points) => points.cloud.len(),
            Geometry::Triangles(mesh) => mesh.positions.len(),
        });
        // What a file of any size may ask for, and what its bytes allow.
        assert!(12 * n_vertices.sum::<usize>() <= (64 << 20) + 64 * bytes.len());
    }
});
