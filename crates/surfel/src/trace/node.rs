//! The boxes of a node against a ray, and against a box.

use crate::bvh::Node;
use crate::math::{Aabb, Lanes, Ray, Vec3A};

/// Rounding allowed for, as a share of the largest coordinates involved: far more than f32 loses in a box
/// or disc test, far less than a radius. A box is never missed that a hit inside it would need.
const ROUNDING: f32 = 1e-6;

/// What boxes are widened by, all ways, for a ray from `origin`.
#[inline(always)]
pub fn slack(root: &Node, origin: Vec3A) -> f32 {
    let corner = Vec3A::from_array(root.origin);
    ROUNDING * (corner.abs().max(origin.abs()).max_element() + root.size())
}

/// A ray prepared for many boxes: it meets the plane x at x `inverse` - `at_origin`.
#[derive(Clone, Copy, bytemuck::Zeroable)]
pub struct BoxRay {
    inverse: [f32; 3],
    /// For lower and for upper bounds, moved apart by the slack.
    at_origin: [[f32; 3]; 2],
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
        let at_origin = [(origin + slack) * inverse, (origin - slack) * inverse];
        Self {
            inverse: inverse.to_array(),
            at_origin: [at_origin[0].to_array(), at_origin[1].to_array()],
            t_min: ray.t_min,
        }
    }

    /// Narrows `range` to where the ray is between the sides of each child along an axis.
    #[inline(always)]
    fn between<L: Lanes, const AXIS: usize>(&self, node: &Node, range: (L, L)) -> (L, L) {
        let (low, high) = node.sides::<L, AXIS>();
        let inverse = L::splat(self.inverse[AXIS]);
        let at_low = low.times_minus(inverse, L::splat(self.at_origin[0][AXIS]));
        let at_high = high.times_minus(inverse, L::splat(self.at_origin[1][AXIS]));
        (at_low.min(at_high).max(range.0), at_low.max(at_high).min(range.1))
    }
}

/// Lanes whose boxes the ray meets before `t_max`, and where it enters them.
#[inline(always)]
pub fn ray_entries<L: Lanes>(node: &Node, ray: &BoxRay, t_max: f32) -> (L::Mask, L) {
    let range = (L::splat(ray.t_min), L::splat(t_max));
    let range = ray.between::<L, 0>(node, range);
    let range = ray.between::<L, 1>(node, range);
    let (enter, leave) = ray.between::<L, 2>(node, range);
    (enter.less_equal(leave) & node.filled::<L>(), enter)
}

/// Lanes whose boxes overlap `region`.
#[inline(always)]
pub fn box_overlaps<L: Lanes>(node: &Node, region: &Aabb) -> L::Mask {
    let overlaps = overlaps_along::<L, 0>(node, region)
        & overlaps_along::<L, 1>(node, region)
        & overlaps_along::<L, 2>(node, region);
    overlaps & node.filled::<L>()
}

#[inline(always)]
fn overlaps_along<L: Lanes, const AXIS: usize>(node: &Node, region: &Aabb) -> L::Mask {
    let (low, high) = node.sides::<L, AXIS>();
    let (min, max) = (L::splat(region.min[AXIS]), L::splat(region.max[AXIS]));
    low.less_equal(max) & min.less_equal(high)
}
