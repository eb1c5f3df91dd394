//! Discs: a point given the flat surface that its normal and radius describe (Wiesmeier 2011).

use super::{PointLanes, RayLanes, Shape};
use crate::math::{Aabb, Floats, Vec3};

/// Secondary rays start this many radii above the surface ...
pub(super) const SPAWN_OFFSET: f32 = 0.5;
/// ... and ignore hits nearer than this many.
pub(super) const SPAWN_T_MIN: f32 = 2.0;

pub struct Disc;

impl Shape for Disc {
    /// Two-sided; the normal need not have unit length.
    #[inline(always)]
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask) {
        let distance = points.normal.dot(points.center) / points.normal.dot(ray.direction);
        let offset = points.center.minus(ray.direction.scaled(distance));
        // A ray in the disc's plane gives NaN or infinity here, and fails the first test.
        let hit =
            offset.dot(offset).less(points.radius * points.radius) & ray.t_min.less_equal(distance);
        (distance, hit)
    }
}

/// The box of a disc with unit `normal`.
pub(super) fn bounds(center: Vec3, normal: Vec3, radius: f32) -> Aabb {
    let extent = radius * (1.0 - normal * normal).max(Vec3::ZERO).map(f32::sqrt);
    Aabb { min: center - extent, max: center + extent }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    #[test]
    fn the_box_holds_the_rim_and_touches_it() {
        let mut random = Random::new(11, 0);
        for _ in 0..200 {
            let mut gaussian = || random.next_gaussian() as f32;
            let normal = Vec3::new(gaussian(), gaussian(), gaussian()).normalize();
            let frame = crate::math::Frame::around(normal);
            let rim = (0..720).map(|i| {
                let (sin, cos) = (i as f32 * std::f32::consts::TAU / 720.0).sin_cos();
                2.0 * (cos * frame.tangent + sin * frame.bitangent)
            });
            let exact = Aabb::of_points(rim);
            let found = bounds(Vec3::ZERO, normal, 2.0);
            assert!((found.max - exact.max).abs().max_element() < 1e-3, "{found:?} {exact:?}");
            assert!((found.min - exact.min).abs().max_element() < 1e-3);
        }
    }
}
