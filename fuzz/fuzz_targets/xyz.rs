//! Fuzzes the text reader with and without stated columns, and the OBJ reader for points.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, TextColumn, load_bytes};

fuzz_target!(|bytes: &[u8]| {
    let columns = Some(TextColumn::parse_list("x,y,z,-,class,r,g,b"));
    let stated = LoadOptions { text_columns: columns, ..LoadOptions::default() };
    for (name, options) in
        [("fuzz.xyz", &LoadOptions::default()), ("fuzz.csv", &stated), ("fuzz.obj", &stated)]
    {
        if let Ok(loaded) = load_bytes(name, bytes, options, &NoProgress) {
            assert!(loaded.cloud.len() <= bytes.len());
        }
    }
});
