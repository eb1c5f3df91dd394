//! Fuzzes the text reader with and without stated columns, and the OBJ reader for points.
#![no_main]

#[path = "../load_checks.rs"]
mod load_checks;

use libfuzzer_sys::fuzz_target;
use surfel_formats::{LoadOptions, TextColumn};

fuzz_target!(|bytes: &[u8]| {
    let columns = Some(TextColumn::parse_list("x,y,z,-,class,r,g,b"));
    let stated = LoadOptions { text_columns: columns, ..LoadOptions::default() };
    for (name, options) in
        [("fuzz.xyz", &LoadOptions::default()), ("fuzz.csv", &stated), ("fuzz.obj", &stated)]
    {
        load_checks::check_load(name, bytes, options, bytes.len());
    }
});
