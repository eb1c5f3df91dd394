//! The points of a file that a filter keeps, read in batches.

use rayon::prelude::*;
use surfel_core::points::{KeptPoints, PointCloud, PointFilter};

use super::column_slices::{ColumnSlices, resize, resize_checked, shrink};
use crate::error::Result;
use crate::file::Input;

/// Number of points that a task moves from a batch to the cloud.
const POINTS_PER_TASK: usize = 1 << 14;

/// A cloud that gets those points of batches that a filter keeps.
pub(crate) struct FilteredCloud<'a> {
    input: &'a Input<'a>,
    filter: &'a PointFilter,
    /// The kept points, and zeros after them.
    cloud: PointCloud,
    n_kept: usize,
    /// The batch that was read last.
    batch: PointCloud,
}

impl<'a> FilteredCloud<'a> {
    /// A cloud with the columns of `empty`, for at most `n_points` points.
    pub fn new(
        input: &'a Input,
        empty: PointCloud,
        n_points: usize,
        filter: &'a PointFilter,
    ) -> Self {
        let mut cloud = empty.clone();
        // Zeros take up memory only once they are written to. If the system has no room even so, the cloud grows with
        // each batch.
        if !resize(&mut cloud, n_points) {
            cloud = empty.clone();
        }
        Self { input, filter, cloud, n_kept: 0, batch: empty }
    }

    /// Appends the kept points of a batch. `read` gets the points that were kept before, and writes the batch over
    /// another one.
    pub fn append(
        &mut self,
        read: impl FnOnce(ColumnSlices, &mut PointCloud) -> Result<()>,
    ) -> Result<()> {
        let before = ColumnSlices::from_cloud(&mut self.cloud, 0).split_off_front(self.n_kept);
        read(before, &mut self.batch)?;
        let matches = self.filter.matches(&self.batch, 0)?;
        let n_kept = |matches: &[bool]| matches.iter().map(|is_kept| usize::from(*is_kept)).sum();
        let n_new: usize = n_kept(&matches);
        if self.cloud.len() < self.n_kept + n_new {
            resize_checked(&mut self.cloud, self.n_kept + n_new, self.input)?;
        }
        let mut from = ColumnSlices::from_cloud(&mut self.batch, 0);
        let mut to = ColumnSlices::from_cloud(&mut self.cloud, self.n_kept);
        let tasks: Vec<_> = matches
            .chunks(POINTS_PER_TASK)
            .map(|matches| {
                let from = from.split_off_front(matches.len());
                (matches, from, to.split_off_front(n_kept(matches)))
            })
            .collect();
        tasks.into_par_iter().for_each(|(matches, from, mut to)| {
            let ranges: Vec<_> = KeptPoints::new(0, matches).ranges().collect();
            to.copy_ranges(&from, &ranges);
        });
        self.n_kept += n_new;
        Ok(())
    }

    /// Returns the points that were kept.
    pub fn finish(mut self) -> PointCloud {
        resize(&mut self.cloud, self.n_kept);
        shrink(&mut self.cloud);
        self.cloud
    }
}

#[cfg(test)]
mod tests {
    //! Points that are kept.

    use super::*;
    use surfel_core::math::Vec3;

    #[test]
    fn batches_of_any_size_are_filtered_also_without_room_for_all_points() {
        let input = Input::from_bytes("a.las", &[]);
        let filter: PointFilter = "intensity > 2".parse().unwrap();
        let empty = PointCloud { intensity: Some(Vec::new()), ..PointCloud::default() };
        for n_at_most in [30, usize::MAX / 4] {
            let mut filtered = FilteredCloud::new(&input, empty.clone(), n_at_most, &filter);
            for n in [7, 3, 20] {
                let read = |before: ColumnSlices, cloud: &mut PointCloud| {
                    assert!(before.intensity.unwrap().iter().all(|value| 2.0 < *value));
                    cloud.positions = (0..n).map(|i| Vec3::splat(i as f32)).collect();
                    cloud.intensity = Some((0..n).map(|i| i as f32).collect());
                    Ok(())
                };
                filtered.append(read).unwrap();
            }
            let cloud = filtered.finish();
            let expected: Vec<f32> = (3..7).chain(3..20).map(|i| i as f32).collect();
            assert_eq!(cloud.intensity, Some(expected.clone()));
            let positions: Vec<Vec3> = expected.into_iter().map(Vec3::splat).collect();
            assert_eq!(cloud.positions, positions);
        }
    }
}
