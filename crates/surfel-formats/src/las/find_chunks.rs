//! Finds the compressed chunks of LAZ files: by their table, or one after the other where it is missing.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use surfel_core::words::counted;

use laz::LazVlr;
use laz::laszip::ChunkTable;
use surfel_core::progress::Progress;

use super::header::{Header, read_u16, read_u32, read_u64};
use super::laz::{Chunk, Chunks, broken, read_laszip_record};
use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;

/// Finds the chunks of a file and checks that they lie in it. Salvage leaves out those that do not, and finds chunks
/// without their table.
pub(super) fn find_chunks(
    salvage: &mut Salvage,
    header: &Header,
    progress: &dyn Progress,
) -> Result<Chunks> {
    let input = salvage.input;
    let vlr = read_laszip_record(input, header)?;
    let mut found = Chunks::new(&vlr, header);
    if header.n_points == 0 {
        return Ok(found);
    }
    let ChunkSizes { mut start, table, missing_table } =
        chunk_sizes(salvage, header, &vlr, &found, progress)?;
    let mut n_left = header.n_points;
    for (i, (point_count, byte_count)) in table.into_iter().enumerate() {
        let n_points = point_count.min(n_left);
        if n_points == 0 {
            continue;
        }
        let location = Location::Chunk(i as u64);
        let end = usize::try_from(byte_count).ok().and_then(|count| start.checked_add(count));
        let Some(end) = end.filter(|end| *end <= header.data.end) else {
            let readable = header.n_points - n_left;
            salvage.accept(input.truncated(location, readable, header.n_points))?;
            // The layers of a layered chunk are not whole.
            if !found.is_layered {
                let mut cut = Chunk { bytes: start..header.data.end, n_points: n_points as usize };
                cut.n_points = found.decoded_size(input, &cut, progress)?.0;
                found.chunks.extend((0 < cut.n_points).then_some(cut));
            }
            n_left = 0;
            break;
        };
        let chunk = Chunk { bytes: start..end, n_points: n_points as usize };
        start = end;
        n_left -= n_points;
        match found.check(input, &chunk, location) {
            Ok(()) => found.chunks.push(chunk),
            Err(error) => salvage.accept(error)?,
        }
    }
    if 0 < n_left {
        let readable = header.n_points - n_left;
        let location = Location::Byte(start as u64);
        salvage.accept(input.truncated(location, readable, header.n_points))?;
    }
    found.probe_suspicious_chunks(salvage, progress)?;
    // The place where the file ends says more.
    missing_table.map_or(Ok(()), |error| salvage.accept(error))?;
    Ok(found)
}

/// The sizes of the chunks.
struct ChunkSizes {
    /// First byte of the first chunk.
    start: usize,
    /// Numbers of points and bytes of each chunk.
    table: Vec<(u64, u64)>,
    /// The error of a table that is missing.
    missing_table: Option<Error>,
}

fn chunk_sizes(
    salvage: &Salvage,
    header: &Header,
    vlr: &LazVlr,
    chunks: &Chunks,
    progress: &dyn Progress,
) -> Result<ChunkSizes> {
    let input = salvage.input;
    let record = header.record(input, LazVlr::USER_ID, LazVlr::RECORD_ID).unwrap_or_default();
    let start = header.data.start;
    // Compressor 1 writes all points in one run, without a table.
    if read_u16(record, 0) == 1 {
        let table = match salvage.is_on {
            true => walk_chunks(input, header, start, header.n_points, chunks, progress)?,
            false => vec![(header.n_points, header.data.len() as u64)],
        };
        return Ok(ChunkSizes { start, table, missing_table: None });
    }
    let start = start + ChunkTable::OFFSET_SIZE;
    match read_chunk_table(input, header, vlr) {
        Ok(table) => Ok(ChunkSizes { start, table, missing_table: None }),
        Err(error) => {
            let missing_table = Some(salvage.check(error)?);
            // Chunks of various sizes state them in layered files, and nowhere in others.
            let is_countable = chunks.is_layered || !vlr.uses_variable_size_chunks();
            let chunk_size = if is_countable { u64::from(vlr.chunk_size()) } else { 0 };
            let table = walk_chunks(input, header, start, chunk_size, chunks, progress)?;
            Ok(ChunkSizes { start, table, missing_table })
        }
    }
}

/// Returns the numbers of points and bytes of the chunks from `start` on, without their table: layered chunks state
/// them, others end where the decoder has read `chunk_size` points.
fn walk_chunks(
    input: &Input,
    header: &Header,
    start: usize,
    chunk_size: u64,
    chunks: &Chunks,
    progress: &dyn Progress,
) -> Result<Vec<(u64, u64)>> {
    let mut table = Vec::new();
    let (mut at, mut n_left) = (start as u64, header.n_points);
    while 0 < n_left && at < header.data.end as u64 {
        progress.check()?;
        let bytes = at as usize..header.data.end;
        let size = if chunks.is_layered {
            chunks.stated_size(&input[bytes])
        } else {
            let n_points = chunk_size.min(n_left);
            let chunk = Chunk { bytes, n_points: n_points as usize };
            let (n_decoded, n_bytes) = chunks.decoded_size(input, &chunk, progress)?;
            // A chunk that is not whole reaches beyond the end of the file.
            let is_whole = n_decoded as u64 == n_points;
            (0 < n_points).then_some((n_points, if is_whole { n_bytes as u64 } else { u64::MAX }))
        };
        let Some((n_points, n_bytes)) = size else { break };
        table.push((n_points, n_bytes));
        at = at.saturating_add(n_bytes);
        n_left -= n_points.min(n_left);
    }
    Ok(table)
}

/// Reads the numbers of points and bytes of each chunk.
fn read_chunk_table(input: &Input, header: &Header, vlr: &LazVlr) -> Result<Vec<(u64, u64)>> {
    let start = header.data.start;
    let missing = |found: String| {
        let advice = "the file was cut off or never closed; copy or write it again";
        let expected = "the offset of a chunk table inside the file";
        input.malformed(Location::Byte(start as u64), found, expected, advice)
    };
    if header.data.len() < ChunkTable::OFFSET_SIZE {
        return Err(missing("the end of the file".into()));
    }
    let mut offset = read_u64(input, start);
    // A writer that cannot seek puts the offset at the end.
    if offset == u64::MAX {
        offset = read_u64(input, input.len() - 8);
    }
    let at = usize::try_from(offset).ok().filter(|at| start + 8 <= *at && at + 8 <= input.len());
    let Some(at) = at else {
        return Err(missing(format!("offset {}", offset as i64)));
    };
    let n_chunks = read_u32(input, at + 4);
    // Each chunk begins with an uncompressed record.
    if ((header.data.len() / header.record_length) as u32) < n_chunks {
        let found = counted(n_chunks, "chunk");
        return Err(broken(
            input,
            Location::Byte(at as u64 + 4),
            found,
            "at most one a record's length of bytes",
        ));
    }
    let is_variable = vlr.uses_variable_size_chunks();
    let mut table_bytes = Cursor::new(&input[at..]);
    // The table is coded arithmetically too, so decoding it can panic as in `Chunks::decode`.
    let table = catch_unwind(AssertUnwindSafe(|| ChunkTable::read(&mut table_bytes, is_variable)))
        .map_err(|_| missing("a broken chunk table".into()))?
        .map_err(|error| missing(error.to_string()))?;
    let fixed = u64::from(vlr.chunk_size());
    let count = |point_count| if is_variable { point_count } else { fixed };
    Ok(table.into_iter().map(|entry| (count(entry.point_count), entry.byte_count)).collect())
}
