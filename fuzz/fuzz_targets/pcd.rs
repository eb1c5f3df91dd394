//! Fuzzes the PCD reader.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, load_bytes};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(loaded) = load_bytes("fuzz.pcd", bytes, &LoadOptions::default(), &NoProgress) {
        // Three compressed bytes can repeat 264, and a point has at least three.
        assert!(loaded.cloud.len() <= 88 * bytes.len());
    }
});
