//! The distances at which rays enter the boxes of instances.

use crate::math::{
    Aabb, Floats, Lanes, PACKET_WIDTH, PacketLanes, Ray, Vec3A, clip_to_box, finite_inverse,
    finite_inverse_vec3,
};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::simd::{Simd, dispatch_simd};

/// The distances at which the sixteen rays of a row enter a box within their ranges.
#[derive(Clone, Copy)]
pub struct BoxEntries {
    /// Distance of each ray, infinite for those that miss the box.
    pub of_rays: [f32; PACKET_WIDTH],
    /// The least of these distances.
    pub nearest: f32,
}

impl BoxEntries {
    /// The entries of a box that no ray enters.
    pub const NONE: Self = Self { of_rays: [f32::INFINITY; PACKET_WIDTH], nearest: f32::INFINITY };
}

/// Finds the distances at which each row of sixteen rays enters each box:
/// `entries[row * boxes.len() + box_idx]`. The last row may have fewer rays.
pub fn box_entries(boxes: &[Aabb], simd: Simd, rays: &[Ray], entries: &mut [BoxEntries]) {
    dispatch_simd!(simd, box_entries_kernel(boxes: &[Aabb], rays: &[Ray], entries: &mut [BoxEntries]));
}

#[inline(always)]
fn box_entries_kernel<L: Lanes>(boxes: &[Aabb], rays: &[Ray], entries: &mut [BoxEntries]) {
    let rows = entries.chunks_mut(boxes.len().max(1));
    for (row, entries) in rays.chunks(PACKET_WIDTH).zip(rows) {
        let lanes = PacketRays::<L::PacketLanes>::new(row);
        let [x, y, z] = lanes.direction;
        let inverse = [finite_inverse(x), finite_inverse(y), finite_inverse(z)];
        let range = (lanes.t_min, lanes.t_max);
        for (bounds, entries) in boxes.iter().zip(entries) {
            let found = intersect_aabb(&lanes.origin, &inverse, range, bounds);
            *entries = BoxEntries { of_rays: found.store(), nearest: found.reduce_min() };
            entries.of_rays[row.len()..].fill(f32::INFINITY);
        }
    }
}

/// Returns the distance at which one ray enters a box within its range, infinite if it does not.
#[inline(always)]
pub fn box_entry(bounds: &Aabb, ray: &Ray) -> f32 {
    let inverse = finite_inverse_vec3(Vec3A::from(ray.direction)).to_array();
    intersect_aabb(&ray.origin.to_array(), &inverse, (ray.t_min, ray.t_max), bounds)
}

/// Returns the distances at which rays enter a box within their ranges, infinite for those that do not.
/// `inverse` holds the finite inverse of their directions.
#[inline(always)]
fn intersect_aabb<F: Floats>(origin: &[F; 3], inverse: &[F; 3], range: (F, F), bounds: &Aabb) -> F {
    // More than the rounding in here, relative to the distances.
    const SLACK: f32 = 8.0 * f32::EPSILON;
    let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
    let (near, far) = clip_to_box(range, origin, inverse, &min, &max);
    let slack = F::splat(SLACK) * near.abs().max(far.abs().min(F::splat(f32::MAX)));
    let is_hit = near.le(far + slack) & near.lt(F::splat(f32::INFINITY));
    F::select(is_hit, near - slack, F::splat(f32::INFINITY))
}
