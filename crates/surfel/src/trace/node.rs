//! The boxes of a node against a ray, and against a ball.

use crate::bvh::Node;
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, Vec3};

/// Rounding allowed for, as a share of the distances involved: far more than f32 loses in a box or
/// disc test, far less than a radius. A box is never missed that a hit inside it would need.
pub const ROUNDING: f32 = 1e-6;

/// A ray prepared for many boxes.
pub struct BoxRay {
    pub origin: Vec3,
    inverse: Vec3,
    t_min: f32,
}

impl BoxRay {
    pub fn new(ray: &Ray) -> Self {
        // Kept finite, so that no product of an infinity and a zero gives NaN.
        let inverse =
            ray.direction.map(|d| 1.0 / if d.abs() < 1e-18 { 1e-18f32.copysign(d) } else { d });
        Self { origin: ray.origin, inverse, t_min: ray.t_min }
    }
}

/// Lanes whose boxes the ray meets before `t_max`, and where it enters them.
#[inline(always)]
pub fn ray_entries<L: Lanes>(node: &Node, ray: &BoxRay, t_max: f32) -> (u32, [f32; LANES]) {
    let (mut enter, mut leave) = (L::splat(ray.t_min), L::splat(t_max));
    let step = node.step();
    let corner = Vec3::from_array(node.origin) - ray.origin;
    let slack = ROUNDING * (corner.abs().max_element() + 256.0 * step.max_element());
    for axis in 0..3 {
        let (inverse, corner) = (ray.inverse[axis], corner[axis]);
        let slack = (slack * inverse).abs();
        let per_step = L::splat(step[axis] * inverse);
        let (first, last) = if 0.0 < inverse {
            (&node.lower[axis], &node.upper[axis])
        } else {
            (&node.upper[axis], &node.lower[axis])
        };
        let near = L::from_u8(first) * per_step + L::splat(corner * inverse - slack);
        let far = L::from_u8(last) * per_step + L::splat(corner * inverse + slack);
        enter = near.max(enter);
        leave = far.min(leave);
    }
    (enter.less_equal(leave).bits() & u32::from(node.occupied()), enter.store())
}

/// Lanes whose boxes come within `radius` of `center`.
#[inline(always)]
pub fn ball_overlaps<L: Lanes>(node: &Node, center: Vec3, radius: f32) -> u32 {
    let mut squared = L::splat(0.0);
    let step = node.step();
    for axis in 0..3 {
        let corner = L::splat(node.origin[axis] - center[axis]);
        let per_step = L::splat(step[axis]);
        let below = corner + L::from_u8(&node.lower[axis]) * per_step;
        let above = L::splat(0.0) - (corner + L::from_u8(&node.upper[axis]) * per_step);
        let outside = below.max(above).max(L::splat(0.0));
        squared = squared + outside * outside;
    }
    squared.less_equal(L::splat(radius * radius * (1.0 + 1e-4))).bits() & u32::from(node.occupied())
}
