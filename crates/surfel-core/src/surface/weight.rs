//! The weight function of points.

use crate::math::Floats;

/// Returns the weight of a point at a squared distance, which falls from 1 to 0 at the support's radius.
#[inline(always)]
pub fn support_weight<F: Floats>(squared_distance: F, inverse_support_squared: F) -> F {
    let inside = F::splat(1.0) - squared_distance * inverse_support_squared;
    let inside = inside.max(F::splat(0.0));
    let squared = inside * inside;
    squared * squared
}
