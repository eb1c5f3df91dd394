//! Any bytes as bare records, all columns and positions alone.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel::progress::Silent;
use surfel_formats::{ColumnChoice, LoadOptions, load_bytes};

fuzz_target!(|bytes: &[u8]| {
    let bare = LoadOptions { columns: ColumnChoice::Only(vec![]), ..LoadOptions::default() };
    for options in [&LoadOptions::default(), &bare] {
        if let Ok(loaded) = load_bytes("fuzz.bin", bytes, options, &Silent) {
            assert!(loaded.cloud.len() <= bytes.len());
        }
    }
});
