//! Sources of points: files, and clouds in memory.

use crate::description::PreparationSettings;
use crate::error::{Error, Result};
use crate::resolve::{filter_cloud, reading_error};
use std::path::PathBuf;
use std::sync::Arc;
use surfel_core::math::DAffine3;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_formats::{FileInfo, LoadOptions, Loaded};

/// Points that are read or prepared.
#[derive(Clone, Debug)]
pub enum PointSource {
    /// The points of a file.
    File(PathBuf),
    /// A cloud in memory, and what is known about the file that it came from.
    Cloud(Arc<PointCloud>, Box<FileInfo>),
}

impl PointSource {
    /// Returns the name of the source in messages: its path, or its number among all.
    pub(crate) fn name(&self, index: usize) -> PathBuf {
        match self {
            Self::File(file) => file.clone(),
            Self::Cloud(..) => PathBuf::from(format!("cloud {index}")),
        }
    }

    /// Returns what is known about the points before they are read.
    pub(crate) fn inspect(&self) -> surfel_formats::Result<FileInfo> {
        match self {
            Self::File(file) => surfel_formats::inspect(file),
            Self::Cloud(cloud, info) => {
                Ok(FileInfo { n_points: Some(cloud.len() as u64), ..(**info).clone() })
            }
        }
    }

    /// Returns the points that meet the filters.
    pub(crate) fn read(
        self,
        options: &LoadOptions,
        settings: &PreparationSettings,
        progress: &dyn Progress,
    ) -> Result<Loaded> {
        match self {
            Self::File(file) => surfel_formats::load(&file, options, progress)
                .map_err(|error| reading_error(&file, error, settings)),
            Self::Cloud(cloud, info) => {
                let none = cloud.subset(&[]);
                let cloud = Arc::unwrap_or_clone(cloud);
                let cloud = match filter_cloud(cloud, &DAffine3::IDENTITY, settings, progress) {
                    // Other sources may have points that meet the filters.
                    Err(Error::NoPointKept { .. }) => none,
                    filtered => filtered?,
                };
                Ok(Loaded { cloud, info: *info })
            }
        }
    }
}
