//! Vegetation in clouds, and the land under it.

use super::point_shape::{PointShape, Structure};
use crate::math::{SymmetricMatrix, Vec3, smallest_eigenvector};

/// Minimum fraction of scattered points in a cloud with much vegetation.
pub const MIN_VEGETATION: f32 = 0.2;
/// Minimum fraction of scattered points among the rough ones of a cloud that is leafy, not noisy.
const MIN_SCATTERED_ROUGH: f32 = 0.5;

/// Returns true if much of the cloud is vegetation: many points are scattered, and not by noise.
pub fn is_vegetated(shapes: &[PointShape], n_rough: usize) -> bool {
    let n_scattered = count_scattered(shapes);
    !is_noisy(n_scattered, n_rough) && MIN_VEGETATION * shapes.len() as f32 <= n_scattered as f32
}

/// Returns true if most of the points whose nearest neighbours lie in no plane are not scattered: the cloud is noisy rather
/// than leafy.
pub fn is_noisy(n_scattered: usize, n_rough: usize) -> bool {
    (n_scattered as f32) < MIN_SCATTERED_ROUGH * n_rough as f32
}

/// Returns the number of scattered points.
pub fn count_scattered(shapes: &[PointShape]) -> usize {
    shapes.iter().filter(|shape| shape.structure == Structure::Scatter).count()
}

/// Returns the direction, of either sign, to which the normals of the surface points are nearest: amid vegetation that of the
/// land.
pub fn land_normal(shapes: &[PointShape]) -> Vec3 {
    let mut scatter = SymmetricMatrix::default();
    for shape in shapes.iter().filter(|shape| shape.structure == Structure::Surface) {
        // The eigenvector of the least eigenvalue of the negative matrix.
        scatter.add_outer(shape.normal.as_dvec3(), -1.0);
    }
    smallest_eigenvector(&scatter).0.as_vec3()
}
