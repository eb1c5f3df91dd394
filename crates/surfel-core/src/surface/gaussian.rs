//! Gaussians: each point is an ellipsoid of light that fades from its centre (Moenne-Loccoz et al., 3D Gaussian Ray
//! Tracing, 2024).

use crate::math::{Aabb, Floats, Mat3, Vec3, Vec3Lanes};
use crate::points::{Gaussian, HARMONIC_0, MAX_HARMONICS};

/// Alpha below which a Gaussian is left out, as where it was trained.
pub const MIN_ALPHA: f32 = 1.0 / 255.0;
/// Maximum alpha of a Gaussian.
pub const MAX_ALPHA: f32 = 0.99;
/// Transmittance below which what lies farther along a ray is left out.
pub const MIN_GAUSSIAN_TRANSMITTANCE: f32 = 1e-3;
/// Least deviation of an axis relative to the largest: flat Gaussians have no inverse.
const MIN_FLATNESS: f32 = 1e-4;
/// Relative margin of bounds for rounding here and in the kernels.
const BOUNDS_MARGIN: f32 = 1e-3;

/// A Gaussian as rays meet it: in coordinates in which it is a unit sphere.
#[derive(Clone, Copy, Debug)]
pub struct WhitenedGaussian {
    /// Centre.
    pub center: Vec3,
    /// Rows of the matrix S^-1 R^T from the cloud to coordinates in which all deviations are 1.
    pub rows: [Vec3; 3],
    /// Square of the distance from the centre, in deviations, at which alpha is `MIN_ALPHA`: 2 ln(opacity / `MIN_ALPHA`).
    pub max_squared: f32,
}

impl WhitenedGaussian {
    /// Returns the Gaussian, or none if it is nowhere as opaque as `MIN_ALPHA`.
    pub fn new(gaussian: &Gaussian) -> Option<Self> {
        let max_squared = 2.0 * (gaussian.opacity / MIN_ALPHA).ln();
        if max_squared.is_nan() || max_squared <= 0.0 {
            return None;
        }
        let axes = Mat3::from_quat(gaussian.rotation);
        let deviations = thickened(gaussian.deviations);
        let rows = [0, 1, 2].map(|axis| axes.col(axis) / deviations[axis]);
        Some(Self { center: gaussian.center, rows, max_squared })
    }

    /// Returns the largest deviation.
    pub fn max_deviation(&self) -> f32 {
        self.rows.iter().map(|row| 1.0 / row.length()).fold(0.0, f32::max)
    }

    /// Returns the unit axis along which the Gaussian is thinnest.
    pub fn thinnest_axis(&self) -> Vec3 {
        let [x, y, z] = self.rows;
        let longer = if x.length_squared() < y.length_squared() { y } else { x };
        let longest = if longer.length_squared() < z.length_squared() { z } else { longer };
        longest.normalize()
    }
}

/// Returns the bounding box of all positions at which a ray meets a Gaussian: m sqrt(Sigma_kk) around its centre.
pub fn bounds(gaussian: &Gaussian) -> Aabb {
    let max_squared = 2.0 * (gaussian.opacity / MIN_ALPHA).ln();
    let axes = Mat3::from_quat(gaussian.rotation);
    let deviations = thickened(gaussian.deviations);
    let scaled = [0, 1, 2].map(|axis| axes.col(axis) * deviations[axis]);
    let variances = scaled.iter().map(|axis| axis * axis).sum::<Vec3>();
    let extent = (max_squared.max(0.0) * variances).map(f32::sqrt);
    let extent = (1.0 + BOUNDS_MARGIN) * extent + 4.0 * f32::EPSILON * gaussian.center.abs();
    Aabb { min: gaussian.center - extent, max: gaussian.center + extent }
}

fn thickened(deviations: Vec3) -> Vec3 {
    deviations.max(Vec3::splat(MIN_FLATNESS * deviations.max_element()))
}

/// Gaussians in the lanes of a kernel.
pub struct GaussianLanes<F> {
    /// Centres relative to the ray's origin.
    pub center: Vec3Lanes<F>,
    /// Rows of the matrices to coordinates in which all deviations are 1.
    pub rows: [Vec3Lanes<F>; 3],
}

impl<F: Floats> GaussianLanes<F> {
    /// Returns the distance along a ray of this unit direction at which each Gaussian is densest, and the square of the
    /// distance from its centre there, in deviations.
    #[inline(always)]
    pub fn intersect(&self, direction: Vec3Lanes<F>) -> (F, F) {
        // The position of the ray nearest to the centre comes first: from far away, that of the ray's origin would
        // drown the distance from the centre in rounding.
        let nearest = self.center.dot(direction);
        let offset = direction.scaled(nearest).minus(self.center);
        let (offset, along) = (self.whitened(offset), self.whitened(direction));
        let squared_length = along.dot(along);
        let across = offset.cross(along);
        let distance = nearest - offset.dot(along) / squared_length;
        (distance, across.dot(across) / squared_length)
    }

    /// Returns a vector in the coordinates in which all deviations are 1.
    #[inline(always)]
    fn whitened(&self, vector: Vec3Lanes<F>) -> Vec3Lanes<F> {
        let [x, y, z] = self.rows;
        Vec3Lanes { x: x.dot(vector), y: y.dot(vector), z: z.dot(vector) }
    }
}

/// Returns the alpha of a Gaussian that a ray passes at this squared distance from its centre, in deviations.
#[inline]
pub fn alpha(max_squared: f32, squared: f32) -> f32 {
    (MIN_ALPHA * (0.5 * (max_squared - squared)).exp()).min(MAX_ALPHA)
}

/// Factor of the spherical harmonics of degree 1.
pub const D1: f32 = 0.488_602_5;
/// Factors of the spherical harmonics of degree 2.
pub const D2: [f32; 3] = [1.092_548_5, 0.315_391_57, 0.546_274_24];
/// Factors of the spherical harmonics of degree 3.
pub const D3: [f32; 5] = [0.590_043_6, 2.890_611_4, 0.457_045_8, 0.373_176_34, 1.445_305_7];

/// Returns the real spherical harmonics of degrees 0 to 3 in a unit direction, in the order and with the signs of trained
/// files.
#[inline]
pub fn spherical_harmonics(direction: Vec3) -> [f32; MAX_HARMONICS] {
    let Vec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        HARMONIC_0 as f32,
        -D1 * y,
        D1 * z,
        -D1 * x,
        D2[0] * x * y,
        -D2[0] * y * z,
        D2[1] * (2.0 * zz - xx - yy),
        -D2[0] * x * z,
        D2[2] * (xx - yy),
        -D3[0] * y * (3.0 * xx - yy),
        D3[1] * x * y * z,
        -D3[2] * y * (4.0 * zz - xx - yy),
        D3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -D3[2] * x * (4.0 * zz - xx - yy),
        D3[4] * z * (xx - yy),
        -D3[0] * x * (xx - 3.0 * yy),
    ]
}

#[cfg(test)]
mod tests {
    //! Closed forms of bounds, rays and harmonics.

    use super::*;
    use crate::math::{Quat, Random};

    fn gaussian(random: &mut Random) -> Gaussian {
        let mut number = || random.next_gaussian() as f32;
        let rotation = Quat::from_xyzw(number(), number(), number(), number()).normalize();
        let center = Vec3::new(number(), number(), number());
        let deviations = Vec3::new(number(), number(), number()).exp();
        Gaussian { center, rotation, deviations, opacity: 0.7 }
    }

    fn intersect(gaussian: &Gaussian, origin: Vec3, direction: Vec3) -> (f32, f32) {
        let WhitenedGaussian { center, rows, .. } = WhitenedGaussian::new(gaussian).unwrap();
        let lanes = GaussianLanes::<f32> {
            center: Vec3Lanes::splat(center - origin),
            rows: rows.map(Vec3Lanes::splat),
        };
        lanes.intersect(Vec3Lanes::splat(direction))
    }

    #[test]
    fn rays_are_densest_where_the_exponent_is_least() {
        let mut random = Random::new(3, 0);
        for _ in 0..200 {
            let gaussian = gaussian(&mut random);
            let mut number = || random.next_gaussian() as f32;
            let origin = 5.0 * Vec3::new(number(), number(), number());
            let direction = Vec3::new(number(), number(), number()).normalize();
            let (distance, squared) = intersect(&gaussian, origin, direction);
            let at = |t: f64| {
                let position =
                    (origin.as_dvec3() + t * direction.as_dvec3()) - gaussian.center.as_dvec3();
                let local = gaussian.rotation.as_dquat().inverse() * position;
                (local / gaussian.deviations.as_dvec3()).length_squared()
            };
            let found = at(f64::from(distance));
            assert!((found - f64::from(squared)).abs() < 1e-4 * (1.0 + found), "{found} {squared}");
            let step = 1e-2 * f64::from(gaussian.deviations.min_element());
            assert!(
                found <= at(f64::from(distance) + step) && found <= at(f64::from(distance) - step)
            );
        }
    }

    #[test]
    fn bounds_touch_the_ellipsoid() {
        let mut random = Random::new(4, 0);
        for _ in 0..100 {
            let gaussian = gaussian(&mut random);
            let reach = (2.0 * (0.7f32 * 255.0).ln()).sqrt();
            let mut exact = Aabb::EMPTY;
            for _ in 0..20_000 {
                let mut number = || random.next_gaussian() as f32;
                let unit = Vec3::new(number(), number(), number()).normalize();
                let position =
                    gaussian.center + gaussian.rotation * (reach * unit * gaussian.deviations);
                exact = exact.union(Aabb { min: position, max: position });
            }
            let found = bounds(&gaussian);
            assert!(found.contains(exact), "{found:?} {exact:?}");
            assert!((found.size() / exact.size()).max_element() < 1.03);
        }
    }

    #[test]
    fn alpha_is_the_opacity_at_the_centre_and_the_least_one_at_the_rim() {
        let center = Gaussian {
            center: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            deviations: Vec3::ONE,
            opacity: 0.6,
        };
        let max_squared = WhitenedGaussian::new(&center).unwrap().max_squared;
        assert!((alpha(max_squared, 0.0) - 0.6).abs() < 1e-6);
        assert!((alpha(max_squared, 1.0) - 0.6 * (-0.5f32).exp()).abs() < 1e-6);
        assert!((alpha(max_squared, max_squared) - MIN_ALPHA).abs() < 1e-6);
        let opaque = WhitenedGaussian::new(&Gaussian { opacity: 1.0, ..center }).unwrap();
        assert_eq!(alpha(opaque.max_squared, 0.0), MAX_ALPHA);
        assert!(WhitenedGaussian::new(&Gaussian { opacity: 0.003, ..center }).is_none());
    }

    #[test]
    fn flat_gaussians_have_the_normal_of_their_plane() {
        let flat = Gaussian {
            center: Vec3::ZERO,
            rotation: Quat::from_rotation_x(0.5),
            deviations: Vec3::new(1.0, 0.5, 0.0),
            opacity: 1.0,
        };
        let axis = WhitenedGaussian::new(&flat).unwrap().thinnest_axis();
        assert!(axis.distance(flat.rotation * Vec3::Z) < 1e-6);
        assert!(intersect(&flat, 3.0 * axis, -axis).1.is_finite());
    }

    #[test]
    fn harmonics_are_orthonormal() {
        let mut random = Random::new(5, 0);
        let n_samples = 200_000;
        let mut sums = [[0f64; MAX_HARMONICS]; MAX_HARMONICS];
        for _ in 0..n_samples {
            let mut number = || random.next_gaussian() as f32;
            let basis = spherical_harmonics(Vec3::new(number(), number(), number()).normalize());
            for (row, a) in sums.iter_mut().zip(basis) {
                row.iter_mut().zip(basis).for_each(|(sum, b)| *sum += f64::from(a * b));
            }
        }
        for (i, row) in sums.iter().enumerate() {
            for (j, sum) in row.iter().enumerate() {
                let product = sum / f64::from(n_samples) * 4.0 * std::f64::consts::PI;
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 0.03, "{i} {j} {product}");
            }
        }
    }
}
