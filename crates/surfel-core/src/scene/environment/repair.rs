//! Repair of pictures whose values are not all valid radiances.

use crate::math::Vec3;

/// Maximum radiance: products with strengths, colours and densities stay finite below it.
pub(super) const MAX_RADIANCE: f32 = 1e15;
/// Smallest value that replaces infinity, which is mostly a sun brighter than the largest half float.
pub(super) const MAX_HALF: f32 = 65504.0;

/// Returns the pixels as valid radiances and the number of pixels that changed, or `None` if no component is
/// finite and at least 0.
pub(super) fn repair(mut pixels: Vec<Vec3>) -> Option<(Vec<Vec3>, usize)> {
    let components = pixels.iter().flat_map(Vec3::to_array);
    let max = components.filter(|value| value.is_finite()).fold(-1.0f32, f32::max);
    if max < 0.0 {
        return None;
    }
    let infinite = max.clamp(MAX_HALF, MAX_RADIANCE);
    let mut n_repaired = 0;
    for pixel in &mut pixels {
        let repaired = pixel.to_array().map(|value| match value {
            f32::INFINITY => infinite,
            _ if 0.0 < value => value.min(MAX_RADIANCE),
            // Negative values and NaN.
            _ => 0.0,
        });
        n_repaired += usize::from(pixel.to_array() != repaired);
        *pixel = Vec3::from_array(repaired);
    }
    Some((pixels, n_repaired))
}
