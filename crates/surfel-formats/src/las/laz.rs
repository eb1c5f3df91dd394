//! Decodes the compressed chunks of LAZ files, which are checked before the decoder reads them.

use std::io::{Cursor, ErrorKind};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use surfel_core::words::counted;

use laz::record::{
    LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};
use surfel_core::progress::Progress;

use super::gps::GpsTimeField;
use super::header::{Header, read_u32};
use super::point14::Point14;
use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;

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
    pub is_layered: bool,
}

/// A run of points that is decoded independently of others.
pub(super) struct Chunk {
    /// Bytes of the chunk in the file.
    pub bytes: Range<usize>,
    /// Number of points in the chunk.
    pub n_points: usize,
}

impl Chunks {
    /// No chunks yet, of points that are compressed as `vlr` says.
    pub fn new(vlr: &LazVlr, header: &Header) -> Self {
        let items = vlr.items().clone();
        let is_layered = matches!(items[0].item_type(), LazItemType::Point14);
        Self { chunks: Vec::new(), items, record_length: header.record_length, is_layered }
    }

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

    /// Checks that a chunk holds its first record and the announced layers, and that it can hold its points.
    pub fn check(&self, input: &Input, chunk: &Chunk, location: Location) -> Result<()> {
        let bytes = &input[chunk.bytes.clone()];
        if MAX_POINTS_PER_BYTE * (bytes.len() as u64) < chunk.n_points as u64 {
            let found =
                format!("{} in {}", counted(chunk.n_points, "point"), counted(bytes.len(), "byte"));
            return Err(broken(input, location, found, "a count that the bytes can hold"));
        }
        let n_fixed = self.n_bytes_before_layers();
        let needed = n_fixed as u64 + self.n_bytes_of_layers(bytes);
        if n_fixed <= bytes.len() && needed <= bytes.len() as u64 {
            return Ok(());
        }
        let found = counted(bytes.len(), "byte");
        Err(broken(input, location, found, &format!("{needed}, as the chunk's layers announce")))
    }

    /// Returns the numbers of points and bytes that a layered chunk at the start of `bytes` states; `None` if `bytes`
    /// end before, or if it states none.
    pub fn stated_size(&self, bytes: &[u8]) -> Option<(u64, u64)> {
        let n_fixed = self.n_bytes_before_layers();
        let head = bytes.get(..n_fixed)?;
        let n_points = u64::from(read_u32(head, self.record_length));
        (0 < n_points).then(|| (n_points, n_fixed as u64 + self.n_bytes_of_layers(head)))
    }

    /// Decodes a chunk as far as its bytes go, and returns the numbers of points and bytes that were decoded. Points
    /// before any other fault than the end of the bytes may be wrong and do not count.
    pub fn decoded_size(
        &self,
        input: &Input,
        chunk: &Chunk,
        progress: &dyn Progress,
    ) -> Result<(usize, usize)> {
        let Ok(mut decoder) = self.decoder(Cursor::new(&input[chunk.bytes.clone()])) else {
            return Ok((0, 0));
        };
        let mut record = vec![0; self.record_length];
        let mut n_points = 0;
        while n_points < chunk.n_points {
            progress.check()?;
            let batch_end = chunk.n_points.min(n_points + POINTS_PER_BATCH);
            // As in `decode`.
            let decoded = catch_unwind(AssertUnwindSafe(|| {
                while n_points < batch_end {
                    decoder.decompress_next(&mut record)?;
                    n_points += 1;
                }
                Ok::<(), std::io::Error>(())
            }));
            match decoded {
                Ok(Ok(())) => {}
                Ok(Err(error)) if error.kind() == ErrorKind::UnexpectedEof => break,
                _ => return Ok((0, 0)),
            }
        }
        Ok((n_points, decoder.box_into_inner().position() as usize))
    }

    /// Returns the bytes of a chunk before its layers or its arithmetic code: first record, and number of points and
    /// sizes of layers if there are any.
    fn n_bytes_before_layers(&self) -> usize {
        let n_layers: usize = self.items.iter().map(n_layers).sum();
        self.record_length + if self.is_layered { 4 + 4 * n_layers } else { 4 }
    }

    /// Returns the bytes of the layers that the head of a chunk announces; 0 if there are none.
    fn n_bytes_of_layers(&self, bytes: &[u8]) -> u64 {
        let sizes = bytes.get(self.record_length + 4..self.n_bytes_before_layers());
        let sizes = sizes.unwrap_or_default().chunks_exact(4);
        sizes.map(|size| u64::from(read_u32(size, 0))).sum()
    }

    /// Decodes chunks that claim suspiciously many points once, so that no memory is allocated for a false claim.
    pub fn probe_suspicious_chunks(
        &mut self,
        salvage: &mut Salvage,
        progress: &dyn Progress,
    ) -> Result<()> {
        for chunk in std::mem::take(&mut self.chunks) {
            let max_points = SUSPICIOUS_POINTS_PER_BYTE * chunk.bytes.len() as u64;
            if max_points < chunk.n_points as u64 {
                let check = |_: &[u8]| Ok(progress.check()?);
                let all = DecompressionSelection::all();
                if let Err(error) = self.decode(salvage.input, &chunk, all, check) {
                    salvage.accept(error)?;
                    continue;
                }
            }
            self.chunks.push(chunk);
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
pub(super) fn read_laszip_record(input: &Input, header: &Header) -> Result<LazVlr> {
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
        let found = format!("{} of {}", counted(items.len(), "item"), counted(total, "byte"));
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

/// Returns the error of a damaged file.
pub(super) fn broken(
    input: &Input,
    location: Location,
    found: impl Into<String>,
    expected: &str,
) -> Error {
    input.malformed(location, found, expected, "the file is damaged; copy it again from its source")
}
