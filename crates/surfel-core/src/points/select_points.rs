//! The points of a cloud that its preparation keeps.

use super::PointCloud;
use super::cleaning::clean::{CleanReport, clean};
use super::cleaning::clean_options::CleanOptions;
use super::cleaning::outliers::remove_outliers;
use super::cleaning::subsample::subsample;
use super::preparation::Preparation;
use super::scan::mixed_pixels::{MixedPixels, without_mixed_pixels};
use crate::error::Result;
use crate::math::Vec3;
use crate::progress::Progress;
use crate::words::counted;

/// Cleans a cloud, and drops mixed pixels, points beyond a subsample and outliers, as the preparation says. A column of
/// normals or radii of which no usable entry is left is removed.
///
/// # Errors
///
/// Returns [`Error::Setting`] for a setting out of range, [`Error::TooManyPoints`] beyond 32-bit indices, and
/// [`Error::Cancelled`] if `progress` is cancelled.
pub fn select_points(
    cloud: PointCloud,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<(PointCloud, CleanReport)> {
    let Selection { cloud, report, .. } = select(cloud, preparation, progress)?;
    Ok((cloud, report))
}

/// The points that are left of a cloud.
pub(crate) struct Selection {
    pub cloud: PointCloud,
    pub report: CleanReport,
    /// True if a subsample left out points, whose rays thus end at nothing. Outliers are few.
    pub is_thinned: bool,
}

/// Does what [`select_points`] does.
///
/// # Errors
///
/// Returns the same errors.
pub(crate) fn select(
    cloud: PointCloud,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<Selection> {
    let Preparation { duplicates, noise_points, kept_noise, .. } = preparation;
    let options = CleanOptions { duplicates: *duplicates, noise_points: *noise_points, kept_noise };
    let (mut cloud, report) = clean(cloud, &options, progress)?;
    if preparation.mixed_pixels == MixedPixels::Drop
        && let Some(kept) = without_mixed_pixels(&cloud, progress)?
    {
        let n_mixed = cloud.len() - kept.len();
        let line = format!("{} between two surfaces dropped", counted(n_mixed, "mixed pixel"));
        progress.choice(&line, &["mixed_pixels"]);
        cloud = cloud.subset(&kept);
    }
    let n_measured = cloud.len();
    if let Some(choice) = preparation.subsample {
        cloud = subsample(&cloud, choice, preparation.seed, progress)?;
    }
    let is_thinned = cloud.len() < n_measured;
    if let Some(choice) = preparation.remove_outliers {
        cloud = remove_outliers(&cloud, choice, progress)?;
    }
    let is_missing = |normal: &Vec3| *normal == Vec3::ZERO;
    cloud.normals = cloud.normals.filter(|normals| !normals.iter().all(is_missing));
    cloud.radii = cloud.radii.filter(|radii| !radii.iter().all(|radius| *radius == 0.0));
    Ok(Selection { cloud, report, is_thinned })
}
