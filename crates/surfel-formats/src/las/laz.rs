//! The compressed chunks of LAZ files, checked before the decoder sees them.

use std::io::Cursor;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use laz::laszip::ChunkTable;
use laz::record::{
    LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};
use surfel::progress::Progress;

use super::gps::GpsTimeField;
use super::header::{Header, read_u16, read_u32, read_u64};
use super::point14::Point14;
use crate::error::{Error, Place, Result};
use crate::input::Input;

pub(super) const USER_ID: &str = LazVlr::USER_ID;

/// Points decoded at a time: their raw records stay in the processor's cache.
const POINTS_PER_PIECE: usize = 1024;
/// No chunk holds more points a byte: an arithmetic coder with models of 15 bits spends 0.007 bits a point at least.
const MOST_POINTS_PER_BYTE: u64 = 2048;
/// Chunks of scans hold far fewer points a byte; one that claims more is decoded on trial first.
const USUAL_POINTS_PER_BYTE: u64 = 64;
/// The decoder needs 16 KiB of tables for each.
pub(super) const MOST_EXTRA_BYTES: usize = 1024;

/// The chunks of a file, and how they are compressed.
pub(super) struct Chunks {
    pub chunks: Vec<Chunk>,
    items: Vec<LazItem>,
    record_length: usize,
    is_layered: bool,
}

/// A run of points that is decoded on its own.
pub(super) struct Chunk {
    pub bytes: Range<usize>,
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
    let record = header.record(input, USER_ID, LazVlr::RECORD_ID).unwrap_or_default();
    // Compressor 1 has one run of all points and no table.
    let (data_start, table) = if read_u16(record, 0) == 1 {
        (header.data.start, vec![(header.n_points, header.data.len() as u64)])
    } else {
        (header.data.start + ChunkTable::OFFSET_SIZE, read_chunk_table(input, header, &vlr)?)
    };
    let mut left = header.n_points;
    let mut start = data_start;
    for (point_count, byte_count) in table {
        let n_points = point_count.min(left);
        if n_points == 0 {
            continue;
        }
        let point = Place::Point(header.n_points - left);
        let end = usize::try_from(byte_count).ok().and_then(|count| start.checked_add(count));
        let Some(end) = end.filter(|end| *end <= header.data.end) else {
            return Err(Error::Truncated {
                file: input.name.to_string(),
                place: point,
                readable: header.n_points - left,
                claimed: header.n_points,
            });
        };
        let chunk = Chunk { bytes: start..end, n_points: n_points as usize };
        if MOST_POINTS_PER_BYTE * byte_count < n_points {
            let found = format!("a chunk of {n_points} points in {byte_count} bytes");
            return Err(broken(input, point, found, "a count that the bytes can hold"));
        }
        found.check_layers(input, &chunk, point)?;
        start = end;
        left -= n_points;
        found.chunks.push(chunk);
    }
    if 0 < left {
        return Err(Error::Truncated {
            file: input.name.to_string(),
            place: Place::Byte(start as u64),
            readable: header.n_points - left,
            claimed: header.n_points,
        });
    }
    found.try_unusual(input, progress)?;
    Ok(found)
}

impl Chunks {
    /// The first record of each chunk, which is stored uncompressed.
    pub fn first_records<'a>(&self, input: &'a Input) -> impl Iterator<Item = &'a [u8]> {
        self.chunks.iter().map(|chunk| &input[chunk.bytes.start..][..self.record_length])
    }

    /// Decodes a chunk and hands `take` its records piece by piece.
    pub fn decode(
        &self,
        input: &Input,
        chunk: &Chunk,
        selection: DecompressionSelection,
        mut take: impl FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        let place = Place::Byte(chunk.bytes.start as u64);
        let broken_chunk =
            |found: String| broken(input, place.clone(), found, "a chunk that decodes");
        let bytes = Cursor::new(&input[chunk.bytes.clone()]);
        let mut decoder = self.decoder(bytes).map_err(|error| broken_chunk(error.to_string()))?;
        decoder.set_selection(selection);
        let mut piece = vec![0; POINTS_PER_PIECE.min(chunk.n_points) * self.record_length];
        let mut left = chunk.n_points;
        while 0 < left {
            let n = left.min(POINTS_PER_PIECE);
            let records = &mut piece[..n * self.record_length];
            // Broken bytes can take the decoder's state outside its tables, where it panics; there is
            // no way to tell beforehand. The decoder is not used again after that.
            catch_unwind(AssertUnwindSafe(|| decoder.decompress_many(records)))
                .map_err(|_| broken_chunk("bytes that no encoder writes".into()))?
                .map_err(|error| broken_chunk(error.to_string()))?;
            take(records)?;
            left -= n;
        }
        Ok(())
    }

    /// The decoder for a chunk, our own for the parts that hold GPS times.
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

    /// Checks that the first record and the layers that a chunk announces lie in it.
    fn check_layers(&self, input: &Input, chunk: &Chunk, place: Place) -> Result<()> {
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
        Err(broken(input, place, found, &format!("{needed} bytes, as its layers announce")))
    }

    /// Decodes chunks with an unusual number of points once, so that no memory is taken for a false claim.
    fn try_unusual(&self, input: &Input, progress: &dyn Progress) -> Result<()> {
        for chunk in &self.chunks {
            if USUAL_POINTS_PER_BYTE * (chunk.bytes.len() as u64) < chunk.n_points as u64 {
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

fn n_layers(item: &LazItem) -> usize {
    match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(n) => n.into(),
        _ => 1,
    }
}

/// Reads the record that says how points are compressed, and checks that it fits the header.
fn read_laszip_record(input: &Input, header: &Header) -> Result<LazVlr> {
    let place = Place::Byte(header.data.start as u64);
    let Some(record) = header.record(input, USER_ID, LazVlr::RECORD_ID) else {
        return Err(broken(
            input,
            place,
            "no laszip record",
            "one, since the points are compressed",
        ));
    };
    let vlr = LazVlr::from_buffer(record)
        .map_err(|error| broken(input, place.clone(), error.to_string(), "a laszip record"))?;
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
        return Err(broken(input, place, found, &expected));
    }
    if MOST_EXTRA_BYTES < header.n_extra_bytes() {
        let found = format!("{} compressed extra bytes a point", header.n_extra_bytes());
        return Err(input.unsupported(found, "at most 1024 are read; convert the file to LAS"));
    }
    Ok(vlr)
}

/// Points and bytes of each chunk.
fn read_chunk_table(input: &Input, header: &Header, vlr: &LazVlr) -> Result<Vec<(u64, u64)>> {
    let start = header.data.start;
    let missing = |found: String| {
        let advice = "the file was cut off or never closed; copy or write it again";
        let expected = "the offset of a chunk table inside the file";
        input.malformed(Place::Byte(start as u64), found, expected, advice)
    };
    if header.data.len() < ChunkTable::OFFSET_SIZE {
        return Err(missing("the end of the file".into()));
    }
    let mut offset = read_u64(input, start);
    // A writer that could not seek back puts the offset at the end instead.
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
            Place::Byte(at as u64 + 4),
            found,
            "at most one a record's length of bytes",
        ));
    }
    let is_variable = vlr.uses_variable_size_chunks();
    let mut table_bytes = Cursor::new(&input[at..]);
    // As in `Chunks::decode`: the table is coded arithmetically too.
    let table = catch_unwind(AssertUnwindSafe(|| ChunkTable::read(&mut table_bytes, is_variable)))
        .map_err(|_| missing("a broken chunk table".into()))?
        .map_err(|error| missing(error.to_string()))?;
    let fixed = u64::from(vlr.chunk_size());
    let count = |point_count| if is_variable { point_count } else { fixed };
    Ok(table.into_iter().map(|entry| (count(entry.point_count), entry.byte_count)).collect())
}

fn broken(input: &Input, place: Place, found: impl Into<String>, expected: &str) -> Error {
    input.malformed(place, found, expected, "the file is damaged; copy it again from its source")
}
