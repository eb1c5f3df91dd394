//! Views along corridors: roads, railways, power lines and rivers are long strips, which fill little of a picture across.

use super::camera_fit::{CameraFit, fit_along};
use super::depth_map::small_aspect;
use super::ground::ground_axes;
use super::inliers::range_along;
use crate::math::{DVec3, Vec3};

/// Minimum ratio of the length of a corridor to its width and to its height.
const MIN_LENGTH_RATIO: f32 = 4.0;
/// Minimum length of a corridor in the unit of the file: long objects are smaller.
const MIN_LENGTH: f32 = 50.0;
/// Angles between the view and the corridor in degrees.
const TURNS_DEG: [f64; 5] = [-20.0, -10.0, 0.0, 10.0, 20.0];
/// Elevations of the viewpoint in degrees: the lower, the nearer is the near end.
const ELEVATIONS_DEG: [f64; 4] = [16.0, 20.0, 25.0, 32.0];

/// Returns the direction along a corridor from one of its ends that fills the picture best, or `None` if the points are
/// no corridor or fill it well from `other`.
pub(super) fn view_along(points: &[Vec3], other: DVec3, fit: &CameraFit) -> Option<DVec3> {
    /// Minimum ratio of the filled parts of the picture: across, more of the corridor is shown in detail.
    const MIN_GAIN: f64 = 1.25;
    /// Maximum number of points that are looked at.
    const MAX_POINTS: usize = 50_000;
    let axis = long_axis(points, fit.up)?;
    let step = points.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<Vec3> = points.iter().step_by(step).copied().collect();
    let elevations_deg = fit.elevation_deg.map_or(ELEVATIONS_DEG.to_vec(), |given| vec![given]);
    let views = [axis, -axis].into_iter().flat_map(|ahead| {
        let turns = TURNS_DEG.into_iter().map(move |turn_deg| (ahead, turn_deg));
        let with_elevation = |(ahead, turn_deg)| {
            elevations_deg.iter().map(move |elevation_deg| (ahead, turn_deg, *elevation_deg))
        };
        turns.flat_map(with_elevation)
    });
    let direction = |(ahead, turn_deg, elevation_deg): (Vec3, f64, f64)| {
        let (ahead, up) = (ahead.as_dvec3(), fit.up.as_dvec3());
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        let (sin_down, cos_down) = elevation_deg.to_radians().sin_cos();
        cos_down * (cos * ahead + sin * up.cross(ahead)) - sin_down * up
    };
    let filled =
        views.map(direction).map(|forward| (filled_fraction(&points, forward, fit), forward));
    let (best, forward) = filled.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (MIN_GAIN * filled_fraction(&points, other, fit) <= best).then_some(forward)
}

/// Returns the horizontal direction in which the points extend most, if they are a corridor.
pub(super) fn long_axis(points: &[Vec3], up: Vec3) -> Option<Vec3> {
    let (east, north) = ground_axes(up);
    let count = points.len().max(1) as f64;
    let ground = || points.iter().map(|p| (f64::from(p.dot(east)), f64::from(p.dot(north))));
    let mean = ground().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / count, sum.1 + p.1 / count));
    let offsets = ground().map(|p| (p.0 - mean.0, p.1 - mean.1));
    let [xx, xy, yy] =
        offsets.fold([0.0; 3], |[xx, xy, yy], (x, y)| [xx + x * x, xy + x * y, yy + y * y]);
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    let axis = (angle.cos() as f32) * east + (angle.sin() as f32) * north;
    let extent = |axis: Vec3| {
        let (low, high) = range_along(points, axis);
        high - low
    };
    let width = extent(up.cross(axis)).max(extent(up));
    let length = extent(axis);
    (MIN_LENGTH <= length && MIN_LENGTH_RATIO * width <= length).then_some(axis)
}

/// Returns the fraction of the cells of a small picture that show points, if the camera looks along `forward` and sees
/// all of them.
fn filled_fraction(points: &[Vec3], forward: DVec3, fit: &CameraFit) -> f64 {
    const HEIGHT: u32 = 27;
    let width = (f64::from(HEIGHT) * small_aspect(fit.aspect)).round().max(1.0) as u32;
    let view = fit_along(forward, points, fit).view(DVec3::ZERO, width, HEIGHT);
    let mut is_filled = vec![false; (width * HEIGHT) as usize];
    for (x, y, _) in points.iter().filter_map(|point| view.project(*point)) {
        if (0.0..width as f32).contains(&x) && (0.0..HEIGHT as f32).contains(&y) {
            is_filled[y as usize * width as usize + x as usize] = true;
        }
    }
    is_filled.iter().filter(|filled| **filled).count() as f64 / is_filled.len() as f64
}

#[cfg(test)]
mod tests {
    //! Strips are seen along their length, other clouds are not.

    use super::*;
    use crate::math::Random;

    fn ground(size: Vec3) -> Vec<Vec3> {
        let mut random = Random::new(4, 0);
        let mut point = || Vec3::new(random.next_f32(), random.next_f32(), random.next_f32());
        (0..20_000).map(|_| (point() - 0.5) * size).collect()
    }

    /// A view from the south-east at 38 degrees.
    fn across() -> DVec3 {
        DVec3::new(-0.5, 0.87, -0.78).normalize()
    }

    #[test]
    fn a_road_is_seen_along_its_length() {
        for axis in [Vec3::X, Vec3::Y] {
            let road = ground(Vec3::new(12.0, 12.0, 5.0) + 388.0 * axis);
            let forward = view_along(&road, across(), &CameraFit::default()).unwrap();
            assert!(0.8 < forward.dot(axis.as_dvec3()).abs() && forward.z < -0.2, "{forward}");
        }
    }

    #[test]
    fn fields_beams_and_few_points_are_no_corridors() {
        for size in [Vec3::new(300.0, 100.0, 5.0), Vec3::new(6.0, 0.3, 0.4)] {
            let found = view_along(&ground(size), across(), &CameraFit::default());
            assert_eq!(found, None, "{size}");
        }
        for points in [vec![], vec![Vec3::ONE]] {
            let found = view_along(&points, across(), &CameraFit::default());
            assert!(found.is_none_or(DVec3::is_finite), "{found:?}");
        }
    }
}
