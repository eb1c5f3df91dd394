//! Fuzzes the E57 reader, with the bytes as they are, with valid checksums and length, and as the front of a longer file.
#![no_main]

#[path = "../load_checks.rs"]
mod load_checks;

use libfuzzer_sys::fuzz_target;
use surfel_formats::LoadOptions;

const PAGE_LENGTH: usize = 1024;

fuzz_target!(|bytes: &[u8]| {
    for bytes in [bytes.to_vec(), repaired(bytes, 0), repaired(bytes, 1)] {
        // A point has at least one bit; of each scan without any, one can be there.
        load_checks::check_load("fuzz.e57", &bytes, &LoadOptions::default(), 8 * bytes.len() + 1);
    }
});

/// Returns whole pages that begin like a valid file with `n_lost` more pages and have valid checksums.
fn repaired(bytes: &[u8], n_lost: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes.resize(bytes.len().max(1).next_multiple_of(PAGE_LENGTH), 0);
    let length = (bytes.len() + n_lost * PAGE_LENGTH) as u64;
    bytes[..16].copy_from_slice(b"ASTM-E57\x01\0\0\0\0\0\0\0");
    bytes[16..24].copy_from_slice(&length.to_le_bytes());
    bytes[40..48].copy_from_slice(&(PAGE_LENGTH as u64).to_le_bytes());
    for page in bytes.chunks_exact_mut(PAGE_LENGTH) {
        let checksum = crc32c::crc32c(&page[..PAGE_LENGTH - 4]).to_be_bytes();
        page[PAGE_LENGTH - 4..].copy_from_slice(&checksum);
    }
    bytes
}
