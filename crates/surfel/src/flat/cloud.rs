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
    /// How far behind a ray's nearest disc others may be that are blended with it: the greatest radius, or
    /// nothing where none are.
    pub reach: f32,
}

impl FlatCloud {
    pub fn new(points: &Points, progress: &dyn Progress) -> Result<Self> {
        let Points { cloud, colors, surface, boundary, has_outward_normals } = points;
        let points = FlatPoints::new(cloud, *surface, colors, progress)?;
        Ok(Self {
            reach: if surface.is_gathered() { points.greatest_radius() } else { 0.0 },
            points,
            surface: *surface,
            boundary: *boundary,
            has_outward_normals: *has_outward_normals,
        })
    }
}
