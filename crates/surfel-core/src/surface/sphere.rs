//! Spheres: each point is a ball of its radius (Wiesmeier 2011).

use super::shape::{PointLanes, RayLanes, Shape};
use crate::math::{Aabb, Floats, Vec3};

/// The shape of a sphere.
pub struct Sphere;

impl Shape for Sphere {
    /// Returns the nearest root at or beyond `t_min`, which is the far side if the ray starts inside.
    #[inline(always)]
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask) {
        let along = points.center.dot(ray.direction);
        // The distance of the centre from the line, rather than b^2 - 4ac, which cancels for far spheres
        // (Haines et al., Precision Improvements for Ray/Sphere Intersection, 2019).
        let across = points.center.minus(ray.direction.scaled(along));
        let squared = points.radius * points.radius - across.dot(across);
        let half_chord = squared.max(F::splat(0.0)).sqrt();
        let (near, far) = (along - half_chord, along + half_chord);
        let distance = F::select(ray.t_min.le(near), near, far);
        let hit = F::splat(0.0).lt(squared) & ray.t_min.le(distance);
        (distance, hit)
    }
}

/// Returns the bounding box of a sphere.
pub(super) fn bounds(center: Vec3, radius: f32) -> Aabb {
    Aabb { min: center - radius, max: center + radius }
}
