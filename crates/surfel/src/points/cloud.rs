//! The point cloud: columns of equal length, positions relative to a double-precision origin.

use super::bend::{Morph, Skin, pick};
use crate::math::{Aabb, DVec3, Vec3};

/// As far from zero along an axis, squares of lengths are no longer sure to be finite. Files mark points without
/// a measurement by such numbers.
const NOWHERE: f32 = 1e15;

/// Whether something may be there: neither NaN nor farther away than anything is measured.
pub fn is_somewhere(position: Vec3) -> bool {
    position.abs().cmplt(Vec3::splat(NOWHERE)).all()
}

/// Points as columns. Every column that is present has one entry for each position.
///
/// World is right-handed and Z up; lengths are in the file's unit, metres unless it says otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// World coordinates of the zero of `positions`: a georeferenced scan keeps its full resolution in f32.
    pub origin: DVec3,
    /// Relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Unit length.
    pub normals: Option<Vec<Vec3>>,
    /// World units.
    pub radii: Option<Vec<f32>>,
    /// sRGB-encoded, 16 bits a channel (an 8-bit value v is stored as 257 v).
    pub colors: Option<Vec<[u16; 3]>>,
    /// In the file's own range.
    pub intensity: Option<Vec<f32>>,
    /// ASPRS classes.
    pub classification: Option<Vec<u8>>,
    /// Every other column, by name.
    pub scalars: Vec<Scalar>,
    pub morphs: Vec<Morph>,
    pub skin: Option<Skin>,
}

/// A named column.
#[derive(Clone, Debug, PartialEq)]
pub struct Scalar {
    pub name: String,
    pub values: Values,
}

/// The values of a named column in the narrowest type that holds the file's.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    U8(Vec<u8>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl PointCloud {
    /// A cloud of bare positions about the origin (0, 0, 0).
    pub fn from_positions(positions: Vec<Vec3>) -> Self {
        Self { positions, ..Self::default() }
    }

    pub fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// World coordinates of a point.
    pub fn world_position(&self, point_idx: usize) -> DVec3 {
        self.origin + self.positions[point_idx].as_dvec3()
    }

    /// Bounds of the positions, relative to `origin`.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(self.positions.iter().copied())
    }

    /// The named column, if the cloud has it.
    pub fn scalar(&self, name: &str) -> Option<&Values> {
        self.scalars
            .iter()
            .find(|scalar| scalar.name.eq_ignore_ascii_case(name))
            .map(|scalar| &scalar.values)
    }

    /// The points `indices` names, in that order, with all their columns.
    pub fn subset(&self, indices: &[u32]) -> Self {
        Self {
            origin: self.origin,
            positions: pick(&self.positions, indices),
            normals: self.normals.as_ref().map(|column| pick(column, indices)),
            radii: self.radii.as_ref().map(|column| pick(column, indices)),
            colors: self.colors.as_ref().map(|column| pick(column, indices)),
            intensity: self.intensity.as_ref().map(|column| pick(column, indices)),
            classification: self.classification.as_ref().map(|column| pick(column, indices)),
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
            morphs: self.morphs.iter().map(|morph| morph.subset(indices)).collect(),
            skin: self.skin.as_ref().map(|skin| skin.subset(indices)),
        }
    }

    /// A good origin for points at these world positions: their median, rounded to whole units.
    ///
    /// The median, unlike the middle of the bounds, is not moved by a stray outlier.
    pub fn choose_origin(sample: &[DVec3]) -> DVec3 {
        let median = |axis: usize| {
            let mut values: Vec<f64> =
                sample.iter().map(|p| p[axis]).filter(|x| x.abs() < f64::from(NOWHERE)).collect();
            let middle = values.len() / 2;
            if values.is_empty() {
                0.0
            } else {
                values.select_nth_unstable_by(middle, f64::total_cmp).1.round()
            }
        };
        DVec3::new(median(0), median(1), median(2))
    }

    /// Moves the zero of `positions`; world coordinates stay.
    pub fn rebase(&mut self, origin: DVec3) {
        let shift = self.origin - origin;
        for position in &mut self.positions {
            *position = (position.as_dvec3() + shift).as_vec3();
        }
        self.origin = origin;
    }
}

impl Values {
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::I32(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

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
    use super::*;

    #[test]
    fn the_origin_is_not_moved_by_an_outlier() {
        let mut sample = vec![DVec3::new(500_000.25, 4_900_000.5, 100.0); 9];
        sample.push(DVec3::splat(1e12));
        assert_eq!(PointCloud::choose_origin(&sample), DVec3::new(500_000.0, 4_900_001.0, 100.0));
        assert_eq!(PointCloud::choose_origin(&[]), DVec3::ZERO);
        sample.extend([DVec3::splat(3.4e38); 20]);
        assert_eq!(PointCloud::choose_origin(&sample), DVec3::new(500_000.0, 4_900_001.0, 100.0));
        assert_eq!(PointCloud::choose_origin(&sample[10..]), DVec3::ZERO);
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
