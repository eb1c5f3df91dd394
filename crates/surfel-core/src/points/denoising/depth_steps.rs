//! Depth steps: a depth camera rounds the depths that it measures, far ones to steps of centimetres.
//!
//! A slanted surface then consists of terraces, each of them even. Depths are recognised as an axis of the camera along
//! which points have few different coordinates, while they have many along the others.

use crate::math::{Random, Vec3};
use crate::points::PointCloud;
use crate::points::up::CameraAxes;

/// Number of points that are examined, and the least number that tell depths from other coordinates.
const N_SAMPLES: usize = 65_536;
const MIN_POINTS: usize = 4096;
/// Maximum fraction of different coordinates along the axis of depths, minimum fraction along both others, and minimum ratio of
/// theirs to that of the depths. A wall across the view has few coordinates along these too: one of each pixel at each of a few depths.
const MAX_DEPTHS: f32 = 0.05;
const MIN_OTHERS: f32 = 0.02;
const MIN_OTHERS_PER_DEPTH: f32 = 8.0;
/// Difference of two equal coordinates by rounding, as a fraction of the largest.
const ROUNDING: f32 = 1e-6;
/// Number of depths before and behind one that its step is averaged over.
const N_AVERAGED: usize = 3;

/// The depths to which a camera rounds.
pub struct DepthSteps {
    axis: Vec3,
    /// Coordinates along the axis in ascending order.
    depths: Vec<f32>,
}

impl DepthSteps {
    /// Returns the depths of a cloud of one depth camera, none of other clouds.
    pub fn find(cloud: &PointCloud) -> Option<Self> {
        let n_points = cloud.len();
        if n_points < MIN_POINTS {
            return None;
        }
        let (rotation, camera) = match &cloud.stations[..] {
            [station] => (station.rotation.as_quat(), station.position.unwrap_or_default()),
            _ => Default::default(),
        };
        let camera = (camera - cloud.origin).as_vec3();
        let mut random = Random::new(0, 0);
        let mut sample = || cloud.positions[random.below(n_points as u64) as usize];
        let sample: Vec<Vec3> = (0..n_points.min(N_SAMPLES)).map(|_| sample()).collect();
        let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| rotation * axis);
        let coordinates = axes.map(|axis| distinct(sample.iter().map(|point| point.dot(axis))));
        let distinct_fraction = |of: usize| coordinates[of].len() as f32 / sample.len() as f32;
        let is_depth = |axis: &usize| {
            let [next, last] = [1, 2].map(|step| distinct_fraction((axis + step) % 3));
            let min_others = MIN_OTHERS.max(MIN_OTHERS_PER_DEPTH * distinct_fraction(*axis));
            distinct_fraction(*axis) < MAX_DEPTHS && min_others < next.min(last)
        };
        let depth = (0..3).find(is_depth)?;
        // Flight lines have few coordinates along the flight as well.
        let [x, y, ahead] = [1, 2, 3].map(|step| axes[(depth + step) % 3]);
        let seen = |point: &Vec3| {
            let offset = *point - camera;
            Vec3::new(offset.dot(x), offset.dot(y), offset.dot(ahead))
        };
        let seen: Vec<Vec3> = sample.iter().map(seen).collect();
        let depths = coordinates.into_iter().nth(depth)?;
        let has_camera = CameraAxes::of_points(&seen).is_some();
        let is_found = has_camera && 2 * N_AVERAGED < depths.len();
        is_found.then_some(Self { axis: axes[depth], depths })
    }

    /// Returns the distance between the depths around a position.
    pub fn at(&self, position: Vec3) -> f32 {
        let above = self.depths.partition_point(|depth| *depth < position.dot(self.axis));
        let first = above.saturating_sub(N_AVERAGED);
        let last = (above + N_AVERAGED).min(self.depths.len() - 1);
        (self.depths[last] - self.depths[first]) / (last - first) as f32
    }
}

/// Returns the different values in ascending order.
fn distinct(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut values: Vec<f32> = values.collect();
    values.sort_unstable_by(f32::total_cmp);
    let largest = values.iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
    values.dedup_by(|value, kept| *value - *kept <= ROUNDING * largest);
    values
}

#[cfg(test)]
mod tests {
    //! Steps that are known, and clouds without any.

    use super::*;
    use crate::math::DQuat;
    use crate::points::ScanStation;

    /// A slanted plane as a camera at the origin sees it along z, with disparities rounded to `1 / disparities`.
    fn slanted(disparities: Option<f32>) -> PointCloud {
        let point = |pixel: usize| {
            let (x, y) = (-0.5 + (pixel % 200) as f32 / 200.0, -0.5 + (pixel / 200) as f32 / 200.0);
            let depth = 2.0 / (1.0 - y - 0.613 * x);
            let depth = disparities.map_or(depth, |n| n / (n / depth).round());
            depth * Vec3::new(x, y, 1.0)
        };
        PointCloud::from_positions((0..40_000).map(point).collect())
    }

    #[test]
    fn steps_of_a_disparity_grow_with_the_square_of_the_depth() {
        let steps = DepthSteps::find(&slanted(Some(300.0))).unwrap();
        for depth in [1.5, 2.0, 3.0f32] {
            let expected = depth * depth / 300.0;
            let found = steps.at(Vec3::new(0.3, 0.4, depth));
            assert!((found / expected - 1.0).abs() < 0.1, "{found} instead of {expected}");
        }
    }

    #[test]
    fn depths_lie_along_an_axis_of_the_camera() {
        let rotation = DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(0.3);
        let mut cloud = slanted(Some(300.0));
        cloud.positions.iter_mut().for_each(|point| *point = rotation.as_quat() * *point);
        assert!(DepthSteps::find(&cloud).is_none());
        cloud.stations = vec![ScanStation { rotation, ..ScanStation::default() }];
        let found =
            DepthSteps::find(&cloud).unwrap().at(rotation.as_quat() * Vec3::new(0.0, 0.0, 2.0));
        assert!((found / (4.0 / 300.0) - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn steps_are_found_on_a_wall_across_the_view() {
        let depth =
            |pixel: usize| 2.3 + 0.002 * (pixel / 200) as f32 + 0.002 * (pixel % 200) as f32;
        let point = |pixel: usize| {
            let (x, y) = (-0.5 + (pixel % 200) as f32 / 200.0, -0.5 + (pixel / 200) as f32 / 200.0);
            300.0 / (300.0 / depth(pixel)).round() * Vec3::new(x, y, 1.0)
        };
        let wall = PointCloud::from_positions((0..40_000).map(point).collect());
        let found = DepthSteps::find(&wall).unwrap().at(Vec3::new(0.0, 0.0, 2.5));
        assert!((found / (2.5 * 2.5 / 300.0) - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn other_clouds_have_no_steps() {
        let grid = (0..40_000).map(|i| Vec3::new((i % 200) as f32, (i / 200) as f32, 0.0));
        assert!(DepthSteps::find(&PointCloud::from_positions(grid.collect())).is_none());
        assert!(DepthSteps::find(&slanted(None)).is_none());
        let flight_lines = (0..40_000).map(|i| {
            let across = (i % 200) as f32 - 100.0;
            Vec3::new(across + 1e-3 * (i as f32).sin(), 0.5 * (i / 200) as f32, (i as f32).cos())
        });
        assert!(DepthSteps::find(&PointCloud::from_positions(flight_lines.collect())).is_none());
        assert!(DepthSteps::find(&PointCloud::default()).is_none());
    }
}
