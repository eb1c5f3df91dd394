//! A cloud as kernels read it: its points, and what surface they have.

use super::deform::Bent;
use super::points::FlatPoints;
use super::refit::Refit;
use crate::error::Result;
use crate::points::PointCloud;
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
        Self::of(&points.cloud, points, progress)
    }

    /// `points` as they are bent.
    pub(super) fn bent(points: &Points, bent: Bent, progress: &dyn Progress) -> Result<Self> {
        Self::of(&cloud_of(bent), points, progress)
    }

    /// The places of `cloud`, all else of `points`.
    fn of(cloud: &PointCloud, points: &Points, progress: &dyn Progress) -> Result<Self> {
        let Points { colors, surface, boundary, has_outward_normals, .. } = points;
        let mut flat = Self {
            points: FlatPoints::new(cloud, *surface, colors, progress)?,
            surface: *surface,
            boundary: *boundary,
            has_outward_normals: *has_outward_normals,
            reach: 0.0,
        };
        flat.set_reach();
        Ok(flat)
    }

    /// Moves the points to where they are bent to now, in the tree that they have. If that is unfit, gives them
    /// in a tree of their own.
    pub(super) fn refit(
        &mut self,
        points: &Points,
        bent: Bent,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let cloud = cloud_of(bent);
        let refit = self.points.refit(&cloud, self.surface, &points.colors)?;
        self.set_reach();
        (refit == Refit::Unfit).then(|| Self::of(&cloud, points, progress)).transpose()
    }

    fn set_reach(&mut self) {
        let is_gathered = self.surface.is_gathered();
        self.reach = if is_gathered { self.points.greatest_radius() } else { 0.0 };
    }
}

fn cloud_of(Bent { positions, normals, radii, .. }: Bent) -> PointCloud {
    let has = |n: usize| 0 < n && n == positions.len();
    PointCloud {
        normals: has(normals.len()).then_some(normals),
        radii: has(radii.len()).then_some(radii),
        ..PointCloud::from_positions(positions)
    }
}
