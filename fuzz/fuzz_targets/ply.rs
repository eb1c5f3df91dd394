//! Any bytes behind the magic of PLY.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel::progress::Silent;
use surfel_formats::{LoadOptions, load_bytes};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(loaded) = load_bytes("fuzz.ply", bytes, &LoadOptions::default(), &Silent) {
        assert!(loaded.cloud.len() <= bytes.len());
    }
});
