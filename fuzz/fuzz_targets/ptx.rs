//! Fuzzes the PTX reader.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, load_bytes};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(loaded) = load_bytes("fuzz.ptx", bytes, &LoadOptions::default(), &NoProgress) {
        assert!(loaded.cloud.len() <= bytes.len());
    }
});
