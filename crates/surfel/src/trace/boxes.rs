//! Where rays enter boxes, sixteen rays at a time.

use super::packet::WideRays;
use crate::math::{Aabb, Floats, Lanes, Ray, WIDE, Wide};

/// Where the sixteen rays of a row enter a box within their ranges; infinity where they do not.
#[derive(Clone, Copy)]
pub struct Entries {
    pub of_rays: [f32; WIDE],
    /// The least of them.
    pub nearest: f32,
}

impl Entries {
    pub const NONE: Self = Self { of_rays: [f32::INFINITY; WIDE], nearest: f32::INFINITY };
}

/// Where each row of sixteen rays enters each box, all boxes of one row after those of another. The last row
/// may have fewer rays.
#[inline(always)]
pub(super) fn box_entries<L: Lanes>(boxes: &[Aabb], rays: &[Ray], entries: &mut [Entries]) {
    let rows = entries.chunks_mut(boxes.len().max(1));
    for (row, entries) in rays.chunks(WIDE).zip(rows) {
        let lanes = WideRays::<L::Wide>::new(row);
        let inverse =
            [inverse(lanes.direction[0]), inverse(lanes.direction[1]), inverse(lanes.direction[2])];
        for (bounds, entries) in boxes.iter().zip(entries) {
            let found = entry(&lanes, &inverse, bounds);
            *entries = Entries { of_rays: found.store(), nearest: found.min_lane() };
            entries.of_rays[row.len()..].fill(f32::INFINITY);
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
