//! Any bytes behind the magic of PLY, as points and as triangles.
#![no_main]

#[path = "../triangles.rs"]
mod triangles;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| triangles::read("fuzz.ply", bytes));
