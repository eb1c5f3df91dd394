//! Eigenvectors of symmetric 3x3 matrices in lanes.

use super::{Floats, Vec3, Vec3Lanes};

/// Minimum sum of products of two eigenvalues, for a trace of 1, of a matrix whose vectors span a plane.
pub const MIN_SPREAD: f32 = 1e-3;
/// Minimum squared length of the cross product of two rows, for a trace of 1. With less, rounding decides its direction.
pub const MIN_CROSS: f32 = 1e-9;
/// Number of Newton steps, each of which about doubles the number of valid digits.
pub const N_STEPS: usize = 5;

/// Symmetric positive semidefinite 3x3 matrices, one per lane: sums of outer products.
#[derive(Clone, Copy)]
pub struct CovarianceLanes<F> {
    xx: F,
    xy: F,
    xz: F,
    yy: F,
    yz: F,
    zz: F,
}

impl<F: Floats> CovarianceLanes<F> {
    /// Returns zero matrices.
    #[inline(always)]
    pub fn zero() -> Self {
        let zero = F::splat(0.0);
        Self { xx: zero, xy: zero, xz: zero, yy: zero, yz: zero, zz: zero }
    }

    /// Adds `weight * v * v^T`.
    #[inline(always)]
    pub fn add_outer(&mut self, v: Vec3Lanes<F>, weight: F) {
        let weighted = v.scaled(weight);
        self.xx = self.xx + weighted.x * v.x;
        self.xy = self.xy + weighted.x * v.y;
        self.xz = self.xz + weighted.x * v.z;
        self.yy = self.yy + weighted.y * v.y;
        self.yz = self.yz + weighted.y * v.z;
        self.zz = self.zz + weighted.z * v.z;
    }

    /// Returns unit eigenvectors of the smallest eigenvalues, of either sign, and the lanes that have one: those of vectors
    /// that span a plane.
    #[inline(always)]
    pub fn smallest_eigenvector(&self) -> (Vec3Lanes<F>, F::Mask) {
        let one = F::splat(1.0);
        let per_trace = one / (self.xx + self.yy + self.zz);
        let [xx, xy, xz] = [self.xx * per_trace, self.xy * per_trace, self.xz * per_trace];
        let [yy, yz, zz] = [self.yy * per_trace, self.yz * per_trace, self.zz * per_trace];
        let (minor_x, minor_y, minor_z) = (yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
        let minors = minor_x + minor_y + minor_z;
        let determinant = xx * minor_x - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
        let value = smallest_root(minors, determinant);
        let rows = [
            Vec3Lanes { x: xx - value, y: xy, z: xz },
            Vec3Lanes { x: xy, y: yy - value, z: yz },
            Vec3Lanes { x: xz, y: yz, z: zz - value },
        ];
        // All rows are perpendicular to the vector. The longest cross product has the most digits.
        let mut best = rows[0].cross(rows[1]);
        let mut squared = best.dot(best);
        for cross in [rows[0].cross(rows[2]), rows[1].cross(rows[2])] {
            let own = cross.dot(cross);
            let is_longer = squared.lt(own);
            best = Vec3Lanes::select(is_longer, cross, best);
            squared = F::select(is_longer, own, squared);
        }
        let is_plane = F::splat(MIN_SPREAD).lt(minors) & F::splat(MIN_CROSS).lt(squared);
        let unit = best.scaled(one / squared.sqrt());
        (Vec3Lanes::select(is_plane, unit, Vec3Lanes::splat(Vec3::Z)), is_plane)
    }
}

/// Steps to which components of fitted normals are rounded.
pub const NORMAL_STEPS: f32 = 16384.0;
/// Added and subtracted, it rounds a number to an integer.
const ROUND_TO_INTEGER: f32 = 12_582_912.0;

/// Rounds unit vectors a little: a component that is zero but for rounding becomes a positive zero, so that what depends on
/// its sign does not depend on rounding.
#[inline(always)]
pub fn rounded_normal<F: Floats>(normal: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let to_integer = F::splat(ROUND_TO_INTEGER);
    let round = |component: F| component * F::splat(NORMAL_STEPS) + to_integer - to_integer;
    let Vec3Lanes { x, y, z } = normal;
    let rounded = Vec3Lanes { x: round(x), y: round(y), z: round(z) };
    rounded.scaled(F::splat(1.0) / rounded.dot(rounded).sqrt())
}

/// Returns the smallest root of `x^3 - x^2 + minors x - determinant`, all of whose roots are between 0 and 1.
///
/// Left of the smallest root the cubic is concave, so that Newton's method approaches it from zero and never passes it.
#[inline(always)]
fn smallest_root<F: Floats>(minors: F, determinant: F) -> F {
    let mut root = F::splat(0.0);
    for _ in 0..N_STEPS {
        let value = ((root - F::splat(1.0)) * root + minors) * root - determinant;
        let slope = (F::splat(3.0) * root - F::splat(2.0)) * root + minors;
        root = root - value / slope;
    }
    root
}

#[cfg(test)]
mod tests {
    //! Normals of planes in any position, and vectors that span none.

    use super::*;
    use crate::math::Random;

    /// Returns the vector of `n` points that are spread by `spread` along an orthonormal basis.
    fn normal_of(basis: [Vec3; 3], spread: [f32; 3], seed: u64) -> Option<Vec3> {
        let mut random = Random::new(seed, 0);
        let mut covariance = CovarianceLanes::<f32>::zero();
        for _ in 0..60 {
            let v: Vec3 =
                (0..3).map(|i| spread[i] * random.next_gaussian() as f32 * basis[i]).sum();
            covariance.add_outer(Vec3Lanes::splat(v), 0.5 + random.next_f32());
        }
        let (normal, is_plane) = covariance.smallest_eigenvector();
        is_plane.then(|| Vec3::new(normal.x, normal.y, normal.z))
    }

    #[test]
    fn normals_of_flat_points_are_those_of_their_plane() {
        let mut random = Random::new(3, 0);
        for seed in 0..200 {
            let mut gaussian = || random.next_gaussian() as f32;
            let normal = Vec3::new(gaussian(), gaussian(), gaussian()).normalize();
            let (a, b) = normal.any_orthonormal_pair();
            for scale in [1e-4, 1.0, 1e4] {
                let found = normal_of([a, b, normal], [scale, 0.4 * scale, 0.0], seed).unwrap();
                assert!(0.99999 < found.dot(normal).abs(), "{found} {normal}");
                let noisy = normal_of([a, b, normal], [scale, scale, 0.05 * scale], seed).unwrap();
                assert!(0.99 < noisy.dot(normal).abs(), "{noisy} {normal}");
            }
        }
    }

    #[test]
    fn zeros_of_normals_are_positive_and_no_normal_is_turned() {
        let normal = Vec3::new(-3e-7, 0.6, -0.8);
        let Vec3Lanes { x, y, z } = rounded_normal(Vec3Lanes::<f32>::splat(normal));
        assert_eq!(x.to_bits(), 0);
        assert!(normal.distance(Vec3::new(x, y, z)) < 1e-4);
        assert!((Vec3::new(x, y, z).length() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn points_of_a_line_or_of_one_place_span_no_plane() {
        let basis = [Vec3::new(0.6, 0.8, 0.0), Vec3::new(-0.8, 0.6, 0.0), Vec3::Z];
        assert_eq!(normal_of(basis, [1.0, 0.0, 0.0], 1), None);
        assert_eq!(normal_of(basis, [0.0; 3], 1), None);
    }
}
