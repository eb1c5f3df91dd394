//! Fuzzes the PTX reader.
#![no_main]

#[path = "../load_checks.rs"]
mod load_checks;

use libfuzzer_sys::fuzz_target;
use surfel_formats::LoadOptions;

fuzz_target!(|bytes: &[u8]| {
    load_checks::check_load("fuzz.ptx", bytes, &LoadOptions::default(), bytes.len());
});
