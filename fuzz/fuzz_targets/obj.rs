//! Fuzzes the OBJ reader with the bytes alone and after a few vertices.
#![no_main]

#[path = "../mesh_checks.rs"]
mod mesh_checks;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    mesh_checks::check_file("fuzz.obj", bytes);
    let vertices = b"v 0 0 0\nv 1 0 0 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\n";
    mesh_checks::check_file("fuzz.obj", &[vertices, bytes].concat());
});
