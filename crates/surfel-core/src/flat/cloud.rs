//! Point clouds in the form that kernels read.

use super::deform::Deformed;
use super::point_columns::PointColumns;
use super::points::FlatPoints;
use super::refit::Refit;
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::CloudGeometry;
use crate::surface::{EdgeTest, SurfaceKind};

/// A point cloud with the surface that its points describe.
#[derive(Clone, Debug, Default)]
pub struct FlatCloud {
    /// Points relative to the cloud's origin.
    pub points: FlatPoints,
    /// The shape of the points.
    pub surface: SurfaceKind,
    /// The test that decides where the surface ends.
    pub edge_test: EdgeTest,
    /// True if normals point out of the body that the points enclose.
    pub has_outward_normals: bool,
    /// True if colours may be blended; false if each belongs to one point, as those of classes do.
    pub blends_colors: bool,
    /// Maximum distance between a ray's nearest disc and the discs that decide about its hit: the largest radius,
    /// or 0 if the disc itself is the surface.
    pub max_blend_distance: f32,
}

impl FlatCloud {
    /// Sorts the points into a tree.
    ///
    /// # Errors
    ///
    /// Fails if the cloud has too many points for 32-bit indices, or if `progress` is cancelled.
    pub fn new(geometry: &CloudGeometry, progress: &dyn Progress) -> Result<Self> {
        let cloud = geometry.cloud();
        let (positions, normals, radii) = (cloud.positions(), cloud.normals(), cloud.radii());
        let colors = geometry.colors();
        let columns = PointColumns::new(geometry.surface, positions, normals, radii, colors)?;
        Self::from_columns(columns, geometry, progress)
    }

    /// Sorts deformed points into a tree.
    pub(super) fn deformed(
        geometry: &CloudGeometry,
        deformed: &Deformed,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::from_columns(deformed_columns(deformed, geometry)?, geometry, progress)
    }

    /// Sorts the points of `columns` into a tree; their surface is that of `geometry`.
    fn from_columns(
        columns: PointColumns,
        geometry: &CloudGeometry,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut flat = Self {
            points: FlatPoints::new(columns, progress)?,
            surface: geometry.surface,
            edge_test: geometry.edge_test,
            has_outward_normals: geometry.has_outward_normals,
            blends_colors: geometry.blends_colors,
            max_blend_distance: 0.0,
        };
        flat.set_max_blend_distance();
        Ok(flat)
    }

    /// Moves the points to their deformed positions without changing the tree's structure. If the tree needs a
    /// rebuild, returns a new cloud in a tree of its own.
    pub(super) fn refit(
        &mut self,
        geometry: &CloudGeometry,
        deformed: &Deformed,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let columns = deformed_columns(deformed, geometry)?;
        let refit = self.points.refit(columns);
        self.set_max_blend_distance();
        (refit == Refit::NeedsRebuild)
            .then(|| Self::from_columns(columns, geometry, progress))
            .transpose()
    }

    fn set_max_blend_distance(&mut self) {
        let looks_behind = self.surface.blends_discs() || self.surface == SurfaceKind::Smooth;
        self.max_blend_distance = if looks_behind { self.points.max_radius() } else { 0.0 };
    }
}

fn deformed_columns<'a>(
    deformed: &'a Deformed,
    geometry: &'a CloudGeometry,
) -> Result<PointColumns<'a>> {
    let Deformed { positions, normals, radii, .. } = deformed;
    PointColumns::new(geometry.surface, positions, normals, radii, geometry.colors())
}
