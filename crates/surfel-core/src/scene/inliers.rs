//! The points of a cloud without its outliers.

use crate::math::{Aabb, Vec3};
use crate::points::{PointCloud, is_valid_position};
use std::collections::HashSet;

/// Fraction of points at each end of an axis that can be outliers.
const OUTLIER_FRACTION: f64 = 0.005;
/// Maximum number of points that are looked at.
const MAX_SAMPLES: usize = 200_000;

/// Returns the bounds of all points but the outliers, relative to the cloud's origin.
pub fn inlier_bounds(cloud: &PointCloud) -> Aabb {
    Aabb::of_points(sample_inliers(cloud))
}

/// Returns a sample of the points without outliers, relative to the cloud's origin; a single zero if the
/// cloud is empty.
pub(super) fn sample_inliers(cloud: &PointCloud) -> Vec<Vec3> {
    let stride = cloud.len().div_ceil(MAX_SAMPLES).max(1);
    let valid = cloud.positions.iter().step_by(stride).copied().filter(|p| is_valid_position(*p));
    // A place counts once, however many points lie there.
    let mut seen = HashSet::new();
    let places = valid.filter(|p| seen.insert(p.to_array().map(f32::to_bits)));
    without_outliers(&places.collect::<Vec<Vec3>>())
}

/// Returns the points within the inner quantiles of all axes, widened by a quarter of their range.
fn without_outliers(points: &[Vec3]) -> Vec<Vec3> {
    if points.is_empty() {
        return vec![Vec3::ZERO];
    }
    let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
    for axis in 0..3 {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        let n_outliers = (OUTLIER_FRACTION * values.len() as f64) as usize;
        let (first, last) = (values[n_outliers], values[values.len() - 1 - n_outliers]);
        let margin = 0.25 * (last - first);
        (low[axis], high[axis]) = (first - margin, last + margin);
    }
    points.iter().copied().filter(|p| low.cmple(*p).all() && p.cmple(high).all()).collect()
}

/// Returns the points about the middle of a cloud that thins out far away from it, as that of a scanner which stood among
/// the things it scanned; all points of other clouds.
pub(super) fn without_fringe(points: Vec<Vec3>) -> Vec<Vec3> {
    /// Fraction of the points that decide about the size of the middle.
    const CORE_FRACTION: f64 = 0.95;
    /// Distance to which points are kept, in distances of the core. Only farther points can be a fringe.
    const FRINGE_RATIO: f32 = 2.0;
    let median = |axis: usize| {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    if points.is_empty() {
        return points;
    }
    let middle = Vec3::new(median(0), median(1), median(2));
    let mut distances: Vec<f32> = points.iter().map(|p| p.distance(middle)).collect();
    let rank = (CORE_FRACTION * (distances.len() - 1) as f64) as usize;
    let core = *distances.select_nth_unstable_by(rank, f32::total_cmp).1;
    points.into_iter().filter(|p| p.distance(middle) <= FRINGE_RATIO * core).collect()
}

/// Returns the smallest and largest coordinate of `points` along an axis.
pub(super) fn range_along(points: &[Vec3], axis: Vec3) -> (f32, f32) {
    let along = points.iter().map(|p| p.dot(axis));
    (along.clone().fold(f32::MAX, f32::min), along.fold(f32::MIN, f32::max))
}

#[cfg(test)]
mod tests {
    //! The part of a cloud that a camera shows.

    use super::*;
    use crate::math::Random;

    /// Points about the origin whose distances grow with the power of a random number.
    fn disk(power: i32) -> Vec<Vec3> {
        let mut random = Random::new(6, 0);
        let point = |random: &mut Random| {
            let (angle, distance) = (std::f32::consts::TAU * random.next_f32(), random.next_f32());
            40.0 * distance.powi(power) * Vec3::new(angle.cos(), angle.sin(), 0.0)
        };
        (0..5000).map(|_| point(&mut random)).collect()
    }

    #[test]
    fn many_points_in_one_place_do_not_make_outliers_of_the_others() {
        let mut points = vec![Vec3::ONE; 100_000];
        points.extend(disk(1));
        let bounds = inlier_bounds(&PointCloud::from_positions(points));
        assert!(39.0 < bounds.max.x && bounds.min.y < -39.0, "{bounds:?}");
    }

    #[test]
    fn only_a_thin_fringe_is_left_out() {
        assert_eq!(without_fringe(disk(1)).len(), 5000);
        let core = without_fringe(disk(40));
        assert!((4700..4995).contains(&core.len()), "{}", core.len());
        assert!(without_fringe(Vec::new()).is_empty());
    }
}
