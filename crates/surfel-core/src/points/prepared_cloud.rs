//! Prepared clouds, whose type guarantees that they can be traced.

use super::normals::orient::has_stations;
use super::scan::scan_rings::ScanRings;
use super::structure::vegetation::has_leaves;
use super::{PointCloud, check_count, is_valid_position};
use crate::error::{Error, Result};
use crate::math::{DVec3, Vec3};
use crate::progress::NoProgress;
use rayon::prelude::*;
use std::ops::Deref;

/// A point cloud that can be traced. [`prepare`](super::prepare) returns one, and [`PreparedCloud::new`] makes one
/// of a cloud that needs no preparation.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedCloud {
    /// Invariant: the cloud has radii, one entry for each point in every column, and only valid positions.
    cloud: PointCloud,
    has_leaves: bool,
}

impl PreparedCloud {
    /// Wraps a cloud that can be traced as it is.
    ///
    /// # Errors
    ///
    /// Returns [`Error::MissingColumn`] for a cloud without radii, [`Error::ColumnLength`] for a column that does not
    /// have one entry for each point, [`Error::TooManyPoints`] beyond 32-bit indices, and [`Error::InvalidPosition`] for a
    /// position that is NaN, infinite or too far from the origin (see [`is_valid_position`]).
    pub fn new(cloud: PointCloud) -> Result<Self> {
        let mut prepared = Self::with_leaves(cloud, false)?;
        let cloud = &prepared.cloud;
        let has_rings = || matches!(ScanRings::find(cloud, &NoProgress), Ok(Some(_)));
        let shapes = cloud.structures().zip(cloud.radii.as_ref());
        prepared.has_leaves = shapes
            .is_some_and(|(structures, radii)| has_leaves(cloud, &structures, radii, has_rings));
        Ok(prepared)
    }

    /// Wraps a cloud that can be traced as it is, of which it is known whether its scattered points are leaves.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`PreparedCloud::new`].
    pub(super) fn with_leaves(cloud: PointCloud, has_leaves: bool) -> Result<Self> {
        check_count(cloud.len())?;
        if cloud.radii.is_none() {
            return Err(Error::MissingColumn { column: "radii" });
        }
        for (column, found) in cloud.column_lengths() {
            check_length(column, found, cloud.len())?;
        }
        match cloud.positions.par_iter().position_first(|p| !is_valid_position(*p)) {
            Some(point_idx) => Err(Error::InvalidPosition { point_idx }),
            None => Ok(Self { cloud, has_leaves }),
        }
    }

    /// Creates a cloud without points about an origin.
    pub fn empty(origin: DVec3) -> Self {
        let (normals, radii) = (Some(Vec::new()), Some(Vec::new()));
        let cloud = PointCloud { origin, normals, radii, ..PointCloud::default() };
        Self { cloud, has_leaves: false }
    }

    /// Returns the positions relative to the cloud's origin.
    pub fn positions(&self) -> &[Vec3] {
        &self.cloud.positions
    }

    /// Returns the unit normals, one for each position; none if the cloud has no normals.
    pub fn normals(&self) -> &[Vec3] {
        self.cloud.normals.as_deref().unwrap_or_default()
    }

    /// Returns true if the positions of all stations are known, toward which normals are turned.
    pub fn has_stations(&self) -> bool {
        has_stations(&self.cloud)
    }

    /// Returns true if scattered points are leaves; false if each is a ball.
    pub fn has_leaves(&self) -> bool {
        self.has_leaves
    }

    /// Returns the radii in world units, one for each position.
    pub fn radii(&self) -> &[f32] {
        self.cloud.radii.as_deref().unwrap_or_default()
    }

    /// Multiplies all radii by a factor, those of morph targets included.
    pub fn scale_radii(&mut self, factor: f32) {
        let morphs = self.cloud.morphs.iter_mut().filter_map(|morph| morph.radii.as_mut());
        let radii = self.cloud.radii.iter_mut().chain(morphs).flatten();
        radii.for_each(|radius| *radius *= factor);
    }

    /// Drops the scalar columns of these names.
    pub fn drop_scalars(&mut self, names: &[&str]) {
        self.cloud.scalars.retain(|scalar| !names.contains(&scalar.name.as_str()));
    }

    /// Returns the points at `indices`, in that order, with all their columns. Scattered points stay what they were in the
    /// whole cloud, leaves or balls.
    pub fn subset(&self, indices: &[u32]) -> Self {
        Self { cloud: self.cloud.subset(indices), has_leaves: self.has_leaves }
    }

    /// Unwraps the cloud, for changes that [`PreparedCloud::new`] checks again.
    pub fn into_inner(self) -> PointCloud {
        self.cloud
    }
}

/// Fails unless a column has one entry for each point.
pub(crate) fn check_length(column: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::ColumnLength { column, found, expected }) }
}

impl Default for PreparedCloud {
    fn default() -> Self {
        Self::empty(DVec3::ZERO)
    }
}

impl Deref for PreparedCloud {
    type Target = PointCloud;

    fn deref(&self) -> &PointCloud {
        &self.cloud
    }
}

impl AsRef<PointCloud> for PreparedCloud {
    fn as_ref(&self) -> &PointCloud {
        &self.cloud
    }
}

#[cfg(test)]
mod tests {
    //! Checks of the columns that tracing needs.

    use super::*;
    use crate::points::{STRUCTURE, Scalar, Skin, Structure, Values};

    fn cloud() -> PointCloud {
        PointCloud {
            normals: Some(vec![Vec3::Z; 2]),
            radii: Some(vec![0.5; 2]),
            ..PointCloud::from_positions(vec![Vec3::ZERO, Vec3::X])
        }
    }

    #[test]
    fn complete_clouds_are_accepted() {
        let prepared = PreparedCloud::new(cloud()).unwrap();
        assert_eq!(prepared.positions(), [Vec3::ZERO, Vec3::X]);
        assert_eq!((prepared.normals(), prepared.radii()), (&[Vec3::Z; 2][..], &[0.5; 2][..]));
        assert_eq!(prepared.subset(&[1]).positions(), [Vec3::X]);
        assert_eq!(prepared.into_inner(), cloud());
        assert!(PreparedCloud::new(PreparedCloud::default().into_inner()).is_ok());
        let bare = PreparedCloud::new(PointCloud { normals: None, ..cloud() }).unwrap();
        assert!(bare.normals().is_empty());
    }

    #[test]
    fn a_subset_keeps_what_scattered_points_are() {
        for has_leaves in [true, false] {
            let prepared = PreparedCloud::with_leaves(cloud(), has_leaves).unwrap();
            assert_eq!(prepared.subset(&[1]).has_leaves(), has_leaves);
        }
    }

    #[test]
    fn scattered_points_of_a_loaded_cloud_are_leaves_by_their_class() {
        let codes = [Structure::Scatter, Structure::Surface].map(|structure| structure as u8);
        let structure = Scalar { name: STRUCTURE.into(), values: Values::U8(codes.to_vec()) };
        for (class, expected) in [(5, true), (6, false)] {
            let loaded = PointCloud {
                classification: Some(vec![class; 2]),
                scalars: vec![structure.clone()],
                ..cloud()
            };
            assert_eq!(PreparedCloud::new(loaded).unwrap().has_leaves(), expected);
        }
    }

    #[test]
    fn scalar_columns_are_dropped_by_name() {
        let scalar = |name: &str| Scalar { name: name.into(), values: Values::U8(vec![1; 2]) };
        let scalars = ["row_index", "time"].map(scalar).to_vec();
        let mut prepared = PreparedCloud::new(PointCloud { scalars, ..cloud() }).unwrap();
        prepared.drop_scalars(&["row_index", "column_index"]);
        assert_eq!(prepared.scalars, [scalar("time")]);
    }

    #[test]
    fn incomplete_clouds_are_rejected_with_the_name_of_the_column() {
        let error = |change: fn(&mut PointCloud)| {
            let mut cloud = cloud();
            change(&mut cloud);
            PreparedCloud::new(cloud).unwrap_err().to_string()
        };
        assert_eq!(error(|cloud| cloud.radii = None), "the cloud has no radii");
        let expected = "the column of radii has 1 entry, one for each of 2 points expected";
        assert_eq!(error(|cloud| cloud.radii = Some(vec![0.5])), expected);
        let expected = "the column of joints has 0 entries, one for each of 2 points expected";
        assert_eq!(error(|cloud| cloud.skin = Some(Skin::default())), expected);
        let expected = "point 1 has no valid position";
        assert_eq!(error(|cloud| cloud.positions[1].y = f32::NAN), expected);
    }
}
