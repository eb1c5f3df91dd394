//! A cloud as a geometry of a scene: prepared, coloured, and given a surface.

use super::color::SupportColors;
use crate::error::Result;
use crate::points::{PointCloud, PreparedCloud, Structure, check_length};
use crate::surface::{EdgeTest, OctreeDepth, SurfaceKind, SurfaceOptions};

/// A prepared cloud with one colour for each point, and the surface that its points describe.
#[derive(Clone, Debug)]
pub struct CloudGeometry {
    cloud: PreparedCloud,
    /// sRGB-encoded, one for each point.
    colors: Vec<[u8; 3]>,
    /// The structure of each point; none if all are part of a surface.
    structures: Option<Vec<Structure>>,
    /// The surface that the points describe.
    pub surface: SurfaceKind,
    /// Options of that surface.
    pub options: SurfaceOptions,
    /// The test that rejects hits beyond the edge of the surface.
    pub edge_test: EdgeTest,
    /// Depth of the cells, if the surface is an octree.
    pub octree_depth: OctreeDepth,
    /// True if colours of neighbouring points may be blended; false if each belongs to one point, as those of
    /// classes do.
    pub blends_colors: bool,
    /// Colours of hits by their support, instead of the points' own.
    pub support_colors: Option<SupportColors>,
    /// True if trained Gaussians show the colours that they were trained with, which depend on the direction; false if
    /// they show those of this geometry.
    pub shows_trained_colors: bool,
    /// True if normals point out of the body that the points enclose, which gives glass an interior. If not,
    /// every other hit of a ray enters the body (Schaufler and Jensen 2000).
    pub has_outward_normals: bool,
    /// True if normals point to the side from which the surface was seen. Then rays that would meet a back face behind
    /// a slit end at the slit.
    pub has_front_sides: bool,
}

impl Default for CloudGeometry {
    fn default() -> Self {
        Self {
            cloud: PreparedCloud::default(),
            colors: Vec::new(),
            structures: None,
            surface: SurfaceKind::default(),
            options: SurfaceOptions::default(),
            edge_test: EdgeTest::default(),
            octree_depth: OctreeDepth::default(),
            blends_colors: true,
            support_colors: None,
            shows_trained_colors: true,
            has_outward_normals: false,
            has_front_sides: false,
        }
    }
}

impl CloudGeometry {
    /// Makes a geometry of the default surface with sRGB-encoded `colors`.
    ///
    /// # Errors
    ///
    /// Fails with [`Error::ColumnLength`](crate::Error::ColumnLength) unless there is one colour for each
    /// point.
    pub fn new(cloud: PreparedCloud, colors: Vec<[u8; 3]>) -> Result<Self> {
        check_length("colours", colors.len(), cloud.len())?;
        Ok(Self { colors, ..Self::without_colors(cloud) })
    }

    /// Makes a geometry of the default surface with one sRGB-encoded colour for all points.
    pub fn with_uniform_color(cloud: PreparedCloud, color: [u8; 3]) -> Self {
        let colors = vec![color; cloud.len()];
        Self { colors, ..Self::without_colors(cloud) }
    }

    fn without_colors(cloud: PreparedCloud) -> Self {
        let structures = structures(&cloud);
        Self { structures, cloud, ..Self::default() }
    }

    /// Returns the structure of each point, or none if all points are part of the surface.
    pub fn structures(&self) -> Option<&[Structure]> {
        let is_split = self.surface.is_continuous();
        self.structures.as_deref().filter(|_| is_split)
    }

    /// Returns the points.
    pub fn cloud(&self) -> &PreparedCloud {
        &self.cloud
    }

    /// Returns the sRGB-encoded colours, one for each point.
    pub fn colors(&self) -> &[[u8; 3]] {
        &self.colors
    }

    /// Keeps the points at `indices`, in that order.
    pub(super) fn retain(&mut self, indices: &[u32]) {
        self.cloud = self.cloud.subset(indices);
        self.structures = structures(&self.cloud);
        self.colors = indices.iter().map(|i| self.colors[*i as usize]).collect();
    }

    /// Frees the points; the origin and the surface stay.
    pub(super) fn clear(&mut self) {
        self.cloud = PreparedCloud::empty(self.cloud.origin);
        self.colors = Vec::new();
        self.structures = None;
    }
}

/// Returns the structures of a cloud, unless all of its points are part of a surface.
fn structures(cloud: &PointCloud) -> Option<Vec<Structure>> {
    cloud.structures().filter(|all| all.iter().any(|own| *own != Structure::Surface))
}

impl AsRef<PointCloud> for CloudGeometry {
    fn as_ref(&self) -> &PointCloud {
        &self.cloud
    }
}

#[cfg(test)]
mod tests {
    //! Clouds and colours of different lengths are rejected.

    use super::*;
    use crate::error::Error;

    #[test]
    fn a_cloud_needs_one_color_for_each_point() {
        let cloud = PreparedCloud::default();
        assert!(CloudGeometry::new(cloud.clone(), Vec::new()).is_ok());
        let error = CloudGeometry::new(cloud, vec![[0; 3]]).unwrap_err();
        assert_eq!(error, Error::ColumnLength { column: "colours", found: 1, expected: 0 });
    }
}
