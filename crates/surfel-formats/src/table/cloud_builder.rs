//! Collects decoded records to a cloud, batch by batch.

use rayon::prelude::*;
use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, PointFilter};

use super::column_slices::{ColumnSlices, resize_checked, shrink};
use super::layout::RecordLayout;
use super::reader::{Tolerance, keep_matching, origin_of_records};
use crate::error::Result;
use crate::file::Input;

/// A cloud that grows by batches of records of one layout.
pub(crate) struct CloudBuilder<'a, F> {
    /// Input that the records come from.
    pub input: &'a Input<'a>,
    layout_of: F,
    origin: Option<DVec3>,
    filter: Option<&'a PointFilter>,
    started: Option<(RecordLayout, PointCloud)>,
    n_read: u64,
}

impl<'a, F: Fn(&[u8]) -> RecordLayout> CloudBuilder<'a, F> {
    /// A cloud of points that `filter` keeps. `layout_of` is called once, with the first records; without an `origin`
    /// they also choose it.
    pub fn new(
        input: &'a Input,
        layout_of: F,
        origin: Option<DVec3>,
        filter: Option<&'a PointFilter>,
    ) -> Self {
        Self { input, layout_of, origin, filter, started: None, n_read: 0 }
    }

    /// Appends the points of a batch of records that the filter keeps.
    pub fn append(&mut self, batch: &[Vec<u8>]) -> Result<()> {
        let Some(sample) = batch.iter().find(|records| !records.is_empty()) else { return Ok(()) };
        let (layout, cloud) = self.started.get_or_insert_with(|| {
            let layout = (self.layout_of)(sample);
            let choose = || origin_of_records(sample, &layout, Tolerance::UNSTATED);
            let cloud = layout.empty_cloud(self.origin.unwrap_or_else(choose));
            (layout, cloud)
        });
        layout.demote_classes(batch, cloud);
        let n_before = cloud.len();
        let n_new: usize = batch.iter().map(|records| records.len() / layout.stride).sum();
        resize_checked(cloud, n_before + n_new, self.input)?;
        let origin = cloud.origin;
        let mut rest = ColumnSlices::from_cloud(cloud, n_before);
        let tasks: Vec<(&Vec<u8>, ColumnSlices)> = batch
            .iter()
            .map(|records| (records, rest.split_off_front(records.len() / layout.stride)))
            .collect();
        tasks.into_par_iter().for_each(|(records, mut slices)| {
            layout.decode(records, origin, &mut slices);
        });
        self.n_read += n_new as u64;
        keep_matching(cloud, n_before, self.filter)
    }

    /// Returns the number of points that were read so far, kept or not.
    pub fn n_read(&self) -> u64 {
        self.n_read
    }

    /// Returns the number of points that were kept so far.
    pub fn n_points(&self) -> usize {
        self.started.as_ref().map_or(0, |(_, cloud)| cloud.len())
    }

    /// Returns the cloud.
    pub fn finish(self) -> PointCloud {
        let empty = || {
            let layout = (self.layout_of)(&[]);
            layout.empty_cloud(self.origin.unwrap_or_default())
        };
        let mut cloud = self.started.map_or_else(empty, |(_, cloud)| cloud);
        shrink(&mut cloud);
        cloud
    }
}
