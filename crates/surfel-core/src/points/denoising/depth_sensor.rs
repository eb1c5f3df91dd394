//! The depth camera that measured a cloud, and the steps to which it rounds depths: far ones to centimetres.
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
const MAX_DEPTHS: f32 = 0.12;
const MIN_OTHERS: f32 = 0.02;
const MIN_OTHERS_PER_DEPTH: f32 = 4.0;
/// Difference of two equal coordinates by rounding, as a fraction of the largest.
const ROUNDING: f32 = 1e-6;
/// Number of depths before and behind one that its step is averaged over.
const N_AVERAGED: usize = 3;

/// The depth camera of a cloud.
pub struct DepthSensor {
    /// Position relative to the origin of the cloud.
    pub position: Vec3,
    /// Direction of the view. Both axes of the image are perpendicular to it.
    ahead: Vec3,
    image_axes: [Vec3; 2],
    /// The depths to which the camera rounds, in ascending order.
    depths: Vec<f32>,
}

impl DepthSensor {
    /// Returns the camera of a cloud of one depth camera, none of other clouds.
    pub fn find(cloud: &PointCloud) -> Option<Self> {
        let n_points = cloud.len();
        if n_points < MIN_POINTS {
            return None;
        }
        let (rotation, position) = match &cloud.stations[..] {
            [station] => (station.rotation.as_quat(), station.position.unwrap_or_default()),
            _ => Default::default(),
        };
        let position = (position - cloud.origin).as_vec3();
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
            let offset = *point - position;
            Vec3::new(offset.dot(x), offset.dot(y), offset.dot(ahead))
        };
        let seen: Vec<Vec3> = sample.iter().map(seen).collect();
        let ahead = CameraAxes::of_points(&seen)?.ahead().z * ahead;
        let depths = distinct(sample.iter().map(|point| (*point - position).dot(ahead)));
        let has_steps = 2 * N_AVERAGED < depths.len();
        has_steps.then_some(Self { position, ahead, image_axes: [x, y], depths })
    }

    /// Returns where a point is in the image, as the tangents of its angles from the view along both axes, and its disparity, the
    /// reciprocal of its depth; none beyond the field of view.
    pub fn project(&self, point: Vec3) -> Option<Vec3> {
        let offset = point - self.position;
        let [x, y] = self.image_axes.map(|axis| offset.dot(axis));
        let depth = offset.dot(self.ahead);
        let is_seen = CameraAxes::YDown.sees(Vec3::new(x, y, depth));
        is_seen.then(|| Vec3::new(x, y, 1.0) / depth)
    }

    /// Returns the difference of the disparities around one.
    pub fn disparity_step(&self, disparity: f32) -> f32 {
        self.step(disparity.recip()) * disparity * disparity
    }

    /// Returns the distance between the depths around one.
    fn step(&self, depth: f32) -> f32 {
        let above = self.depths.partition_point(|own| *own < depth);
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
        let steps = DepthSensor::find(&slanted(Some(300.0))).unwrap();
        for depth in [1.5, 2.0, 3.0f32] {
            let expected = depth * depth / 300.0;
            let found = steps.step(depth);
            assert!((found / expected - 1.0).abs() < 0.1, "{found} instead of {expected}");
        }
    }

    #[test]
    fn depths_lie_along_an_axis_of_the_camera() {
        let rotation = DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(0.3);
        let mut cloud = slanted(Some(300.0));
        cloud.positions.iter_mut().for_each(|point| *point = rotation.as_quat() * *point);
        assert!(DepthSensor::find(&cloud).is_none());
        cloud.stations = vec![ScanStation { rotation, ..ScanStation::default() }];
        let sensor = DepthSensor::find(&cloud).unwrap();
        assert!((sensor.step(2.0) / (4.0 / 300.0) - 1.0).abs() < 0.1);
        let project = |point: Vec3| sensor.project(rotation.as_quat() * point);
        let seen = project(Vec3::new(0.6, -0.4, 2.0)).unwrap();
        assert!(seen.distance(Vec3::new(0.3, -0.2, 0.5)) < 1e-6, "{seen}");
        for beside in [Vec3::new(0.6, -0.4, -2.0), Vec3::X, Vec3::ZERO, Vec3::NAN] {
            assert_eq!(project(beside), None);
        }
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
        let found = DepthSensor::find(&wall).unwrap().step(2.5);
        assert!((found / (2.5 * 2.5 / 300.0) - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn other_clouds_have_no_steps() {
        let grid = (0..40_000).map(|i| Vec3::new((i % 200) as f32, (i / 200) as f32, 0.0));
        assert!(DepthSensor::find(&PointCloud::from_positions(grid.collect())).is_none());
        assert!(DepthSensor::find(&slanted(None)).is_none());
        let flight_lines = (0..40_000).map(|i| {
            let across = (i % 200) as f32 - 100.0;
            Vec3::new(across + 1e-3 * (i as f32).sin(), 0.5 * (i / 200) as f32, (i as f32).cos())
        });
        assert!(DepthSensor::find(&PointCloud::from_positions(flight_lines.collect())).is_none());
        assert!(DepthSensor::find(&PointCloud::default()).is_none());
    }
}
