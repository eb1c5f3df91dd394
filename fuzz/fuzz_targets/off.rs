//! Fuzzes the OFF reader with the bytes alone and after a header of every kind of vertex.
#![no_main]

#[path = "../mesh_checks.rs"]
mod mesh_checks;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    mesh_checks::check_file("fuzz.off", bytes);
    for header in ["OFF\n", "CNOFF\n4 2 0\n", "STOFF 3 1\n"] {
        mesh_checks::check_file("fuzz.off", &[header.as_bytes(), bytes].concat());
    }
});
