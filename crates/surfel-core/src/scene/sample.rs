//! Samples of points at about equal steps.

use crate::math::{Vec3, sample_indices};
use std::borrow::Cow;

/// Returns at most about `max` of the points.
pub(super) fn sample_points(points: &[Vec3], max: usize) -> Cow<'_, [Vec3]> {
    if points.len() <= max {
        return Cow::Borrowed(points);
    }
    sample_indices(points.len(), max).map(|i| points[i]).collect()
}

#[cfg(test)]
mod tests {
    //! Samples of points.

    use super::*;

    #[test]
    fn few_points_are_all_sampled() {
        let points = vec![Vec3::ONE; 100];
        assert_eq!(sample_points(&points, 100).len(), 100);
        assert_eq!(sample_points(&points, 50).len(), 50);
    }
}
