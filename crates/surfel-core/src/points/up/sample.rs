//! The points of a cloud that inference looks at.

use crate::math::Vec3;
use crate::points::is_valid_position;

/// Returns at most 200,000 valid positions, evenly spread over the cloud's order.
pub fn sample(positions: &[Vec3]) -> Vec<Vec3> {
    let step = positions.len().div_ceil(200_000).max(1);
    positions.iter().step_by(step).copied().filter(|p| is_valid_position(*p)).collect()
}
