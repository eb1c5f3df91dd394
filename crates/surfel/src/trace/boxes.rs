//! Where rays enter boxes, sixteen rays at a time.

use super::packet::WideRays;
use crate::math::{Aabb, Floats, Lanes, Ray, WIDE, Wide};

/// For each ray where it enters each box within its range, box after box; infinity where it does not.
#[inline(always)]
pub(super) fn box_entries<L: Lanes>(boxes: &[Aabb], rays: &[Ray], entries: &mut [f32]) {
    for (first, packet) in rays.chunks(WIDE).enumerate() {
        let lanes = WideRays::<L::Wide>::new(packet);
        let inverse =
            [inverse(lanes.direction[0]), inverse(lanes.direction[1]), inverse(lanes.direction[2])];
        for (box_idx, bounds) in boxes.iter().enumerate() {
            let found = entry(&lanes, &inverse, bounds).store();
            let place = box_idx * rays.len() + first * WIDE;
            entries[place..place + packet.len()].copy_from_slice(&found[..packet.len()]);
        }
    }
}

#[inline(always)]
fn entry<W: Wide>(rays: &WideRays<W>, inverse: &[W; 3], bounds: &Aabb) -> W {
    // More than the rounding in here, as a share of the distances.
    const SLACK: f32 = 8.0 * f32::EPSILON;
    let (mut near, mut far) = (rays.t_min, rays.t_max);
    for (axis, inverse) in inverse.iter().enumerate() {
        let low = (W::splat(bounds.min[axis]) - rays.origin[axis]) * *inverse;
        let high = (W::splat(bounds.max[axis]) - rays.origin[axis]) * *inverse;
        near = low.min(high).max(near);
        far = low.max(high).min(far);
    }
    let slack = W::splat(SLACK) * near.abs().max(far.abs().min(W::splat(f32::MAX)));
    let is_met = near.less_equal(far + slack) & near.less(W::splat(f32::INFINITY));
    W::select(is_met, near - slack, W::splat(f32::INFINITY))
}

/// Kept finite, so that no product of an infinity and a zero gives NaN.
#[inline(always)]
pub(super) fn inverse<F: Floats>(direction: F) -> F {
    const LEAST: f32 = 1e-18;
    let is_small = direction.less(F::splat(LEAST)) & F::splat(-LEAST).less(direction);
    F::splat(1.0) / F::select(is_small, F::splat(LEAST), direction)
}
