//! The slab test of rays against axis-aligned boxes (Kay and Kajiya 1986), in any number of lanes.

use super::{Floats, Vec3A};

/// Narrows the range of distances of a ray to its part between two parallel planes, which the ray meets at
/// `a` and `b`, in either order. The result is empty if its first distance exceeds its second one.
#[inline(always)]
pub fn clip_to_slab<F: Floats>((enter, leave): (F, F), a: F, b: F) -> (F, F) {
    (a.min(b).max(enter), a.max(b).min(leave))
}

/// Narrows the range of distances of rays to their parts within a box.
///
/// `inverse` holds the `finite_inverse` of each axis of the directions. The result is empty if its first
/// distance exceeds its second one.
#[inline(always)]
pub fn clip_to_box<F: Floats>(
    mut range: (F, F),
    origin: &[F; 3],
    inverse: &[F; 3],
    min: &[f32; 3],
    max: &[f32; 3],
) -> (F, F) {
    for axis in 0..3 {
        let low = (F::splat(min[axis]) - origin[axis]) * inverse[axis];
        let high = (F::splat(max[axis]) - origin[axis]) * inverse[axis];
        range = clip_to_slab(range, low, high);
    }
    range
}

/// Components of directions nearer to zero than this are replaced by it.
pub const MIN_DIRECTION: f32 = 1e-18;

/// Returns `1 / direction`, and a large finite number for a direction close to zero: no product of an
/// infinity and a zero then gives NaN in a slab test.
#[inline(always)]
pub fn finite_inverse<F: Floats>(direction: F) -> F {
    let is_small = direction.lt(F::splat(MIN_DIRECTION)) & F::splat(-MIN_DIRECTION).lt(direction);
    F::splat(1.0) / F::select(is_small, F::splat(MIN_DIRECTION), direction)
}

/// Returns the [`finite_inverse`] of each component, by one vector division.
#[inline(always)]
pub fn finite_inverse_vec3(direction: Vec3A) -> Vec3A {
    let min_direction = Vec3A::splat(MIN_DIRECTION);
    let is_small = direction.abs().cmplt(min_direction);
    1.0 / Vec3A::select(is_small, min_direction, direction)
}
