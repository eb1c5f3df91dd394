//! Capsules: each point is a short thick line along its direction.

use super::shape::{PointLanes, RayLanes, Shape};
use crate::math::{Aabb, Floats, Vec3};
use crate::points::CAPSULE_ASPECT;

/// Square of the sine between a ray and the axis of a capsule below which they are parallel.
pub const MIN_ACROSS: f32 = 1e-6;

/// The shape of a capsule. The point's radius is half the length, its normal the direction.
pub struct Capsule;

impl Shape for Capsule {
    /// Intersects the outer side of the capsules. Directions need not have unit length.
    #[inline(always)]
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask) {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let length = points.normal.dot(points.normal).sqrt();
        let axis = points.normal.scaled(one / length);
        let thickness = points.radius * F::splat(1.0 / CAPSULE_ASPECT);
        let half_length = points.radius - thickness;
        // The distances are measured from the position on the ray that is nearest to the centre, as those of far
        // capsules would cancel.
        let nearest = points.center.dot(ray.direction);
        let from_center = ray.direction.scaled(nearest).minus(points.center);
        let (slope, height) = (ray.direction.dot(axis), from_center.dot(axis));
        let across = one - slope * slope;
        let half_linear = zero - height * slope;
        let constant = from_center.dot(from_center) - height * height - thickness * thickness;
        let discriminant = half_linear * half_linear - across * constant;
        let is_parallel = across.lt(F::splat(MIN_ACROSS));
        let side = (zero - half_linear - discriminant.max(zero).sqrt()) / across;
        let at = height + side * slope;
        // A ray along the axis meets the cap that faces it.
        let at = F::select(is_parallel, zero - slope * F::splat(f32::MAX), at);
        let cap = at.max(zero - half_length).min(half_length);
        let cap_center = from_center.minus(axis.scaled(cap));
        let half_linear = cap_center.dot(ray.direction);
        let of_cap = half_linear * half_linear - cap_center.dot(cap_center) + thickness * thickness;
        let cap_distance = zero - half_linear - of_cap.max(zero).sqrt();
        let is_side = at.abs().lt(half_length);
        let distance = nearest + F::select(is_side, side, cap_distance);
        let is_side_hit = zero.le(discriminant);
        let is_cap_hit = zero.le(of_cap);
        let side_or_none = F::select(is_side_hit, one, zero);
        let cap_or_none = F::select(is_cap_hit, one, zero);
        let is_hit = zero.lt(F::select(is_side, side_or_none, cap_or_none)) & zero.lt(length);
        (distance, is_hit & ray.t_min.le(distance))
    }
}

/// Returns the outward normal of a capsule at `position` on its surface.
pub fn normal(position: Vec3, center: Vec3, direction: Vec3, radius: f32) -> Vec3 {
    let half_length = radius * (1.0 - 1.0 / CAPSULE_ASPECT);
    let offset = position - center;
    offset - offset.dot(direction).clamp(-half_length, half_length) * direction
}

/// Returns the bounding box of a capsule. `direction` has unit length.
pub(super) fn bounds(center: Vec3, direction: Vec3, radius: f32) -> Aabb {
    let thickness = radius / CAPSULE_ASPECT;
    let extent = (radius - thickness) * direction.abs() + thickness;
    Aabb { min: center - extent, max: center + extent }
}

#[cfg(test)]
mod tests {
    //! Rays against capsules of known place.

    use super::*;
    use crate::math::{Random, Ray};
    use crate::surface::shape::hit;

    #[test]
    fn hits_lie_at_the_thickness_from_the_line() {
        let mut random = Random::new(3, 0);
        let mut n_hits = 0;
        for _ in 0..20_000 {
            let mut vector =
                || Vec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f32() - 1.0));
            let (origin, target, direction) = (6.0 * vector(), vector(), vector().normalize());
            let ray = Ray::new(origin, (target - origin).normalize());
            let Some(distance) = hit::<Capsule>(Vec3::ZERO, direction, 1.0, &ray) else { continue };
            n_hits += 1;
            let position = ray.at(distance);
            let outward = normal(position, Vec3::ZERO, direction, 1.0);
            assert!((outward.length() - 0.25).abs() < 1e-4, "{position} {outward}");
            assert!(outward.dot(ray.direction) < 1e-3);
            let bounds = bounds(Vec3::ZERO, direction, 1.0);
            assert!((position.clamp(bounds.min, bounds.max) - position).length() < 1e-5);
        }
        assert!(3000 < n_hits, "{n_hits}");
    }

    #[test]
    fn rays_along_the_axis_meet_the_near_cap() {
        let ray = Ray::new(Vec3::new(0.0, 0.1, -5.0), Vec3::Z);
        let expected = 5.0 - 0.75 - (0.25f32 * 0.25 - 0.01).sqrt();
        assert!((hit::<Capsule>(Vec3::ZERO, Vec3::Z, 1.0, &ray).unwrap() - expected).abs() < 1e-4);
        let miss = Ray::new(Vec3::new(0.0, 0.3, -5.0), Vec3::Z);
        assert_eq!(hit::<Capsule>(Vec3::ZERO, Vec3::Z, 1.0, &miss), None);
    }
}
