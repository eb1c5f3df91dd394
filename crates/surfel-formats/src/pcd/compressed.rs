//! Reads compressed points: decompresses all values, which are stored field by field, and orders them point by point.

use rayon::prelude::*;
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::header::{Header, PcdField};
use super::lzf::{MAX_RATIO, decompress};
use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;
use crate::table::ColumnRole;

/// Number of points that a task orders between two checks for cancellation.
const POINTS_PER_TASK: usize = 1 << 14;

/// The records of a compressed file, as far as they are whole.
pub(super) struct Records {
    /// Points that have a position, with zeros in the fields that are lost.
    pub bytes: Vec<u8>,
    /// Bytes of a record from its start on that all points have.
    pub whole_width: usize,
}

const ADVICE: &str = "copy the file again from its source, or write it again";

/// Returns the records of a compressed file. If it ends early or is broken within, the fields before the damage are whole.
pub(super) fn records(
    salvage: &mut Salvage,
    header: &Header,
    progress: &dyn Progress,
) -> Result<Records> {
    let input = salvage.input;
    let n_points = header.n_points() as usize;
    let (n_compressed, n_bytes, data) = sizes(input, header)?;
    let (values, fault) = decompress(&data[..data.len().min(n_compressed)], n_bytes);
    let n_readable = n_readable(header, n_points, values.len());
    if fault.is_some() || data.len() < n_compressed {
        let found_points = match n_readable == n_points {
            true => "all positions, but within the other values".to_owned(),
            false => format!("{n_readable} of {}", counted(n_points, "position")),
        };
        let error = match fault {
            Some(fault) if n_compressed <= data.len() => {
                let location = Location::Byte((header.body + 8 + fault.byte) as u64);
                let expected = "whole runs of compressed points";
                input.malformed(location, fault.found, expected, ADVICE)
            }
            _ => {
                let found = format!("the end of the file after {found_points}");
                let expected = format!(
                    "{n_compressed} compressed bytes, which hold all values of a field before those of the next"
                );
                input.malformed(Location::Byte(input.len() as u64), found, expected, ADVICE)
            }
        };
        if n_readable == 0 {
            return Err(error);
        }
        salvage.accept(error)?;
    }
    let widths = field_ends(header).filter(|end| end * n_points <= values.len());
    let whole_width = widths.last().unwrap_or(0);
    Ok(Records { bytes: order_by_points(values, header, n_readable, progress)?, whole_width })
}

/// Returns the numbers of compressed and of decompressed bytes that a file states, and the compressed bytes that it has.
fn sizes<'a>(input: &'a Input, header: &Header) -> Result<(usize, usize, &'a [u8])> {
    let body = &input[header.body..];
    let sizes = body.split_first_chunk::<4>().and_then(|(compressed, rest)| {
        let (whole, data) = rest.split_first_chunk::<4>()?;
        Some((u32::from_le_bytes(*compressed), u32::from_le_bytes(*whole), data))
    });
    let Some((n_compressed, n_bytes, data)) = sizes else {
        let found = format!("{} after the header", counted(body.len(), "byte"));
        let location = Location::Byte(header.body as u64);
        return Err(input.malformed(location, found, "the sizes of the compressed points", ADVICE));
    };
    let expected_bytes = u128::from(header.n_points()) * header.stride() as u128;
    if u128::from(n_bytes) != expected_bytes {
        let location = Location::Byte(header.body as u64 + 4);
        let expected = format!("{expected_bytes}, as its fields and points take");
        return Err(input.malformed(location, counted(n_bytes, "byte"), expected, ADVICE));
    }
    let max_bytes = u64::from(n_compressed) * MAX_RATIO as u64;
    if max_bytes < n_bytes.into() {
        let location = Location::Byte(header.body as u64);
        let expected = format!("at most {max_bytes} from {n_compressed} bytes");
        return Err(input.malformed(location, counted(n_bytes, "byte"), expected, ADVICE));
    }
    Ok((n_compressed as usize, n_bytes as usize, data))
}

/// Returns the bytes of a record up to the end of each field.
fn field_ends(header: &Header) -> impl Iterator<Item = usize> {
    header.fields.iter().scan(0, |end, field| {
        *end += field.size();
        Some(*end)
    })
}

/// Returns the number of points from the first on whose positions are among the first `n_bytes` values.
fn n_readable(header: &Header, n_points: usize, n_bytes: usize) -> usize {
    let is_axis = |field: &PcdField| {
        let role = ColumnRole::from_name(&field.name);
        field.count == 1 && matches!(role, Some(ColumnRole::Position(_)))
    };
    let ends = field_ends(header).zip(&header.fields);
    let of_axes = ends.filter(|(_, field)| is_axis(field)).map(|(end, field)| {
        let start = (end - field.size()) * n_points;
        n_bytes.saturating_sub(start) / field.size()
    });
    of_axes.min().unwrap_or(0).min(n_points)
}

/// Returns the values of the first `n_kept` points, which are stored field by field, point by point. Values that are missing
/// become zeros.
fn order_by_points(
    mut values: Vec<u8>,
    header: &Header,
    n_kept: usize,
    progress: &dyn Progress,
) -> Result<Vec<u8>> {
    let (stride, n_points) = (header.stride(), header.n_points() as usize);
    let last = field_ends(header).find(|end| values.len() <= end * n_points).unwrap_or(stride);
    values.resize(last * n_points, 0);
    let mut records = vec![0; n_kept * stride];
    let tasks = records.par_chunks_mut(POINTS_PER_TASK * stride).enumerate();
    tasks.try_for_each(|(task, records)| {
        progress.check()?;
        let first = task * POINTS_PER_TASK;
        let fields = field_ends(header).zip(header.fields.iter().map(PcdField::size));
        for (end, size) in fields.filter(|(end, size)| 0 < *size && *end <= last) {
            let byte = end - size;
            let column = &values[byte * n_points + first * size..];
            for (record, value) in records.chunks_exact_mut(stride).zip(column.chunks_exact(size)) {
                record[byte..end].copy_from_slice(value);
            }
        }
        Ok::<(), Error>(())
    })?;
    Ok(records)
}
