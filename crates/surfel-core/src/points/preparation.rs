//! Settings of the preparation of a cloud.

use super::PointCloud;
use super::cleaning::clean_options::{Duplicates, NoisePoints};
use super::cleaning::outliers::OutlierRemoval;
use super::cleaning::subsample::Subsample;
use super::denoising::denoise::Denoise;
use super::neighbors::{NeighborMethod, Neighborhood};
use super::normals::orient::Orientation;
use super::radii::radius::Radius;
use super::scan::mixed_pixels::MixedPixels;
use super::structure::point_shape::StructureChoice;
use crate::error::{Error, Result};

/// Name of the scalar column that `Preparation::keep_variation` adds.
pub const SURFACE_VARIATION: &str = "surface_variation";

/// Settings of [`prepare`](super::prepare). The default suits raw scans.
#[derive(Clone, Debug, PartialEq)]
pub struct Preparation {
    /// The choice whether duplicates are dropped.
    pub duplicates: Duplicates,
    /// The choice whether points are dropped that are no measurement of a surface.
    pub noise_points: NoisePoints,
    /// ASPRS classes of noise whose points are kept.
    pub kept_noise: Vec<u8>,
    /// The choice whether points in the air between two surfaces are dropped, where the grid of a scan tells them.
    pub mixed_pixels: MixedPixels,
    /// The points to keep; none keeps all.
    pub subsample: Option<Subsample>,
    /// The outliers to remove; none keeps all points.
    pub remove_outliers: Option<OutlierRemoval>,
    /// The choice whether noisy points are moved onto their surface.
    pub denoise: Denoise,
    /// The method that finds neighbours.
    pub neighbors: NeighborMethod,
    /// The neighbours whose plane gives a normal. Methods that know only distances use the median distance to k.
    pub normals: Neighborhood,
    /// True to estimate the normals that the file lacks. Spheres and pixels need none.
    pub estimates_normals: bool,
    /// The signs of normals. `Auto` and `Station` turn those of the file only if all stations are known.
    pub orientation: Orientation,
    /// True to take the lengths of the file's normals for radii, if these vary as radii do and the file has no others.
    pub radii_from_normals: bool,
    /// The choice of radii.
    pub radius: Radius,
    /// The choice of structures. Applies if all radii are estimated, and differ from point to point.
    pub structure: StructureChoice,
    /// True to narrow what reaches into space through which a scanner saw, where the grid of a scan tells it. Applies if
    /// structures are found, and no points of the grid are left out by a subsample.
    pub free_space: bool,
    /// True to add the column `SURFACE_VARIATION`: 0 on a plane, up to 1/3.
    pub keep_variation: bool,
    /// Seed of all random choices.
    pub seed: u64,
}

impl Default for Preparation {
    fn default() -> Self {
        Self {
            duplicates: Duplicates::default(),
            noise_points: NoisePoints::default(),
            kept_noise: Vec::new(),
            mixed_pixels: MixedPixels::default(),
            subsample: None,
            remove_outliers: None,
            denoise: Denoise::default(),
            neighbors: NeighborMethod::Knn,
            normals: Neighborhood::Nearest(16),
            estimates_normals: true,
            orientation: Orientation::None,
            radii_from_normals: true,
            radius: Radius::default(),
            structure: StructureChoice::default(),
            free_space: true,
            keep_variation: false,
            seed: 0,
        }
    }
}

impl Preparation {
    /// Returns true if some points of a cloud may be lines or scatter that the cloud does not state itself.
    pub fn finds_structures(&self, cloud: &PointCloud) -> bool {
        let has_own = cloud.radii.is_some() || cloud.structures().is_some();
        // Points that move may change their structure.
        let moves = !cloud.morphs.is_empty() || cloud.skin.is_some();
        let is_chosen = self.structure != StructureChoice::Surface;
        !has_own && !moves && is_chosen && self.radius.rank().is_some()
    }

    /// Checks the settings.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a value out of range, as [`prepare`](super::prepare) does.
    pub fn check(&self) -> Result<()> {
        self.radius.check()?;
        if let Neighborhood::Nearest(k) = self.normals
            && !(2..1 << 20).contains(&k)
        {
            let expected = "from 2, to span a plane, to a million";
            let name = "number of neighbours for normals";
            return Err(Error::Setting { name, found: k.to_string(), expected });
        }
        Ok(())
    }
}
