//! Discs: each point is the flat disc that its normal and radius describe (Wiesmeier 2011).

use super::shape::{PointLanes, RayLanes, Shape};
use crate::math::{Aabb, Floats, Vec3};

/// The height of the origin of secondary rays above the surface, in radii.
pub const SPAWN_OFFSET: f32 = 0.5;
/// The distance before which secondary rays ignore hits, in radii.
pub const SPAWN_T_MIN: f32 = 2.0;

/// The shape of a flat disc.
pub struct Disc;

impl Shape for Disc {
    /// Intersects both sides of the discs. Their normals need not have unit length.
    #[inline(always)]
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask) {
        let distance = points.normal.dot(points.center) / points.normal.dot(ray.direction);
        let offset = points.center.minus(ray.direction.scaled(distance));
        // A ray in the disc's plane gives NaN or infinity here, and fails the first test.
        let hit = offset.dot(offset).lt(points.radius * points.radius) & ray.t_min.le(distance);
        (distance, hit)
    }
}

/// Returns the bounding box of a disc. `normal` has unit length.
pub(super) fn bounds(center: Vec3, normal: Vec3, radius: f32) -> Aabb {
    let extent = radius * (1.0 - normal * normal).max(Vec3::ZERO).map(f32::sqrt);
    Aabb { min: center - extent, max: center + extent }
}

#[cfg(test)]
mod tests {
    //! Bounds of a disc contain its rim and touch it.

    use super::*;
    use crate::math::Random;

    #[test]
    fn bounds_contain_the_rim_and_touch_it() {
        let mut random = Random::new(11, 0);
        for _ in 0..200 {
            let mut gaussian = || random.next_gaussian() as f32;
            let normal = Vec3::new(gaussian(), gaussian(), gaussian()).normalize();
            let basis = crate::math::Basis::around(normal);
            let rim = (0..720).map(|i| {
                let (sin, cos) = (i as f32 * std::f32::consts::TAU / 720.0).sin_cos();
                2.0 * (cos * basis.tangent + sin * basis.bitangent)
            });
            let exact = Aabb::of_points(rim);
            let found = bounds(Vec3::ZERO, normal, 2.0);
            assert!((found.max - exact.max).abs().max_element() < 1e-3, "{found:?} {exact:?}");
            assert!((found.min - exact.min).abs().max_element() < 1e-3);
        }
    }
}
