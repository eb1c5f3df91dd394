//! Any bytes as OBJ, and behind a few vertices.
#![no_main]

#[path = "../triangles.rs"]
mod triangles;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    triangles::read("fuzz.obj", bytes);
    let vertices = b"v 0 0 0\nv 1 0 0 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\n";
    triangles::read("fuzz.obj", &[vertices, bytes].concat());
});
