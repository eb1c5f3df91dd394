//! Typical sizes and noise of the neighbourhoods of a cloud's points.

use super::edge_planes::PLANE_THICKNESS;
use super::point_shape::is_surface;
use crate::math::{Vec3, sampled_quantile};
use crate::points::normals::planes::PlaneFit;

/// Ratio of a radius to the typical one from which the neighbourhood is sparse.
pub const SPARSE: f32 = 2.0;

/// Typical properties of the neighbourhoods of a cloud's points.
pub struct Typical {
    /// Median of the surface variations.
    pub variation: f32,
    /// First quartile of the surface variations: that of the even parts, which noise causes.
    pub low_variation: f32,
    /// Median of the radii, which may be those of other neighbourhoods than the planes have.
    pub radius: f32,
}

impl Typical {
    /// Returns the typical properties of the planes through the neighbours of each point, and of the points' radii.
    pub fn of(fits: &[PlaneFit], radii: &[f32]) -> Self {
        // Neighbours that span no plane say nothing about noise.
        let planes = fits.iter().filter(|fit| fit.normal != Vec3::ZERO);
        let variations: Vec<f32> = planes.map(|fit| fit.variation).collect();
        Self {
            variation: sampled_quantile(&variations, 0.5),
            low_variation: sampled_quantile(&variations, 0.25),
            radius: sampled_quantile(radii, 0.5),
        }
    }

    /// Noise in radii of the planes' neighbourhoods. The points of a round, even neighbourhood of radius 1 have a
    /// variance of 1/4 along each axis, so that noise is the root of half the variation.
    pub fn noise(&self) -> f32 {
        (0.5 * self.low_variation).sqrt()
    }

    /// True if the noise is low enough for the two sides of an edge to be told apart.
    pub fn has_edges(&self) -> bool {
        self.noise() < PLANE_THICKNESS
    }

    /// True if a plane fits the neighbourhood of a radius. The variation that noise causes falls with the square of the
    /// radius: where points are sparse, as between the branches of a crown, a plane has to fit better.
    pub fn is_surface(&self, fit: &PlaneFit, radius: f32) -> bool {
        let sparseness = (radius / (SPARSE * self.radius)).max(1.0);
        let expected = PlaneFit { variation: fit.variation * sparseness * sparseness, ..*fit };
        is_surface(&expected)
    }
}
