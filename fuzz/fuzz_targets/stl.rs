//! Any bytes as STL, and behind a header that fits their length.
#![no_main]

#[path = "../triangles.rs"]
mod triangles;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    triangles::read("fuzz.stl", bytes);
    let n_triangles = (bytes.len() / 50) as u32;
    let header = [b"solid".as_slice(), &[b' '; 75], &n_triangles.to_le_bytes()];
    triangles::read("fuzz.stl", &[&header.concat(), bytes].concat());
});
