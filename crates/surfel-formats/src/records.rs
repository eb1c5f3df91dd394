//! Reads a file's records of fixed length in parallel, straight from its bytes.

use rayon::prelude::*;
use surfel::math::DVec3;
use surfel::points::PointCloud;
use surfel::progress::Progress;

use crate::block::{Block, grow};
use crate::error::{Error, Result};
use crate::input::Input;
use crate::record::Layout;

/// Points a task decodes before it looks for cancellation: some milliseconds of work.
const POINTS_PER_TASK: usize = 1 << 16;

/// The error in a coordinate that rounding to f32 may cause before a cloud gets an origin of its own.
#[derive(Clone, Copy)]
pub(crate) struct Tolerance(pub f64);

impl Tolerance {
    /// For files that state no resolution: a few micrometres.
    pub const UNSTATED: Self = Self(2.5e-6);
    /// For coordinates that are f32 in the file: an origin can only lose bits of points near zero.
    pub const SINGLE: Self = Self(4e-3);
}

/// Decodes all of `records`.
pub(crate) fn read_records(
    input: &Input,
    records: &[u8],
    layout: &Layout,
    origin: DVec3,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    let n_points = records.len() / layout.stride;
    let mut cloud = layout.empty_cloud(origin);
    grow_checked(&mut cloud, n_points, input)?;
    let mut rest = Block::of_cloud(&mut cloud, 0);
    let tasks: Vec<(&[u8], Block)> = records
        .chunks(POINTS_PER_TASK * layout.stride)
        .map(|records| (records, rest.split_off_front(records.len() / layout.stride)))
        .collect();
    tasks.into_par_iter().try_for_each(|(records, mut block)| {
        progress.check()?;
        layout.decode(records, origin, &mut block);
        progress.advance(block.len() as u64);
        Ok::<(), Error>(())
    })?;
    Ok(cloud)
}

pub(crate) fn grow_checked(cloud: &mut PointCloud, n: usize, input: &Input) -> Result<()> {
    if grow(cloud, n) {
        return Ok(());
    }
    Err(Error::OutOfMemory { file: input.name.to_string(), n_points: n as u64 })
}

/// A good origin for a file by a sample of its records.
pub(crate) fn origin_of_records(records: &[u8], layout: &Layout, tolerance: Tolerance) -> DVec3 {
    choose_origin(&sample_positions(records, layout), DVec3::splat(tolerance.0))
}

/// World positions of some records spread over all.
pub(crate) fn sample_positions(records: &[u8], layout: &Layout) -> Vec<DVec3> {
    let step = (records.len() / layout.stride).div_ceil(4096).max(1);
    let records = records.chunks_exact(layout.stride).step_by(step);
    records.map(|record| layout.world_position(record)).collect()
}

/// The sample's median on the axes where f32 about zero would err by more than `tolerance`, else zero.
pub(crate) fn choose_origin(sample: &[DVec3], tolerance: DVec3) -> DVec3 {
    let median = PointCloud::choose_origin(sample);
    let reach = sample
        .iter()
        .map(|p| DVec3::select(p.is_finite_mask(), p.abs(), DVec3::ZERO))
        .fold(DVec3::ZERO, DVec3::max);
    let largest_error = reach * 0.5_f64.powi(24);
    DVec3::select(largest_error.cmpgt(tolerance), median, DVec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_given_only_where_it_is_needed() {
        let sample = [DVec3::new(500_000.25, 1.5, f64::NAN), DVec3::new(500_002.25, 2.5, f64::NAN)];
        let origin = choose_origin(&sample, DVec3::splat(1e-3));
        assert_eq!(origin, DVec3::new(500_002.0, 0.0, 0.0));
    }
}
