//! Fuzzes the PLY reader for points and for triangles.
#![no_main]

#[path = "../mesh_checks.rs"]
mod mesh_checks;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| mesh_checks::check_file("fuzz.ply", bytes));
