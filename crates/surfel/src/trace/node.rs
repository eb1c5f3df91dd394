//! The boxes of a node against a ray, and against a ball.

use crate::bvh::Node;
use crate::math::{Floats, LaneMask, Lanes, Ray, Vec3, Vec3A};

/// Rounding allowed for, as a share of the farthest distance in the tree: far more than f32 loses in a
/// box or disc test, far less than a radius. A box is never missed that a hit inside it would need.
const ROUNDING: f32 = 1e-6;

/// What boxes are widened by, all ways, for a ray from `origin`.
#[inline(always)]
pub fn slack(root: &Node, origin: Vec3A) -> f32 {
    ROUNDING * ((Vec3A::from_array(root.origin) - origin).abs().max_element() + root.size())
}

/// A ray prepared for many boxes.
#[derive(Clone, Copy)]
pub struct BoxRay {
    /// Moved by the slack, for the boxes' lower and for their upper bounds.
    origin_low: Vec3A,
    origin_high: Vec3A,
    inverse: Vec3A,
    t_min: f32,
}

impl BoxRay {
    #[inline(always)]
    pub fn new(root: &Node, ray: &Ray) -> Self {
        const LEAST: Vec3A = Vec3A::splat(1e-18);
        // Kept finite, so that no product of an infinity and a zero gives NaN.
        let direction = Vec3A::from(ray.direction);
        let is_small = direction.abs().cmplt(LEAST);
        let inverse = 1.0 / Vec3A::select(is_small, LEAST, direction);
        let origin = Vec3A::from(ray.origin);
        let slack = slack(root, origin);
        let (origin_low, origin_high) = (origin + slack, origin - slack);
        Self { origin_low, origin_high, inverse, t_min: ray.t_min }
    }
}

/// Lanes whose boxes the ray meets before `t_max`, and where it enters them.
#[inline(always)]
pub fn ray_entries<L: Lanes>(node: &Node, ray: &BoxRay, t_max: f32) -> (L::Mask, L) {
    let (mut enter, mut leave) = (L::splat(ray.t_min), L::splat(t_max));
    let corner = Vec3A::from_array(node.origin);
    let low = ((corner - ray.origin_low) * ray.inverse).to_array();
    let high = ((corner - ray.origin_high) * ray.inverse).to_array();
    let per_step = (node.step() * ray.inverse).to_array();
    for axis in 0..3 {
        let per_step = L::splat(per_step[axis]);
        let first = L::from_u8(&node.lower[axis]).times_plus(per_step, L::splat(low[axis]));
        let second = L::from_u8(&node.upper[axis]).times_plus(per_step, L::splat(high[axis]));
        enter = first.min(second).max(enter);
        leave = first.max(second).min(leave);
    }
    (enter.less_equal(leave) & L::first(node.n_children()), enter)
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
    squared.less_equal(L::splat(radius * radius * (1.0 + 1e-4))).bits() & node.occupied()
}
