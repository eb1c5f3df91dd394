//! Cameras that go around a cloud and show all of it from everywhere.

use super::camera::Camera;
use super::camera_fit::{CameraFit, fit_along};
use super::ground::ground_axes;
use super::inliers::range_along;
use crate::math::{DVec3, Vec3};
use std::f32::consts::TAU;

/// Number of layers along the axis for each of which the farthest point from the axis is looked for.
const N_LAYERS: usize = 64;
/// Number of positions around the axis that a point takes during a turn.
const N_AZIMUTHS: usize = 48;

/// Returns the camera that looks along `forward` and shows all of `points`, in their coordinates, while it is rotated
/// about the vertical axis through its focal point.
pub(super) fn fit_turntable(forward: DVec3, points: &[Vec3], fit: &CameraFit) -> Camera {
    let axis = middle(points, fit.up);
    let camera = fit_along(forward, &swept_points(forward, points, axis, fit.up), fit);
    let up = fit.up.as_dvec3();
    let ahead = forward - forward.dot(up) * up;
    let distance = ahead.dot(axis.as_dvec3() - camera.position) / ahead.length_squared();
    // A view straight down is in front of the axis everywhere.
    if !distance.is_finite() || distance <= 0.0 {
        return camera;
    }
    Camera { focal_point: camera.position + distance * forward, ..camera }
}

/// Returns the middle of the points.
fn middle(points: &[Vec3], up: Vec3) -> Vec3 {
    let (east, north) = ground_axes(up);
    let along = |axis: Vec3| {
        let (low, high) = range_along(points, axis);
        0.5 * (low + high) * axis
    };
    along(east) + along(north) + along(up)
}

/// Returns points around all that `points` pass in one turn about the vertical axis through `axis`.
fn swept_points(forward: DVec3, points: &[Vec3], axis: Vec3, up: Vec3) -> Vec<Vec3> {
    let (low, high) = range_along(points, up);
    let height = ((high - low) / N_LAYERS as f32).max(f32::MIN_POSITIVE);
    let mut radii = [0f32; N_LAYERS];
    for point in points {
        let layer = ((point.dot(up) - low) / height) as usize;
        let offset = *point - axis;
        let radius = (offset - offset.dot(up) * up).length();
        let layer = &mut radii[layer.min(N_LAYERS - 1)];
        *layer = layer.max(radius);
    }
    // Positions that are symmetric about the direction of view keep the axis in the middle of the picture.
    let ahead = forward.as_vec3();
    let right = ahead.cross(up).normalize_or(ground_axes(up).0);
    let ahead = up.cross(right);
    let layers = (0..).zip(radii).filter(|(_, radius)| 0.0 < *radius);
    let ring = |(layer, radius): (u16, f32)| {
        // The corners of a polygon around the circle.
        let radius = radius / (TAU / 2.0 / N_AZIMUTHS as f32).cos();
        let bottom = low + f32::from(layer) * height;
        (0..2 * N_AZIMUTHS).map(move |i| {
            let (sin, cos) = (TAU * (i / 2) as f32 / N_AZIMUTHS as f32).sin_cos();
            let level = bottom + (i % 2) as f32 * height - axis.dot(up);
            axis + radius * (cos * ahead + sin * right) + level * up
        })
    };
    let swept: Vec<Vec3> = layers.flat_map(ring).collect();
    if swept.is_empty() { points.to_vec() } else { swept }
}

#[cfg(test)]
mod tests {
    //! A cloud stays in the picture for a whole turn, and fills it somewhere.

    use super::*;
    use crate::math::{DQuat, Random};
    use crate::points::PointCloud;
    use crate::scene::fit_camera;

    fn cuboid(size: Vec3) -> PointCloud {
        let mut random = Random::new(3, 0);
        let mut axis = || random.next_f32() - 0.2;
        let positions = (0..20_000).map(|_| Vec3::new(axis(), axis(), axis()) * size).collect();
        let origin = DVec3::new(500.0, 600.0, 70.0);
        PointCloud { origin, ..PointCloud::from_positions(positions) }
    }

    /// Returns the greatest distance from the middle of the picture over all points, in halves of its size.
    fn extent(cloud: &PointCloud, camera: &Camera) -> f32 {
        let view = camera.view(cloud.origin, 1600, 900);
        let across = cloud.positions.iter().map(|position| {
            let (x, y, _) = view.project(*position).unwrap();
            (x / 800.0 - 1.0).abs().max((y / 450.0 - 1.0).abs())
        });
        across.fold(0.0, f32::max)
    }

    #[test]
    fn all_of_a_cloud_is_seen_for_a_whole_turn() {
        for size in [Vec3::new(8.0, 1.0, 2.0), Vec3::new(1.0, 1.0, 5.0), Vec3::splat(3.0)] {
            for is_orthographic in [false, true] {
                let cloud = cuboid(size);
                let fit = CameraFit { is_turntable: true, is_orthographic, ..CameraFit::default() };
                let camera = fit_camera(&cloud, &fit);
                let extents = (0..24).map(|step| {
                    let turn = DQuat::from_rotation_z(f64::from(step) * 0.2618);
                    extent(&cloud, &camera.rotated_about_focal_point(turn))
                });
                let widest = extents.fold(0.0, f32::max);
                assert!((0.8..1.0).contains(&widest), "{size} {is_orthographic}: {widest}");
            }
        }
    }

    #[test]
    fn a_view_straight_down_and_a_single_point_give_a_finite_camera() {
        let (down, is_turntable) = (Some(DVec3::NEG_Z), true);
        for (cloud, direction) in [
            (cuboid(Vec3::ONE), down),
            (PointCloud::from_positions(vec![Vec3::ONE]), None),
            (PointCloud::default(), down),
        ] {
            let fit = CameraFit { direction, is_turntable, ..CameraFit::default() };
            let camera = fit_camera(&cloud, &fit);
            assert!(camera.position.is_finite() && camera.focal_point.is_finite(), "{camera:?}");
            assert_ne!(camera.position, camera.focal_point);
        }
    }
}
