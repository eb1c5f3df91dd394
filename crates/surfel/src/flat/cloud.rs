//! A cloud as kernels read it: its points, and what surface they have.

use super::points::FlatPoints;
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::Points;
use crate::surface::{Boundary, SurfaceKind};

#[derive(Clone, Debug, Default)]
pub struct FlatCloud {
    /// Relative to the cloud's origin.
    pub points: FlatPoints,
    pub surface: SurfaceKind,
    pub boundary: Boundary,
    /// See `Points::has_outward_normals`.
    pub has_outward_normals: bool,
}

impl FlatCloud {
    pub fn new(points: &Points, progress: &dyn Progress) -> Result<Self> {
        let Points { cloud, colors, surface, boundary, has_outward_normals } = points;
        Ok(Self {
            points: FlatPoints::new(cloud, *surface, colors, progress)?,
            surface: *surface,
            boundary: *boundary,
            has_outward_normals: *has_outward_normals,
        })
    }
}
