//! Trained Gaussians (Kerbl et al., 3D Gaussian Splatting, 2023): the columns that describe them, as their files name and
//! encode them.

use super::point_cloud::{PointCloud, Values, is_valid_position};
use crate::math::{Quat, Vec3};

/// The columns without which points are no trained Gaussians: colour of all directions, logit of the opacity, logarithms
/// of the standard deviations, and rotation (w, x, y, z).
pub const GAUSSIAN_COLUMNS: [&str; 11] = [
    "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
    "rot_2", "rot_3",
];
/// Number of spherical harmonics of degrees 0 to 3.
pub const MAX_HARMONICS: usize = 16;
/// Maximum number of columns `f_rest_0` and following: three channels of all harmonics but that of degree 0.
pub const MAX_REST_COLUMNS: usize = 3 * (MAX_HARMONICS - 1);
/// The spherical harmonic of degree 0, which is constant: 1 / (2 sqrt(pi)).
pub const HARMONIC_0: f64 = 0.282_094_791_773_878_14;
/// Minimum opacity of a Gaussian that is shown as a disc: fainter ones are haze between surfaces.
pub const MIN_DISC_OPACITY: f32 = 0.1;
/// Maximum standard deviation: larger ones have no squares.
const MAX_DEVIATION: f32 = 1e15;

/// A Gaussian in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Centre.
    pub center: Vec3,
    /// Unit rotation from the Gaussian's axes to the cloud.
    pub rotation: Quat,
    /// Standard deviations along the axes.
    pub deviations: Vec3,
    /// Opacity of a ray through the centre, from 0 to 1.
    pub opacity: f32,
}

impl Gaussian {
    /// Returns the axis of the least deviation, a unit vector.
    pub fn thinnest_axis(&self) -> Vec3 {
        let [x, y, z] = self.deviations.to_array();
        let axis = match (x <= y, x <= z, y <= z) {
            (true, true, _) => Vec3::X,
            (false, _, true) => Vec3::Y,
            _ => Vec3::Z,
        };
        self.rotation * axis
    }
}

/// Returns the name of the column of a harmonic beyond degree 0.
pub fn rest_column(index: usize) -> String {
    format!("f_rest_{index}")
}

/// Returns the number of harmonics that a file with `n_rest` columns `f_rest_*` has for each channel, 1 to 16, or none if
/// that number belongs to no degree.
pub fn n_harmonics(n_rest: usize) -> Option<usize> {
    [0, 9, 24, MAX_REST_COLUMNS].contains(&n_rest).then_some(n_rest / 3 + 1)
}

/// The columns of a cloud of trained Gaussians.
pub struct GaussianColumns<'a> {
    positions: &'a [Vec3],
    dc: [&'a Values; 3],
    /// One channel after the other.
    rest: Vec<&'a Values>,
    opacity: &'a Values,
    scales: [&'a Values; 3],
    /// In the order w, x, y, z.
    rotation: [&'a Values; 4],
}

impl<'a> GaussianColumns<'a> {
    /// Returns the columns of a cloud, or none if it lacks one. Harmonics count if those of a whole degree are there.
    pub fn new(cloud: &'a PointCloud) -> Option<Self> {
        let column = |index: usize| cloud.scalar(GAUSSIAN_COLUMNS[index]);
        let rest: Vec<&Values> =
            (0..MAX_REST_COLUMNS).map_while(|i| cloud.scalar(&rest_column(i))).collect();
        let n_rest = n_harmonics(rest.len()).map_or(0, |_| rest.len());
        Some(Self {
            positions: &cloud.positions,
            dc: [column(0)?, column(1)?, column(2)?],
            rest: rest[..n_rest].to_vec(),
            opacity: column(3)?,
            scales: [column(4)?, column(5)?, column(6)?],
            rotation: [column(7)?, column(8)?, column(9)?, column(10)?],
        })
    }

    /// Returns the number of harmonics of each channel: 1, 4, 9 or 16.
    pub fn n_harmonics(&self) -> usize {
        self.rest.len() / 3 + 1
    }

    /// Returns a point's Gaussian, or none if one of its numbers is not finite, a deviation is above 1e15, all are 0, or
    /// the rotation has the length 0.
    pub fn gaussian(&self, point_idx: usize) -> Option<Gaussian> {
        let value = |column: &Values| column.get(point_idx);
        let center = self.positions[point_idx];
        let deviations = Vec3::from_array(self.scales.map(|scale| value(scale).exp() as f32));
        let [w, x, y, z] = self.rotation.map(|column| value(column) as f32);
        let rotation = Quat::from_xyzw(x, y, z, w);
        let length = rotation.length();
        let opacity = (1.0 / (1.0 + (-value(self.opacity)).exp())) as f32;
        let has_size = deviations.cmple(Vec3::splat(MAX_DEVIATION)).all()
            && 0.0 < deviations.max_element()
            && self.dc.iter().all(|column| value(column).is_finite());
        let is_valid = is_valid_position(center)
            && has_size
            && 0.0 < length
            && length.is_finite()
            && !opacity.is_nan();
        let rotation = rotation / length;
        is_valid.then_some(Gaussian { center, rotation, deviations, opacity })
    }

    /// Returns a point's sRGB-encoded colour, the mean of all directions; 0 or more, and not limited above.
    pub fn color(&self, point_idx: usize) -> [f32; 3] {
        self.dc.map(|column| (0.5 + HARMONIC_0 * column.get(point_idx)).max(0.0) as f32)
    }

    /// Writes the coefficients of a point's harmonics, one channel after the other. Those that are not finite are 0.
    pub fn coefficients(&self, point_idx: usize, coefficients: &mut [f32]) {
        let n_harmonics = self.n_harmonics();
        let finite = |column: &Values| {
            let value = column.get(point_idx) as f32;
            if value.is_finite() { value } else { 0.0 }
        };
        for (channel, all) in coefficients.chunks_mut(n_harmonics).enumerate() {
            let n_rest = n_harmonics - 1;
            all[0] = finite(self.dc[channel]);
            let rest = &self.rest[channel * n_rest..(channel + 1) * n_rest];
            all[1..].iter_mut().zip(rest).for_each(|(value, column)| *value = finite(column));
        }
    }
}

impl PointCloud {
    /// Returns the indices of the points that other surfaces than Gaussians show; none if these are all.
    pub fn disc_indices(&self) -> Option<Vec<u32>> {
        let columns = GaussianColumns::new(self)?;
        let is_shown = |i: &u32| {
            let gaussian = columns.gaussian(*i as usize);
            gaussian.is_some_and(|gaussian| MIN_DISC_OPACITY <= gaussian.opacity)
        };
        Some((0..self.len() as u32).filter(is_shown).collect())
    }

    /// Returns true if the points are trained Gaussians.
    pub fn has_gaussians(&self) -> bool {
        GAUSSIAN_COLUMNS.iter().all(|name| self.scalar(name).is_some())
    }
}

#[cfg(test)]
mod tests {
    //! Columns are decoded, and those that describe no Gaussian are told apart.

    use super::*;
    use crate::points::Scalar;

    fn cloud(columns: &[(&str, f32)], n_rest: usize) -> PointCloud {
        let mut cloud = PointCloud::from_positions(vec![Vec3::ONE]);
        let mut add = |name: String, value: f32| {
            cloud.scalars.push(Scalar { name, values: Values::F32(vec![value]) });
        };
        for name in GAUSSIAN_COLUMNS {
            let own = columns.iter().find(|(column, _)| *column == name);
            add(name.to_owned(), own.map_or(0.0, |(_, value)| *value));
        }
        (0..n_rest).for_each(|i| add(rest_column(i), i as f32));
        cloud
    }

    #[test]
    fn columns_are_decoded() {
        let cloud = cloud(&[("opacity", 3f32.ln()), ("scale_1", -1.0), ("rot_3", -2.0)], 24);
        let columns = GaussianColumns::new(&cloud).unwrap();
        let gaussian = columns.gaussian(0).unwrap();
        assert!((gaussian.opacity - 0.75).abs() < 1e-6);
        assert_eq!(gaussian.deviations, Vec3::new(1.0, (-1f64).exp() as f32, 1.0));
        assert_eq!(gaussian.rotation, Quat::from_xyzw(0.0, 0.0, -1.0, 0.0));
        assert!(gaussian.thinnest_axis().distance(-Vec3::Y) < 1e-6);
        let mut coefficients = [0.0; 27];
        columns.coefficients(0, &mut coefficients);
        // Degree 2: the second channel begins behind the eight columns of the first.
        assert_eq!((coefficients[8], coefficients[9], coefficients[10]), (7.0, 0.0, 8.0));
        assert!(cloud.has_gaussians() && !PointCloud::default().has_gaussians());
    }

    #[test]
    fn incomplete_degrees_are_ignored() {
        let numbers = [(0, 1), (1, 1), (9, 4), (23, 1), (24, 9), (45, 16)];
        for (n_rest, expected) in numbers {
            let cloud = cloud(&[], n_rest);
            assert_eq!(GaussianColumns::new(&cloud).unwrap().n_harmonics(), expected, "{n_rest}");
        }
    }

    #[test]
    fn broken_gaussians_are_none() {
        let turned = ("rot_0", 1.0);
        let valid = |columns: &[(&str, f32)]| {
            let cloud = cloud(columns, 0);
            GaussianColumns::new(&cloud).unwrap().gaussian(0).is_some()
        };
        assert!(valid(&[turned]));
        assert!(valid(&[turned, ("opacity", 1e30)]) && valid(&[turned, ("opacity", -1e30)]));
        assert!(valid(&[turned, ("scale_2", -1e30)]));
        assert!(!valid(&[]) && !valid(&[("rot_0", f32::INFINITY)]));
        for name in ["scale_0", "opacity", "f_dc_1", "rot_2"] {
            assert!(!valid(&[turned, (name, f32::NAN)]), "{name}");
        }
        assert!(
            !valid(&[turned, ("scale_0", f32::INFINITY)]) && !valid(&[turned, ("scale_0", 40.0)])
        );
        assert!(!valid(&[turned, ("scale_0", -1e9), ("scale_1", -1e9), ("scale_2", -1e9)]));
    }
}
