//! Finds and decodes the compressed chunks of LAZ files, which are checked before the decoder reads them.

use std::io::Cursor;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use laz::laszip::ChunkTable;
use laz::record::{
    LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};
use surfel_core::progress::Progress;

use super::gps::GpsTimeField;
use super::header::{Header, read_u16, read_u32, read_u64};
use super::point14::Point14;
use crate::error::{Error, Location, Result};
use crate::file::Input;

/// Number of points decoded at a time, whose raw records stay in the processor's cache.
const POINTS_PER_BATCH: usize = 1024;
/// Maximum number of points per byte of a chunk: an arithmetic coder with models of 15 bits spends at least 0.007 bits
/// on a point.
const MAX_POINTS_PER_BYTE: u64 = 2048;
/// Number of points per byte beyond which a chunk is suspicious and decoded on trial; chunks of scans hold far fewer.
const SUSPICIOUS_POINTS_PER_BYTE: u64 = 64;
/// Maximum number of extra bytes of a point; the decoder needs 16 KiB of tables for each.
pub(super) const MAX_EXTRA_BYTES: usize = 1024;

/// The chunks of a file and their compression.
pub(super) struct Chunks {
    /// Chunks of the file, in order.
    pub chunks: Vec<Chunk>,
    /// Parts of a record that are compressed separately.
    items: Vec<LazItem>,
    record_length: usize,
    /// True for point formats from 6 on, which compress each part of a chunk's points in a layer of its own.
    is_layered: bool,
}

/// A run of points that is decoded independently of others.
pub(super) struct Chunk {
    /// Bytes of the chunk in the file.
    pub bytes: Range<usize>,
    /// Number of points in the chunk.
    pub n_points: usize,
}

/// Finds the chunks of a file and checks that they lie in it.
pub(super) fn find_chunks(
    input: &Input,
    header: &Header,
    progress: &dyn Progress,
) -> Result<Chunks> {
    let vlr = read_laszip_record(input, header)?;
    let items = vlr.items().clone();
    let is_layered = matches!(items[0].item_type(), LazItemType::Point14);
    let mut found =
        Chunks { chunks: Vec::new(), items, record_length: header.record_length, is_layered };
    if header.n_points == 0 {
        return Ok(found);
    }
    let record = header.record(input, LazVlr::USER_ID, LazVlr::RECORD_ID).unwrap_or_default();
    // Compressor 1 writes all points in one run, without a table.
    let (data_start, table) = if read_u16(record, 0) == 1 {
        (header.data.start, vec![(header.n_points, header.data.len() as u64)])
    } else {
        (header.data.start + ChunkTable::OFFSET_SIZE, read_chunk_table(input, header, &vlr)?)
    };
    let mut n_left = header.n_points;
    let mut start = data_start;
    for (point_count, byte_count) in table {
        let n_points = point_count.min(n_left);
        if n_points == 0 {
            continue;
        }
        let point = Location::Point(header.n_points - n_left);
        let end = usize::try_from(byte_count).ok().and_then(|count| start.checked_add(count));
        let Some(end) = end.filter(|end| *end <= header.data.end) else {
            return Err(Error::Truncated {
                file: input.name.to_string(),
                location: point,
                readable: header.n_points - n_left,
                claimed: header.n_points,
            });
        };
        let chunk = Chunk { bytes: start..end, n_points: n_points as usize };
        if MAX_POINTS_PER_BYTE * byte_count < n_points {
            let found = format!("a chunk of {n_points} points in {byte_count} bytes");
            return Err(broken(input, point, found, "a count that the bytes can hold"));
        }
        found.check_layers(input, &chunk, point)?;
        start = end;
        n_left -= n_points;
        found.chunks.push(chunk);
    }
    if 0 < n_left {
        return Err(Error::Truncated {
            file: input.name.to_string(),
            location: Location::Byte(start as u64),
            readable: header.n_points - n_left,
            claimed: header.n_points,
        });
    }
    found.probe_suspicious_chunks(input, progress)?;
    Ok(found)
}

impl Chunks {
    /// Yields the first record of each chunk, which is stored uncompressed.
    pub fn first_records<'a>(&self, input: &'a Input) -> impl Iterator<Item = &'a [u8]> {
        self.chunks.iter().map(|chunk| &input[chunk.bytes.start..][..self.record_length])
    }

    /// Decodes a chunk, and passes its records to `take` in batches.
    pub fn decode(
        &self,
        input: &Input,
        chunk: &Chunk,
        selection: DecompressionSelection,
        mut take: impl FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        let location = Location::Byte(chunk.bytes.start as u64);
        let broken_chunk =
            |found: String| broken(input, location.clone(), found, "a chunk that decodes");
        let bytes = Cursor::new(&input[chunk.bytes.clone()]);
        let mut decoder = self.decoder(bytes).map_err(|error| broken_chunk(error.to_string()))?;
        decoder.set_selection(selection);
        let mut batch = vec![0; POINTS_PER_BATCH.min(chunk.n_points) * self.record_length];
        let mut n_left = chunk.n_points;
        while 0 < n_left {
            let n = n_left.min(POINTS_PER_BATCH);
            let records = &mut batch[..n * self.record_length];
            // Broken bytes can take the decoder's state outside its tables, where it panics; this cannot be
            // detected beforehand. The decoder is not used again after that.
            catch_unwind(AssertUnwindSafe(|| decoder.decompress_many(records)))
                .map_err(|_| broken_chunk("bytes that no encoder writes".into()))?
                .map_err(|error| broken_chunk(error.to_string()))?;
            take(records)?;
            n_left -= n;
        }
        Ok(())
    }

    /// Returns the decoder of a chunk, with decoders of this crate for the parts that hold GPS times.
    fn decoder<'a>(
        &self,
        bytes: Cursor<&'a [u8]>,
    ) -> laz::Result<Box<dyn RecordDecompressor<Cursor<&'a [u8]>> + 'a>> {
        if self.is_layered {
            let mut decoder = LayeredPointRecordDecompressor::new(bytes);
            for item in &self.items {
                match item.item_type() {
                    LazItemType::Point14 => {
                        decoder.add_field_decompressor(Point14::new(item.version()));
                    }
                    _ => decoder.set_fields_from(&vec![*item])?,
                }
            }
            return Ok(Box::new(decoder));
        }
        let mut decoder = SequentialPointRecordDecompressor::new(bytes);
        for item in &self.items {
            match (item.item_type(), item.version()) {
                (LazItemType::GpsTime, 2) => {
                    decoder.add_field_decompressor(GpsTimeField::default());
                }
                _ => decoder.set_fields_from(&vec![*item])?,
            }
        }
        Ok(Box::new(decoder))
    }

    /// Checks that the first record and the announced layers of a chunk lie in it.
    fn check_layers(&self, input: &Input, chunk: &Chunk, location: Location) -> Result<()> {
        let bytes = &input[chunk.bytes.clone()];
        let n_layers: usize = self.items.iter().map(n_layers).sum();
        let fixed = self.record_length + if self.is_layered { 4 + 4 * n_layers } else { 4 };
        let sizes = bytes.get(self.record_length + 4..fixed).unwrap_or_default();
        let sum: u64 = sizes.chunks_exact(4).map(|size| u64::from(read_u32(size, 0))).sum();
        let needed = fixed as u64 + sum;
        if needed <= bytes.len() as u64 {
            return Ok(());
        }
        let found = format!("a chunk of {} bytes", bytes.len());
        Err(broken(input, location, found, &format!("{needed} bytes, as its layers announce")))
    }

    /// Decodes chunks that claim suspiciously many points once, so that no memory is allocated for a false claim.
    fn probe_suspicious_chunks(&self, input: &Input, progress: &dyn Progress) -> Result<()> {
        for chunk in &self.chunks {
            if SUSPICIOUS_POINTS_PER_BYTE * (chunk.bytes.len() as u64) < chunk.n_points as u64 {
                self.decode(
                    input,
                    chunk,
                    DecompressionSelection::all(),
                    |_| Ok(progress.check()?),
                )?;
            }
        }
        Ok(())
    }
}

/// Returns the number of layers of a part.
fn n_layers(item: &LazItem) -> usize {
    match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(n) => n.into(),
        _ => 1,
    }
}

/// Reads the record that describes the compression, and checks that it fits the header.
fn read_laszip_record(input: &Input, header: &Header) -> Result<LazVlr> {
    let location = Location::Byte(header.data.start as u64);
    let Some(record) = header.record(input, LazVlr::USER_ID, LazVlr::RECORD_ID) else {
        return Err(broken(
            input,
            location,
            "no laszip record",
            "one, since the points are compressed",
        ));
    };
    let vlr = LazVlr::from_buffer(record)
        .map_err(|error| broken(input, location.clone(), error.to_string(), "a laszip record"))?;
    let items = vlr.items();
    let is_layered = items.first().is_some_and(|item| item.item_type() == LazItemType::Point14);
    let versions = if is_layered { 3..=4 } else { 1..=2 };
    let fits = |item: &LazItem| {
        let (size, is_new) = match item.item_type() {
            LazItemType::Byte(n) => (n, false),
            LazItemType::Point10 => (20, false),
            LazItemType::GpsTime => (8, false),
            LazItemType::RGB12 => (6, false),
            LazItemType::WavePacket13 => (29, false),
            LazItemType::Point14 => (30, true),
            LazItemType::RGB14 => (6, true),
            LazItemType::RGBNIR14 => (8, true),
            LazItemType::WavePacket14 => (29, true),
            LazItemType::Byte14(n) => (n, true),
        };
        item.size() == size && is_new == is_layered && versions.contains(&item.version())
    };
    let total: usize = items.iter().map(|item| usize::from(item.size())).sum();
    let begins_with_point =
        is_layered || items.first().is_some_and(|item| item.item_type() == LazItemType::Point10);
    if !begins_with_point
        || is_layered != (6 <= header.point_format)
        || !items.iter().all(fits)
        || total != header.record_length
    {
        let found = format!("{} items of {total} bytes", items.len());
        let expected = format!(
            "the parts of point format {} in {} bytes",
            header.point_format, header.record_length
        );
        return Err(broken(input, location, found, &expected));
    }
    if MAX_EXTRA_BYTES < header.n_extra_bytes() {
        let found = format!("{} compressed extra bytes a point", header.n_extra_bytes());
        return Err(input.unsupported(found, "at most 1024 are read; convert the file to LAS"));
    }
    Ok(vlr)
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
        let found = format!("{n_chunks} chunks");
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

fn broken(input: &Input, location: Location, found: impl Into<String>, expected: &str) -> Error {
    input.malformed(location, found, expected, "the file is damaged; copy it again from its source")
}
