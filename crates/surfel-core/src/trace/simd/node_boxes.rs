//! The boxes of the eight children of a node against one ray, and against one box.

use crate::bvh::BvhNode;
use crate::math::{Aabb, Lanes, Ray, Vec3A, clip_to_slab, finite_inverse_vec3};

/// Allowance for rounding, relative to the largest coordinates involved: far more than f32 loses in a box or
/// disc test, far less than a radius. No box is missed that contains a hit.
pub const ROUNDING: f32 = 1e-6;

/// Returns the length by which boxes are widened on all sides for a ray from `origin`.
#[inline(always)]
pub fn slack(root: &BvhNode, origin: Vec3A) -> f32 {
    let corner = Vec3A::from_array(root.origin);
    ROUNDING * (corner.abs().max(origin.abs()).max_element() + root.max_size())
}

/// A ray prepared for the slab test of many boxes: it meets the plane at x at distance x * `inverse` -
/// `at_origin`.
#[derive(Clone, Copy, bytemuck::Zeroable)]
pub struct SlabRay {
    inverse: [f32; 3],
    /// One row for lower and one for upper bounds, moved apart by the slack.
    at_origin: [[f32; 3]; 2],
    t_min: f32,
}

impl SlabRay {
    /// Prepares `ray` for the boxes of the tree below `root`.
    #[inline(always)]
    pub fn new(root: &BvhNode, ray: &Ray) -> Self {
        let inverse = finite_inverse_vec3(Vec3A::from(ray.direction));
        let origin = Vec3A::from(ray.origin);
        let slack = slack(root, origin);
        let at_origin = [(origin + slack) * inverse, (origin - slack) * inverse];
        Self {
            inverse: inverse.to_array(),
            at_origin: [at_origin[0].to_array(), at_origin[1].to_array()],
            t_min: ray.t_min,
        }
    }

    /// Narrows `range` to the part of the ray between the sides of each child along an axis.
    #[inline(always)]
    fn clip<L: Lanes, const AXIS: usize>(&self, node: &BvhNode, range: (L, L)) -> (L, L) {
        let (low, high) = node.bounds_along::<L, AXIS>();
        let inverse = L::splat(self.inverse[AXIS]);
        let at_low = low.mul_sub(inverse, L::splat(self.at_origin[0][AXIS]));
        let at_high = high.mul_sub(inverse, L::splat(self.at_origin[1][AXIS]));
        clip_to_slab(range, at_low, at_high)
    }
}

/// Returns the lanes whose boxes the ray enters up to `t_max`, and the distances at which it enters them.
#[inline(always)]
pub fn intersect_children<L: Lanes>(node: &BvhNode, ray: &SlabRay, t_max: f32) -> (L::Mask, L) {
    let range = (L::splat(ray.t_min), L::splat(t_max));
    let range = ray.clip::<L, 0>(node, range);
    let range = ray.clip::<L, 1>(node, range);
    let (enter, leave) = ray.clip::<L, 2>(node, range);
    (enter.le(leave) & node.occupied_mask::<L>(), enter)
}

/// Returns the lanes whose boxes overlap `region`.
#[inline(always)]
pub fn overlapping_children<L: Lanes>(node: &BvhNode, region: &Aabb) -> L::Mask {
    let overlaps = overlaps_along::<L, 0>(node, region)
        & overlaps_along::<L, 1>(node, region)
        & overlaps_along::<L, 2>(node, region);
    overlaps & node.occupied_mask::<L>()
}

#[inline(always)]
fn overlaps_along<L: Lanes, const AXIS: usize>(node: &BvhNode, region: &Aabb) -> L::Mask {
    let (low, high) = node.bounds_along::<L, AXIS>();
    let (min, max) = (L::splat(region.min[AXIS]), L::splat(region.max[AXIS]));
    low.le(max) & min.le(high)
}
