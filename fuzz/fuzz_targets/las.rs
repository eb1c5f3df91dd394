//! Fuzzes the LAS and LAZ reader with all columns and with a selection.
#![no_main]

#[path = "../load_checks.rs"]
mod load_checks;
#[path = "../panic_hook.rs"]
mod panic_hook;

use libfuzzer_sys::fuzz_target;
use panic_hook::ignore_decoder_panics;
use surfel_formats::{Column, ColumnChoice, LoadOptions};

fuzz_target!(init: ignore_decoder_panics("laz-"), |bytes: &[u8]| {
    let columns = ColumnChoice::Only(vec![Column::Intensity, Column::Scalar("gps_time".into())]);
    let selection = LoadOptions { columns, ..LoadOptions::default() };
    for options in [&LoadOptions::default(), &selection] {
        // An arithmetic coder can encode more than a thousand points per byte.
        load_checks::check_load("fuzz.laz", bytes, options, 2048 * bytes.len());
    }
});
