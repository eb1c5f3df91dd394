//! Fuzzes the BIN reader with all columns and with positions only.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel_core::progress::NoProgress;
use surfel_formats::{ColumnChoice, LoadOptions, load_bytes};

fuzz_target!(|bytes: &[u8]| {
    let positions_only =
        LoadOptions { columns: ColumnChoice::Only(vec![]), ..LoadOptions::default() };
    for options in [&LoadOptions::default(), &positions_only] {
        if let Ok(loaded) = load_bytes("fuzz.bin", bytes, options, &NoProgress) {
            assert!(loaded.cloud.len() <= bytes.len());
        }
    }
});
