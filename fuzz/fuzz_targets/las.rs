//! Any bytes as LAS or LAZ, all columns and a few.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surfel::progress::Silent;
use surfel_formats::{Column, ColumnChoice, LoadOptions, load_bytes};

fuzz_target!(init: let_the_decoder_panic(), |bytes: &[u8]| {
    let columns = ColumnChoice::Only(vec![Column::Intensity, Column::Scalar("gps_time".into())]);
    let few = LoadOptions { columns, ..LoadOptions::default() };
    for options in [&LoadOptions::default(), &few] {
        if let Ok(loaded) = load_bytes("fuzz.laz", bytes, options, &Silent) {
            // An arithmetic coder can put some thousand points in a byte.
            assert!(loaded.cloud.len() <= 2048 * bytes.len());
        }
    }
});

/// The reader catches the panics of the decoder for LAZ; all others end the fuzzer as they should.
fn let_the_decoder_panic() {
    let end = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let is_decoder = panic.location().is_some_and(|place| place.file().contains("/laz-"));
        if !is_decoder {
            end(panic);
        }
    }));
}
