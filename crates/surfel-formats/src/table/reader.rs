//! Reads records of fixed length in parallel, straight from the bytes of a file, and chooses the origin of clouds.

use rayon::prelude::*;
use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, PointFilter};
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::column_slices::{ColumnSlices, resize_checked};
use super::filtered_cloud::FilteredCloud;
use super::layout::RecordLayout;
use crate::error::Result;
use crate::file::Input;

/// Number of points that a task decodes between two checks for cancellation: about a millisecond of work.
const POINTS_PER_TASK: usize = 1 << 14;

/// Number of points that are decoded before the filter drops those that are not kept, so that they stay in the cache.
const FILTERED_POINTS_PER_BATCH: usize = 1 << 17;

/// The error of coordinates, in metres, that rounding to f32 may cause before a cloud gets an origin other than zero.
#[derive(Clone, Copy)]
pub(crate) struct Tolerance(pub f64);

impl Tolerance {
    /// Tolerance of files that state no resolution: a few micrometres.
    pub const UNSTATED: Self = Self(2.5e-6);
    /// Tolerance of coordinates that are f32 in the file, where an origin can only lose bits of points near zero.
    pub const F32_COORDINATES: Self = Self(4e-3);
}

/// Decodes those of `records` that `filter` keeps to a cloud. `complete` gets the points that were kept before, and
/// finishes further ones before the filter compares them.
pub(crate) fn read_records(
    input: &Input,
    records: &[u8],
    layout: &RecordLayout,
    origin: DVec3,
    filter: Option<&PointFilter>,
    mut complete: impl FnMut(ColumnSlices, &mut PointCloud),
    progress: &dyn Progress,
) -> Result<PointCloud> {
    let mut cloud = layout.empty_cloud(origin);
    let Some(filter) = filter else {
        decode_records(&mut cloud, input, records, layout, progress)?;
        complete(ColumnSlices::default(), &mut cloud);
        return Ok(cloud);
    };
    let mut filtered = FilteredCloud::new(input, cloud, records.len() / layout.stride, filter);
    for batch in records.chunks(FILTERED_POINTS_PER_BATCH * layout.stride) {
        filtered.append(|before, cloud| {
            decode_records(cloud, input, batch, layout, progress)?;
            complete(before, cloud);
            Ok(())
        })?;
    }
    Ok(filtered.finish())
}

/// Drops the points from `start` on that `filter` does not keep.
pub(crate) fn keep_matching(
    cloud: &mut PointCloud,
    start: usize,
    filter: Option<&PointFilter>,
) -> Result<()> {
    if let Some(filter) = filter {
        let matches = filter.matches(cloud, start)?;
        cloud.retain_from(start, &matches);
    }
    Ok(())
}

/// Reports how many points a filter keeps.
pub(crate) fn note_kept(
    input: &Input,
    n_kept: u64,
    n_points: u64,
    filter: &PointFilter,
    progress: &dyn Progress,
) {
    let points = counted(n_points, "point");
    progress.note(&format!("{}: {n_kept} of {points} meet {}", input.name, filter.describe()));
}

/// Decodes `records` to the points of a cloud, over those that it has.
fn decode_records(
    cloud: &mut PointCloud,
    input: &Input,
    records: &[u8],
    layout: &RecordLayout,
    progress: &dyn Progress,
) -> Result<()> {
    let origin = cloud.origin;
    resize_checked(cloud, records.len() / layout.stride, input)?;
    let mut rest = ColumnSlices::from_cloud(cloud, 0);
    let tasks: Vec<(&[u8], ColumnSlices)> = records
        .chunks(POINTS_PER_TASK * layout.stride)
        .map(|records| (records, rest.split_off_front(records.len() / layout.stride)))
        .collect();
    tasks.into_par_iter().try_for_each(|(records, mut slices)| {
        progress.check()?;
        layout.decode(records, origin, &mut slices);
        progress.advance(slices.len() as u64);
        Ok(())
    })
}

/// Chooses the origin of a cloud by a sample of its records.
pub(crate) fn origin_of_records(
    records: &[u8],
    layout: &RecordLayout,
    tolerance: Tolerance,
) -> DVec3 {
    choose_origin(&sample_positions(records, layout), DVec3::splat(tolerance.0))
}

/// Returns the world positions of some records, spread evenly over all.
pub(crate) fn sample_positions(records: &[u8], layout: &RecordLayout) -> Vec<DVec3> {
    let step = (records.len() / layout.stride).div_ceil(4096).max(1);
    let records = records.chunks_exact(layout.stride).step_by(step);
    records.map(|record| layout.world_position(record)).collect()
}

/// Chooses the origin of a cloud by a sample of its positions: their median on axes where positions relative to zero
/// would have errors above `tolerance` in f32, else zero.
pub(crate) fn choose_origin(sample: &[DVec3], tolerance: DVec3) -> DVec3 {
    let median = PointCloud::choose_origin(sample);
    let largest = sample
        .iter()
        .map(|p| DVec3::select(p.is_finite_mask(), p.abs(), DVec3::ZERO))
        .fold(DVec3::ZERO, DVec3::max);
    let largest_error = largest * 0.5_f64.powi(24);
    DVec3::select(largest_error.cmpgt(tolerance), median, DVec3::ZERO)
}

#[cfg(test)]
mod tests {
    //! The origin that is subtracted from coordinates.

    use super::*;

    #[test]
    fn origin_is_zero_on_axes_with_small_coordinates() {
        let sample = [DVec3::new(500_000.25, 1.5, f64::NAN), DVec3::new(500_002.25, 2.5, f64::NAN)];
        let origin = choose_origin(&sample, DVec3::splat(1e-3));
        assert_eq!(origin, DVec3::new(500_002.0, 0.0, 0.0));
    }
}
