//! Point clouds as columns of equal length, with positions relative to a double-precision origin.

use super::deformation::{Morph, Skin, pick};
use super::kept_points::KeptPoints;
use super::scan_station::{STATION, ScanStation};
use crate::error::{Error, Result};
use crate::math::{Aabb, DVec3, Vec3, median};

/// Maximum magnitude of a coordinate whose squares are sure to be finite. Files mark points without a measurement
/// by larger numbers.
const MAX_COORDINATE: f32 = 1e15;

/// Returns true if all coordinates are numbers below 1e15 in magnitude.
pub fn is_valid_position(position: Vec3) -> bool {
    position.abs().cmplt(Vec3::splat(MAX_COORDINATE)).all()
}

/// Fails if 32-bit indices do not suffice for so many points. The largest index marks an unused entry.
pub(crate) fn check_count(n_points: usize) -> Result<()> {
    let limit = u32::MAX as usize;
    if limit <= n_points {
        return Err(Error::TooManyPoints { found: n_points, limit: limit - 1 });
    }
    Ok(())
}

/// A point cloud as columns. Every column that is present has one entry for each position.
///
/// World coordinates are right-handed with Z up; lengths are in the file's unit, metres unless it says otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// World coordinates of the zero of `positions`, which lets f32 keep the full resolution of a georeferenced
    /// scan.
    pub origin: DVec3,
    /// Positions relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Option<Vec<Vec3>>,
    /// Radii in world units.
    pub radii: Option<Vec<f32>>,
    /// sRGB-encoded colours of 16 bits per channel; an 8-bit value v is stored as 257 v.
    pub colors: Option<Vec<[u16; 3]>>,
    /// Intensities in the file's own range.
    pub intensity: Option<Vec<f32>>,
    /// ASPRS classes.
    pub classification: Option<Vec<u8>>,
    /// Index of each point among those that were read, kept by all steps that drop or reorder points.
    pub source_indices: Option<Vec<u32>>,
    /// All other columns, which have names.
    pub scalars: Vec<Scalar>,
    /// Places from which the points were measured. If there are several, the scalar column [`STATION`] says which is
    /// whose.
    pub stations: Vec<ScanStation>,
    /// Morph targets.
    pub morphs: Vec<Morph>,
    /// Joints that move the points.
    pub skin: Option<Skin>,
}

/// A named column.
#[derive(Clone, Debug, PartialEq)]
pub struct Scalar {
    /// Name of the column, as in its file.
    pub name: String,
    /// Values of the column.
    pub values: Values,
}

/// The values of a named column in the narrowest type that holds the file's.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Unsigned 8-bit integers.
    U8(Vec<u8>),
    /// Unsigned 16-bit integers.
    U16(Vec<u16>),
    /// Signed 32-bit integers.
    I32(Vec<i32>),
    /// Single-precision numbers.
    F32(Vec<f32>),
    /// Double-precision numbers.
    F64(Vec<f64>),
}

/// The scan of each point of a cloud.
pub(crate) enum ScanOfPoint<'a> {
    /// All points are of the only scan.
    Single,
    /// The column of scans.
    Column(&'a [u16]),
}

impl ScanOfPoint<'_> {
    /// Returns the index of the station of a point; there is no such station if it is unknown.
    pub(crate) fn get(&self, point_idx: usize) -> usize {
        match self {
            Self::Single => 0,
            Self::Column(indices) => indices[point_idx].into(),
        }
    }
}

impl PointCloud {
    /// Creates a cloud of positions about the origin (0, 0, 0), without other columns.
    pub fn from_positions(positions: Vec<Vec3>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Returns true if the cloud has no points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Returns the world coordinates of a point.
    pub fn world_position(&self, point_idx: usize) -> DVec3 {
        self.origin + self.positions[point_idx].as_dvec3()
    }

    /// Returns the bounds of the valid positions, relative to `origin`.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(self.positions.iter().copied().filter(|p| is_valid_position(*p)))
    }

    /// Returns the name and the length of each column that is present.
    pub(crate) fn column_lengths(&self) -> impl Iterator<Item = (&'static str, usize)> {
        let columns = [
            ("normals", self.normals.as_ref().map(Vec::len)),
            ("radii", self.radii.as_ref().map(Vec::len)),
            ("colours", self.colors.as_ref().map(Vec::len)),
            ("intensities", self.intensity.as_ref().map(Vec::len)),
            ("classes", self.classification.as_ref().map(Vec::len)),
            ("source indices", self.source_indices.as_ref().map(Vec::len)),
            ("joints", self.skin.as_ref().map(|skin| skin.joints.len())),
            ("joint weights", self.skin.as_ref().map(|skin| skin.weights.len())),
        ];
        let scalars = self.scalars.iter().map(|scalar| ("scalars", Some(scalar.values.len())));
        let morphs = self.morphs.iter().flat_map(|morph| {
            [
                ("morph target positions", Some(morph.positions.len())),
                ("morph target normals", morph.normals.as_ref().map(Vec::len)),
                ("morph target radii", morph.radii.as_ref().map(Vec::len)),
            ]
        });
        let all = columns.into_iter().chain(scalars).chain(morphs);
        all.filter_map(|(column, length)| Some((column, length?)))
    }

    /// Returns the scalar column of this name in any case, if the cloud has it.
    pub fn scalar(&self, name: &str) -> Option<&Values> {
        self.scalars
            .iter()
            .find(|scalar| scalar.name.eq_ignore_ascii_case(name))
            .map(|scalar| &scalar.values)
    }

    /// Returns the scan of each point, if the cloud tells it.
    pub(crate) fn scan_of_point(&self) -> Option<ScanOfPoint<'_>> {
        match (&self.stations[..], self.scalar(STATION)) {
            ([_], None) => Some(ScanOfPoint::Single),
            ([_, ..], Some(Values::U16(indices))) => Some(ScanOfPoint::Column(indices)),
            _ => None,
        }
    }

    /// Returns the station of a point, if it is known.
    pub fn station_of(&self, point_idx: usize) -> Option<&ScanStation> {
        self.stations.get(self.scan_of_point()?.get(point_idx))
    }

    /// Returns the points at `indices`, in that order, with all their columns.
    pub fn subset(&self, indices: &[u32]) -> Self {
        Self {
            origin: self.origin,
            positions: pick(&self.positions, indices),
            normals: self.normals.as_ref().map(|column| pick(column, indices)),
            radii: self.radii.as_ref().map(|column| pick(column, indices)),
            colors: self.colors.as_ref().map(|column| pick(column, indices)),
            intensity: self.intensity.as_ref().map(|column| pick(column, indices)),
            classification: self.classification.as_ref().map(|column| pick(column, indices)),
            source_indices: self.source_indices.as_ref().map(|column| pick(column, indices)),
            scalars: self
                .scalars
                .iter()
                .map(|Scalar { name, values }| Scalar {
                    name: name.clone(),
                    values: match values {
                        Values::U8(v) => Values::U8(pick(v, indices)),
                        Values::U16(v) => Values::U16(pick(v, indices)),
                        Values::I32(v) => Values::I32(pick(v, indices)),
                        Values::F32(v) => Values::F32(pick(v, indices)),
                        Values::F64(v) => Values::F64(pick(v, indices)),
                    },
                })
                .collect(),
            stations: self.stations.clone(),
            morphs: self.morphs.iter().map(|morph| morph.subset(indices)).collect(),
            skin: self.skin.as_ref().map(|skin| skin.subset(indices)),
        }
    }

    /// Drops the points from `start` on for which `keep` is false, in place.
    pub fn retain_from(&mut self, start: usize, keep: &[bool]) {
        let kept = KeptPoints::new(start, keep);
        rayon::scope(|scope| {
            kept.retain_in(scope, &mut self.positions);
            kept.retain_in(scope, self.normals.as_mut());
            kept.retain_in(scope, self.radii.as_mut());
            kept.retain_in(scope, self.colors.as_mut());
            kept.retain_in(scope, self.intensity.as_mut());
            kept.retain_in(scope, self.classification.as_mut());
            kept.retain_in(scope, self.source_indices.as_mut());
            for scalar in &mut self.scalars {
                match &mut scalar.values {
                    Values::U8(column) => kept.retain_in(scope, column),
                    Values::U16(column) => kept.retain_in(scope, column),
                    Values::I32(column) => kept.retain_in(scope, column),
                    Values::F32(column) => kept.retain_in(scope, column),
                    Values::F64(column) => kept.retain_in(scope, column),
                }
            }
            for Morph { positions, normals, tangents, radii } in &mut self.morphs {
                kept.retain_in(scope, positions);
                kept.retain_in(scope, normals.as_mut());
                kept.retain_in(scope, tangents.as_mut());
                kept.retain_in(scope, radii.as_mut());
            }
            if let Some(Skin { joints, weights }) = &mut self.skin {
                kept.retain_in(scope, joints);
                kept.retain_in(scope, weights);
            }
        });
    }

    /// Returns an origin for points at these world positions: their median, rounded to whole units.
    ///
    /// An outlier does not move the median, as it does the middle of the bounds.
    pub fn choose_origin(sample: &[DVec3]) -> DVec3 {
        let rounded_median = |axis: usize| {
            let values = sample.iter().map(|p| p[axis]);
            median(values.filter(|x| x.abs() < f64::from(MAX_COORDINATE))).map_or(0.0, f64::round)
        };
        DVec3::new(rounded_median(0), rounded_median(1), rounded_median(2))
    }

    /// Moves the zero of `positions` to `origin`; world coordinates stay.
    pub fn rebase(&mut self, origin: DVec3) {
        let shift = self.origin - origin;
        for position in &mut self.positions {
            *position = (position.as_dvec3() + shift).as_vec3();
        }
        self.origin = origin;
    }
}

impl AsRef<PointCloud> for PointCloud {
    fn as_ref(&self) -> &PointCloud {
        self
    }
}

impl Values {
    /// Returns the number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::I32(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    /// Returns true if there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the value of a point.
    pub fn get(&self, point_idx: usize) -> f64 {
        match self {
            Self::U8(v) => v[point_idx].into(),
            Self::U16(v) => v[point_idx].into(),
            Self::I32(v) => v[point_idx].into(),
            Self::F32(v) => v[point_idx].into(),
            Self::F64(v) => v[point_idx],
        }
    }
}

#[cfg(test)]
mod tests {
    //! Origins of clouds.

    use super::*;

    #[test]
    fn an_outlier_does_not_move_the_origin() {
        let mut sample = vec![DVec3::new(500_000.25, 4_900_000.5, 100.0); 9];
        sample.push(DVec3::splat(1e12));
        assert_eq!(PointCloud::choose_origin(&sample), DVec3::new(500_000.0, 4_900_001.0, 100.0));
        assert_eq!(PointCloud::choose_origin(&[]), DVec3::ZERO);
        sample.extend([DVec3::splat(3.4e38); 20]);
        assert_eq!(PointCloud::choose_origin(&sample), DVec3::new(500_000.0, 4_900_001.0, 100.0));
        assert_eq!(PointCloud::choose_origin(&sample[10..]), DVec3::ZERO);
    }

    #[test]
    fn points_that_stay_keep_all_their_columns() {
        let cloud = |values: &[f32]| {
            let vectors: Vec<Vec3> = values.iter().copied().map(Vec3::splat).collect();
            let indices: Vec<u32> = values.iter().map(|value| *value as u32).collect();
            let bytes = || values.iter().map(|value| *value as u8).collect::<Vec<u8>>();
            let morph = Morph {
                positions: vectors.clone(),
                normals: Some(vectors.clone()),
                tangents: Some(vectors.clone()),
                radii: Some(values.to_vec()),
            };
            PointCloud {
                normals: Some(vectors.clone()),
                radii: Some(values.to_vec()),
                colors: Some(indices.iter().map(|i| [*i as u16; 3]).collect()),
                intensity: Some(values.to_vec()),
                classification: Some(bytes()),
                source_indices: Some(indices.clone()),
                scalars: vec![Scalar { name: "a".into(), values: Values::U8(bytes()) }],
                morphs: vec![morph],
                skin: Some(Skin {
                    joints: indices.iter().map(|i| [*i as u16; 4]).collect(),
                    weights: values.iter().map(|value| [*value; 4]).collect(),
                }),
                ..PointCloud::from_positions(vectors)
            }
        };
        let mut kept = cloud(&[0.0, 1.0, 2.0, 3.0, 4.0]);
        kept.retain_from(1, &[false, true, true, false]);
        assert!(kept == cloud(&[0.0, 2.0, 3.0]), "{kept:?}");
    }

    #[test]
    fn rebasing_keeps_world_positions() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::new(1.5, -2.25, 3.0)]);
        cloud.origin = DVec3::new(500_000.0, 0.0, 0.0);
        let before = cloud.world_position(0);
        cloud.rebase(DVec3::new(500_010.0, 7.0, 0.0));
        assert_eq!(cloud.world_position(0), before);
    }
}
