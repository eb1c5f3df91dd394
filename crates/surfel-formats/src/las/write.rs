//! Writes clouds as LAS, compressed or not, in the version and the point format of their source where these suffice.

use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;

use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::record::{
    LayeredPointRecordCompressor, RecordCompressor, SequentialPointRecordCompressor,
};
use laz::{LazItemRecordBuilder, LazVlr, LazVlrBuilder};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;

use super::laz::MAX_EXTRA_BYTES;
use super::write_header::{MAX_EXTRA_COLUMNS, header_bytes};
use super::write_plan::WritePlan;
use crate::error::{Error, Result};
use crate::file::{extension, write_error, write_file};
use crate::number_text::format_vector;
use crate::options::SaveOptions;
use crate::table::{POINTS_PER_CHUNK, encode_points};

/// Writes `cloud` to `path`; the extension `laz` asks for compression.
pub(crate) fn write(
    path: &Path,
    cloud: &PointCloud,
    options: &SaveOptions,
    progress: &dyn Progress,
) -> Result<()> {
    if let Some(point) = cloud.positions.iter().position(|position| !position.is_finite()) {
        return Err(Error::Unsupported {
            file: path.display().to_string(),
            action: "write",
            found: format!("point {point} at {}", format_vector(cloud.positions[point].as_dvec3())),
            advice: "LAS holds finite positions only; remove such points or write PLY",
        });
    }
    progress.begin(&format!("write {}", path.display()), cloud.len() as u64);
    let plan = WritePlan::new(cloud, options);
    if options.coordinate_system.is_some() && plan.projection.is_empty() {
        let line = "the coordinate system is neither WKT nor an EPSG code, and is left out";
        progress.note(&format!("{}: {line}", path.display()));
    }
    if cloud.intensity.is_some() && plan.standard.intensity.is_none() {
        let line =
            "the intensity is an extra column, since it is not whole numbers from 0 to 65535";
        progress.note(&format!("{}: {line}", path.display()));
    }
    if let Some(line) = &plan.change {
        progress.note(&format!("{}: {line}", path.display()));
    }
    let failed = |cause: io::Error| write_error(path, cause);
    let is_compressed = extension(path) == "laz";
    let n_extra_bytes = plan.n_extra_bytes();
    if MAX_EXTRA_COLUMNS < plan.extras.len() || is_compressed && MAX_EXTRA_BYTES < n_extra_bytes {
        return Err(Error::Unsupported {
            file: path.display().to_string(),
            action: "write",
            found: format!("{} extra columns of {n_extra_bytes} bytes", plan.extras.len()),
            advice: "LAS holds 341 and LAZ 1024 bytes of them; load fewer columns or write PLY",
        });
    }
    let vlr = if is_compressed { Some(laszip_record(&plan).map_err(failed)?) } else { None };
    write_file(path, |writer| {
        let header = header_bytes(&plan, cloud, vlr.as_ref().map(laszip_bytes).as_deref());
        writer.write_all(&header).map_err(failed)?;
        let encode = |points: Range<usize>| Ok(plan.encode(cloud, points));
        let Some(vlr) = &vlr else {
            let put = |bytes: &[u8]| writer.write_all(bytes).map_err(failed);
            return encode_points(cloud.len(), encode, progress, put);
        };
        // The offset of the chunk table is filled in when the chunks are written.
        writer.write_all(&[0; ChunkTable::OFFSET_SIZE]).map_err(failed)?;
        let mut table = ChunkTable::default();
        let compress = |points| {
            let records = plan.encode(cloud, points);
            // The records of point formats up to 5 are compressed as a whole, those of later ones field by field.
            let compressed = match plan.fields.is_extended {
                true => compress(vlr, LayeredPointRecordCompressor::new(new_cursor()), &records),
                false => {
                    compress(vlr, SequentialPointRecordCompressor::new(new_cursor()), &records)
                }
            };
            compressed.map_err(failed)
        };
        encode_points(cloud.len(), compress, progress, |bytes| {
            // The number of points is not stored for chunks of fixed size.
            let byte_count = bytes.len() as u64;
            table.push(ChunkTableEntry { point_count: POINTS_PER_CHUNK as u64, byte_count });
            writer.write_all(bytes).map_err(failed)
        })?;
        let mut finish = || {
            let at = writer.stream_position()?;
            table.write_to(&mut *writer, vlr)?;
            writer.seek(SeekFrom::Start(header.len() as u64))?;
            writer.write_all(&at.to_le_bytes())
        };
        finish().map_err(failed)
    })
}

/// Returns the record that describes the compression.
fn laszip_record(plan: &WritePlan) -> io::Result<LazVlr> {
    let items = LazItemRecordBuilder::default_for_point_format_id(
        plan.fields.format(),
        plan.n_extra_bytes() as u16,
    );
    let items = items.map_err(|error| io::Error::other(error.to_string()))?;
    Ok(LazVlrBuilder::new(items).with_fixed_chunk_size(POINTS_PER_CHUNK as u32).build())
}

fn laszip_bytes(vlr: &LazVlr) -> Vec<u8> {
    let mut bytes = Vec::new();
    vlr.write_to(&mut bytes).expect("writing to memory does not fail");
    bytes
}

fn new_cursor() -> Cursor<Vec<u8>> {
    Cursor::new(Vec::new())
}

/// Compresses the records of a chunk.
fn compress(
    vlr: &LazVlr,
    mut compressor: impl RecordCompressor<Cursor<Vec<u8>>>,
    records: &[u8],
) -> io::Result<Vec<u8>> {
    compressor.set_fields_from(vlr.items()).map_err(|error| io::Error::other(error.to_string()))?;
    compressor.compress_many(records)?;
    compressor.done()?;
    Ok(compressor.into_inner().into_inner())
}
