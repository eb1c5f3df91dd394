//! Reads compressed points: decompresses all values, which are stored field by field, and orders them point by point.

use rayon::prelude::*;
use surfel_core::progress::Progress;

use super::header::{Header, PcdField};
use super::lzf::{MAX_RATIO, decompress};
use crate::error::{Error, Location, Result};
use crate::file::Input;

/// Number of points that a task orders between two checks for cancellation.
const POINTS_PER_TASK: usize = 1 << 14;

/// Returns the records of a compressed file.
pub(super) fn records(input: &Input, header: &Header, progress: &dyn Progress) -> Result<Vec<u8>> {
    const ADVICE: &str = "copy the file again from its source, or write it again";
    let body = &input[header.body..];
    let sizes = body.split_first_chunk::<4>().and_then(|(compressed, rest)| {
        let (whole, data) = rest.split_first_chunk::<4>()?;
        Some((u32::from_le_bytes(*compressed), u32::from_le_bytes(*whole), data))
    });
    let Some((n_compressed, n_bytes, data)) = sizes else {
        let found = format!("{} bytes after the header", body.len());
        let location = Location::Byte(header.body as u64);
        return Err(input.malformed(location, found, "the sizes of the compressed points", ADVICE));
    };
    let n_points = header.n_points();
    let expected_bytes = u128::from(n_points) * header.stride() as u128;
    if u128::from(n_bytes) != expected_bytes {
        let location = Location::Byte(header.body as u64 + 4);
        let expected = format!("{expected_bytes}, as its fields and points take");
        return Err(input.malformed(location, format!("{n_bytes} bytes"), expected, ADVICE));
    }
    let data = data.get(..n_compressed as usize).ok_or_else(|| {
        let found = format!("the end of the file, so that 0 of {n_points} points are whole");
        let expected = format!(
            "{n_compressed} compressed bytes, which hold all values of a field before those of the next"
        );
        input.malformed(Location::Byte(input.len() as u64), found, expected, ADVICE)
    })?;
    if data.len().saturating_mul(MAX_RATIO) < n_bytes as usize {
        let location = Location::Byte(header.body as u64);
        let expected = format!("at most {} from {} bytes", data.len() * MAX_RATIO, data.len());
        return Err(input.malformed(location, format!("{n_bytes} bytes"), expected, ADVICE));
    }
    let values = decompress(data, n_bytes as usize).map_err(|fault| {
        let location = Location::Byte((header.body + 8 + fault.byte) as u64);
        input.malformed(location, fault.found, "whole runs of compressed points", ADVICE)
    })?;
    order_by_points(&values, header, progress)
}

/// Returns the values, which are stored field by field, point by point.
fn order_by_points(values: &[u8], header: &Header, progress: &dyn Progress) -> Result<Vec<u8>> {
    let stride = header.stride();
    let n_points = values.len() / stride;
    let mut records = vec![0; values.len()];
    let tasks = records.par_chunks_mut(POINTS_PER_TASK * stride).enumerate();
    tasks.try_for_each(|(task, records)| {
        progress.check()?;
        let first = task * POINTS_PER_TASK;
        let mut byte = 0;
        for size in header.fields.iter().map(PcdField::size).filter(|size| 0 < *size) {
            let column = &values[byte * n_points + first * size..];
            for (record, value) in records.chunks_exact_mut(stride).zip(column.chunks_exact(size)) {
                record[byte..byte + size].copy_from_slice(value);
            }
            byte += size;
        }
        Ok::<(), Error>(())
    })?;
    Ok(records)
}
