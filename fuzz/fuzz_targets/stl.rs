//! Fuzzes the STL reader with the bytes alone and after a binary header that fits their length.
#![no_main]

#[path = "../mesh_checks.rs"]
mod mesh_checks;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    mesh_checks::check_file("fuzz.stl", bytes);
    let n_triangles = (bytes.len() / 50) as u32;
    let header = [b"solid".as_slice(), &[b' '; 75], &n_triangles.to_le_bytes()];
    mesh_checks::check_file("fuzz.stl", &[&header.concat(), bytes].concat());
});
