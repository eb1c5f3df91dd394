//! Fuzzes the PCD reader.
#![no_main]

#[path = "../load_checks.rs"]
mod load_checks;

use libfuzzer_sys::fuzz_target;
use surfel_formats::LoadOptions;

fuzz_target!(|bytes: &[u8]| {
    // Three compressed bytes can repeat 264, and a point has at least three.
    load_checks::check_load("fuzz.pcd", bytes, &LoadOptions::default(), 88 * bytes.len());
});
