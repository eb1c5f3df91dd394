//! The points of a cloud without its outliers.

use crate::math::{Aabb, Vec3, median};
use crate::points::{PointCloud, is_valid_position};
use std::collections::{BTreeMap, HashSet};

/// Fraction of points at each end of an axis that can be outliers.
const OUTLIER_FRACTION: f64 = 0.005;
/// Maximum number of points that are looked at.
const MAX_SAMPLES: usize = 200_000;

/// Name of the scalar column that tells which part of a sampled scene each point is of. A part is no outlier of the others,
/// however few its points are. Columns of files that have this name are not read.
pub const PART: &str = "surfel:part";

/// Returns the bounds of all points but the outliers, relative to the cloud's origin.
pub fn inlier_bounds(cloud: &PointCloud) -> Aabb {
    Aabb::of_points(sample_inliers(cloud))
}

/// Returns a sample of the points without the outliers of each part, relative to the cloud's origin; a single zero if the
/// cloud is empty.
pub(super) fn sample_inliers(cloud: &PointCloud) -> Vec<Vec3> {
    sample_parts(cloud).into_iter().flatten().collect()
}

/// Returns a sample of the points as [`sample_inliers`] does, also without a thin fringe of each part far away from its middle.
pub(super) fn sample_middle(cloud: &PointCloud) -> Vec<Vec3> {
    sample_parts(cloud).into_iter().flat_map(without_fringe).collect()
}

/// Returns a sample of the points of each part without its outliers.
fn sample_parts(cloud: &PointCloud) -> Vec<Vec<Vec3>> {
    let stride = cloud.len().div_ceil(MAX_SAMPLES).max(1);
    let part_of_point = cloud.scalar(PART);
    let mut parts: BTreeMap<i64, Vec<Vec3>> = BTreeMap::new();
    for i in (0..cloud.len()).step_by(stride).filter(|i| is_valid_position(cloud.positions[*i])) {
        let part = part_of_point.map_or(0, |parts| parts.get(i) as i64);
        parts.entry(part).or_default().push(cloud.positions[i]);
    }
    if parts.is_empty() {
        return vec![vec![Vec3::ZERO]];
    }
    let without_strays = |points: Vec<Vec3>| {
        // A place counts once, however many points lie there.
        let mut seen = HashSet::new();
        let distinct = points.into_iter().filter(|p| seen.insert(p.to_array().map(f32::to_bits)));
        without_stray_groups(without_outliers(&distinct.collect::<Vec<Vec3>>()))
    };
    parts.into_values().map(without_strays).collect()
}

/// Returns the points within the inner quantiles of all axes, widened by a quarter of their range.
fn without_outliers(points: &[Vec3]) -> Vec<Vec3> {
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
fn without_fringe(points: Vec<Vec3>) -> Vec<Vec3> {
    /// Fraction of the points that decide about the size of the middle.
    const CORE_FRACTION: f64 = 0.95;
    /// Distance to which points are kept, in distances of the core. Only farther points can be a fringe.
    const FRINGE_RATIO: f32 = 2.0;
    /// Minimum number of points: of fewer, only one lies beyond the core.
    const MIN_POINTS: usize = 22;
    if points.len() < MIN_POINTS {
        return points;
    }
    let middle = [0, 1, 2].map(|axis| median(points.iter().map(|p| p[axis])).unwrap_or_default());
    let middle = Vec3::from_array(middle);
    let mut distances: Vec<f32> = points.iter().map(|p| p.distance(middle)).collect();
    let rank = (CORE_FRACTION * (distances.len() - 1) as f64) as usize;
    let core = *distances.select_nth_unstable_by(rank, f32::total_cmp).1;
    points.into_iter().filter(|p| p.distance(middle) <= FRINGE_RATIO * core).collect()
}

/// Returns the points without those far from all others that lie in small groups, as the outliers of photogrammetry do;
/// all points of clouds that are not much smaller without them.
fn without_stray_groups(points: Vec<Vec3>) -> Vec<Vec3> {
    /// Maximum fraction of the points in a small group.
    const MAX_GROUP_FRACTION: f64 = 0.002;
    /// Maximum fraction of the points in small groups: more of them are no outliers.
    const MAX_STRAY_FRACTION: f64 = 0.1;
    /// Minimum ratio of the longest side with the small groups to that without them.
    const MIN_RATIO: f32 = 1.3;
    /// Number of rounds: the cells of the next round are those of the smaller cloud.
    const N_ROUNDS: usize = 3;
    if MAX_GROUP_FRACTION * (points.len() as f64) < 1.0 {
        // No group is small.
        return points;
    }
    let mut points = points;
    for _ in 0..N_ROUNDS {
        let longest =
            |points: &[Vec3]| Aabb::of_points(points.iter().copied()).size().max_element();
        let group_sizes = group_sizes(&points);
        let max_size = MAX_GROUP_FRACTION * points.len() as f64;
        let of_point = points.iter().copied().zip(group_sizes);
        let kept = of_point.filter(|(_, size)| max_size < f64::from(*size));
        let kept: Vec<Vec3> = kept.map(|(point, _)| point).collect();
        let n_stray = points.len() - kept.len();
        let are_few = n_stray as f64 <= MAX_STRAY_FRACTION * points.len() as f64;
        if !are_few || longest(&points) < MIN_RATIO * longest(&kept) {
            break;
        }
        points = kept;
    }
    points
}

/// Returns, for each point, the number of points in its group. Points in cells that touch each other are one group.
fn group_sizes(points: &[Vec3]) -> Vec<u32> {
    /// Maximum number of cells along the longest side of the cloud.
    const MAX_CELLS: usize = 48;
    /// Minimum number of points for each cell of a face of the grid: with fewer, sparse points of a surface would not touch.
    const POINTS_PER_CELL: usize = 12;
    let n_cells = (points.len() / POINTS_PER_CELL).isqrt().clamp(1, MAX_CELLS);
    // Number of cells along each axis of the grid, which has a border.
    let stride = n_cells + 2;
    let bounds = Aabb::of_points(points.iter().copied());
    let per_cell = n_cells as f32 / bounds.size().max_element().max(f32::MIN_POSITIVE);
    let cell = |point: &Vec3| {
        let at = ((*point - bounds.min) * per_cell).to_array();
        let [x, y, z] = at.map(|along| (along as usize).min(n_cells - 1) + 1);
        x + stride * (y + stride * z)
    };
    let mut counts = vec![0u32; stride.pow(3)];
    points.iter().for_each(|point| counts[cell(point)] += 1);
    let mut size_of_cell = vec![0; counts.len()];
    for first in 0..counts.len() {
        if counts[first] == 0 || size_of_cell[first] != 0 {
            continue;
        }
        let mut group = vec![first];
        size_of_cell[first] = u32::MAX;
        let mut n_looked_at = 0;
        while let Some(cell) = group.get(n_looked_at).copied() {
            n_looked_at += 1;
            for step in 0..27 {
                let [x, y, z] = [step % 3, step / 3 % 3, step / 9];
                let other = cell + x + stride * (y + stride * z) - (1 + stride * (1 + stride));
                if counts[other] != 0 && size_of_cell[other] == 0 {
                    size_of_cell[other] = u32::MAX;
                    group.push(other);
                }
            }
        }
        let size = group.iter().map(|cell| counts[*cell]).sum();
        group.into_iter().for_each(|cell| size_of_cell[cell] = size);
    }
    points.iter().map(|point| size_of_cell[cell(point)]).collect()
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
    fn one_far_point_of_few_is_no_fringe() {
        for (n, n_kept) in [(2, 2), (3, 3), (21, 21), (42, 40)] {
            // The last point is far away, of 42 the last two.
            let far = |i: usize| if n - (n / 21).max(1) <= i { 100.0 } else { 0.0 };
            let points =
                (0..n).map(|i| Vec3::new(i as f32 / n as f32 + far(i), 0.0, 0.0)).collect();
            assert_eq!(without_fringe(points).len(), n_kept, "{n}");
        }
    }

    #[test]
    fn many_points_in_one_place_do_not_make_outliers_of_the_others() {
        let mut points = vec![Vec3::ONE; 100_000];
        points.extend(disk(1));
        let bounds = inlier_bounds(&PointCloud::from_positions(points));
        assert!(39.0 < bounds.max.x && bounds.min.y < -39.0, "{bounds:?}");
    }

    #[test]
    fn stray_points_are_left_out_and_parts_of_the_scene_are_not() {
        let mut random = Random::new(7, 0);
        let mut cube =
            |size: f32| size * Vec3::from_array(std::array::from_fn(|_| random.next_f32() - 0.5));
        let scene: Vec<Vec3> = (0..5000).map(|_| cube(10.0)).collect();
        let strays = (0..200).map(|_| cube(100.0));
        let size =
            |points: Vec<Vec3>| Aabb::of_points(without_stray_groups(points)).size().max_element();
        let without = size(scene.iter().copied().chain(strays).collect());
        assert!(without < 15.0, "{without}");
        let stray_group = (0..100).map(|_| cube(3.0) + 40.0 * Vec3::X);
        assert!(40.0 < size(scene.iter().copied().chain(stray_group).collect()));
        for few in [vec![], vec![Vec3::ONE], vec![Vec3::ONE; 3]] {
            assert_eq!(without_stray_groups(few.clone()), few);
        }
    }

    #[test]
    fn sparse_parts_of_a_small_cloud_are_no_strays() {
        // A dense head on a sparse neck, whose points are farther apart than 1 / 48 of the length.
        let mut random = Random::new(9, 0);
        let mut next = || random.next_f32();
        let mut tube = |n: usize, low: f32, high: f32| -> Vec<Vec3> {
            let point = |_| {
                let (sin, cos) = (std::f32::consts::TAU * next()).sin_cos();
                Vec3::new(0.2 * cos, 0.2 * sin, low + (high - low) * next())
            };
            (0..n).map(point).collect()
        };
        let points = [tube(1400, 0.0, 0.3), tube(100, -0.4, 0.0)].concat();
        assert_eq!(without_stray_groups(points.clone()), points);
    }

    #[test]
    fn only_a_thin_fringe_is_left_out() {
        assert_eq!(without_fringe(disk(1)).len(), 5000);
        let core = without_fringe(disk(40));
        assert!((4700..4995).contains(&core.len()), "{}", core.len());
        assert!(without_fringe(Vec::new()).is_empty());
    }
}
