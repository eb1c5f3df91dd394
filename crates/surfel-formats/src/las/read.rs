//! Reads the points of LAS and LAZ files.

use std::iter::repeat_n;

use laz::DecompressionSelection;
use rayon::prelude::*;
use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, Values, is_flag};
use surfel_core::progress::Progress;

use super::color_bits::ColorBits;
use super::crs::coordinate_system;
use super::fields::columns;
use super::find_chunks::find_chunks;
use super::header::{Header, read_header};
use super::laz::{Chunk, Chunks};
use super::profile::read_profile;
use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::table::{
    ColumnChoice, ColumnRole, ColumnSlices, FilteredCloud, RecordLayout, choose_origin,
    read_records, resize_checked, sample_positions,
};

/// Number of points whose chunks are decoded before the filter drops those that are not kept: chunks for many threads.
const FILTERED_POINTS_PER_BATCH: usize = 1 << 20;

/// Reads the header.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let header = read_header(input)?;
    Ok(file_info(input, &header))
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let header = read_header(input)?;
    let columns = columns(input, &header);
    let layout = RecordLayout::new(header.record_length, false, columns, &options.columns)
        .expect("every point format has x, y and z");
    let tolerance = header.scale.abs() / 4.0;
    let origin_of =
        |sample: Vec<DVec3>| options.origin.unwrap_or_else(|| choose_origin(&sample, tolerance));
    let mut salvage = Salvage::new(input, options.salvage);
    let Decoded { mut cloud, color_bits, n_points } = if header.is_compressed {
        let chunks = find_chunks(&mut salvage, &header, progress)?;
        let sample = chunks.first_records(input).map(|record| layout.world_position(record));
        let origin = origin_of(sample.collect());
        let reader = ChunkReader { input, header: &header, layout: &layout, options };
        reader.read_chunks(&chunks, origin, &mut salvage, progress)?
    } else {
        let records = uncompressed_records(&mut salvage, &header)?;
        let origin = origin_of(sample_positions(records, &layout));
        let n_points = (records.len() / header.record_length) as u64;
        progress.begin(&format!("read {}", input.name), n_points);
        let mut color_bits = ColorBits::default();
        let scale = |before: ColumnSlices, cloud: &mut PointCloud| color_bits.scale(before, cloud);
        let filter = options.filter.as_ref();
        let cloud = read_records(input, records, &layout, origin, filter, scale, progress)?;
        Decoded { cloud, color_bits, n_points }
    };
    salvage.report("point", n_points, Some(header.n_points), progress)?;
    if !cloud.is_empty() {
        color_bits.report(input, &mut cloud, progress);
        drop_zero_columns(input, &mut cloud, &options.columns, progress);
    }
    let info = FileInfo { n_points: Some(n_points), ..file_info(input, &header) };
    Ok(Loaded { cloud, info })
}

/// Returns the information in a header.
fn file_info(input: &Input, header: &Header) -> FileInfo {
    let name = match header.is_compressed {
        true if header.record(input, "copc", 1).is_some() => "COPC, LAZ",
        true => "LAZ",
        false => "LAS",
    };
    let columns = columns(input, header);
    FileInfo {
        format: format!("{name} 1.{}, point format {}", header.minor_version, header.point_format),
        n_points: Some(header.n_points),
        bounds: Some(header.bounds)
            .filter(|[low, high]| low.cmple(*high).all() && low.is_finite() && high.is_finite()),
        resolution: Some(header.scale.abs()),
        coordinate_system: coordinate_system(input, header),
        las: Some(read_profile(input, header)),
        columns: columns.iter().map(|column| column.role.name().to_owned()).collect(),
        ..FileInfo::default()
    }
}

/// Returns the records of an uncompressed file.
fn uncompressed_records<'a>(salvage: &mut Salvage<'a>, header: &Header) -> Result<&'a [u8]> {
    let input = salvage.input;
    let data = &input[header.data.clone()];
    let readable = (data.len() / header.record_length) as u64;
    if readable < header.n_points {
        let location = Location::Byte(header.data.end as u64);
        salvage.accept(input.truncated(location, readable, header.n_points))?;
    }
    Ok(&data[..readable.min(header.n_points) as usize * header.record_length])
}

/// The points of a file.
struct Decoded {
    /// Points that the filter keeps.
    cloud: PointCloud,
    /// Bits of the colours.
    color_bits: ColorBits,
    /// Number of points that were read, kept or not.
    n_points: u64,
}

/// Reads the chunks of a compressed file in parallel.
struct ChunkReader<'a> {
    input: &'a Input<'a>,
    header: &'a Header,
    layout: &'a RecordLayout,
    options: &'a LoadOptions,
}

impl ChunkReader<'_> {
    fn read_chunks(
        &self,
        chunks: &Chunks,
        origin: DVec3,
        salvage: &mut Salvage,
        progress: &dyn Progress,
    ) -> Result<Decoded> {
        progress.begin(&format!("read {}", self.input.name), self.header.n_points);
        let mut cloud = self.layout.empty_cloud(origin);
        let mut color_bits = ColorBits::default();
        let Some(filter) = &self.options.filter else {
            let n_points =
                self.decode_chunks(&mut cloud, chunks, &chunks.chunks, salvage, progress)?;
            color_bits.scale(ColumnSlices::default(), &mut cloud);
            return Ok(Decoded { cloud, color_bits, n_points });
        };
        let n_at_most = chunks.chunks.iter().map(|chunk| chunk.n_points).sum();
        let mut filtered = FilteredCloud::new(self.input, cloud, n_at_most, filter);
        let mut n_points = 0;
        let mut rest = &chunks.chunks[..];
        while !rest.is_empty() {
            let mut n_in_batch = 0;
            let is_in_batch = |chunk: &&Chunk| {
                n_in_batch += chunk.n_points;
                n_in_batch <= FILTERED_POINTS_PER_BATCH
            };
            let n_chunks = rest.iter().take_while(is_in_batch).count().max(1);
            let (batch, after) = rest.split_at(n_chunks);
            filtered.append(|before, cloud| {
                n_points += self.decode_chunks(cloud, chunks, batch, salvage, progress)?;
                color_bits.scale(before, cloud);
                Ok(())
            })?;
            rest = after;
        }
        Ok(Decoded { cloud: filtered.finish(), color_bits, n_points })
    }

    /// Decodes some of the chunks to the points of a cloud, over those that it has. Chunks that do not decode are
    /// damage. Returns the number of points.
    fn decode_chunks(
        &self,
        cloud: &mut PointCloud,
        chunks: &Chunks,
        batch: &[Chunk],
        salvage: &mut Salvage,
        progress: &dyn Progress,
    ) -> Result<u64> {
        let selection = selection(&self.options.columns);
        let origin = cloud.origin;
        resize_checked(cloud, batch.iter().map(|chunk| chunk.n_points).sum(), self.input)?;
        let mut rest = ColumnSlices::from_cloud(cloud, 0);
        let tasks: Vec<(&Chunk, ColumnSlices)> =
            batch.iter().map(|chunk| (chunk, rest.split_off_front(chunk.n_points))).collect();
        let decode = |(chunk, mut slices): (&Chunk, ColumnSlices)| {
            chunks.decode(self.input, chunk, selection, |records| {
                progress.check()?;
                let n_points = records.len() / self.header.record_length;
                let mut batch = slices.split_off_front(n_points);
                self.layout.decode(records, origin, &mut batch);
                progress.advance(n_points as u64);
                Ok(())
            })
        };
        let results: Vec<Result<()>> = tasks.into_par_iter().with_max_len(1).map(decode).collect();
        let mut is_whole = Vec::new();
        for (chunk, result) in batch.iter().zip(results) {
            is_whole.push((chunk.n_points, result.is_ok()));
            if let Err(error) = result {
                salvage.accept(error)?;
            }
        }
        if is_whole.iter().any(|(_, is_whole)| !is_whole) {
            let of_points = is_whole.into_iter().flat_map(|(n, is_whole)| repeat_n(is_whole, n));
            cloud.retain_from(0, &of_points.collect::<Vec<bool>>());
        }
        Ok(cloud.len() as u64)
    }
}

/// Returns the parts to decode, for point formats whose parts are compressed separately.
fn selection(choice: &ColumnChoice) -> DecompressionSelection {
    let base = DecompressionSelection::base().decompress_z().decompress_flags();
    let ColumnChoice::Only(_) = choice else { return DecompressionSelection::all() };
    let wants = |name: &str| choice.wants(&ColumnRole::Scalar(name.into()));
    // The extra bytes are decoded for any choice, since other code decides which columns they hold.
    let mut selection = base.decompress_extra_bytes();
    if choice.wants(&ColumnRole::Intensity) {
        selection = selection.decompress_intensity();
    }
    if choice.wants(&ColumnRole::Classification) {
        selection = selection.decompress_classification();
    }
    if choice.wants(&ColumnRole::Color(0)) {
        selection = selection.decompress_rgb();
    }
    if wants("scan_angle") {
        selection = selection.decompress_scan_angle();
    }
    if wants("user_data") {
        selection = selection.decompress_user_data();
    }
    if wants("point_source_id") {
        selection = selection.decompress_point_source_id();
    }
    if wants("gps_time") {
        selection = selection.decompress_gps_time();
    }
    if wants("nir") {
        selection = selection.decompress_nir();
    }
    selection
}

/// Drops intensities, classes and flags that are all zero: every point format has fields for them, so zeros mean that
/// they were never set. Classes are needed to leave out noise, so that their absence is reported only where all columns
/// are read.
fn drop_zero_columns(
    input: &Input,
    cloud: &mut PointCloud,
    columns: &ColumnChoice,
    progress: &dyn Progress,
) {
    let note = |what: &str| {
        progress.note(&format!("{}: all {what} are zero; treated as absent", input.name));
    };
    if cloud.intensity.as_ref().is_some_and(|column| column.par_iter().all(|v| *v == 0.0)) {
        note("intensities");
        cloud.intensity = None;
    }
    if cloud.classification.as_ref().is_some_and(|column| column.par_iter().all(|v| *v == 0)) {
        if *columns == ColumnChoice::All {
            note("classes");
        }
        cloud.classification = None;
    }
    let is_set = |values: &Values| (0..values.len()).into_par_iter().any(|i| values.get(i) != 0.0);
    cloud.scalars.retain(|scalar| !is_flag(&scalar.name) || is_set(&scalar.values));
}
