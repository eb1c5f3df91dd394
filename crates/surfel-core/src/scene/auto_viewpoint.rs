//! Automatic viewpoints: the direction of view for a cloud of unknown content.

use super::camera::{Camera, Projection};
use super::camera_fit::{CameraFit, fit_along};
use super::corridor::view_along;
use super::depth_map::DepthMap;
use super::ground::{direction, ground_axes};
use super::inliers::range_along;
use crate::math::{DQuat, DVec3, Vec3};

/// Azimuth of the viewpoint if no other is clearly better: south, a little to the east.
const FRONT_AZIMUTH_DEG: f64 = 155.0;
/// Another azimuth must show this fraction of the points more than the front: closed objects look alike from all sides.
const MIN_GAIN: f64 = 0.1;
/// Viewpoint above an object that was scanned from there: north is up in the picture.
const ABOVE_AZIMUTH_DEG: f64 = 180.0;
const ABOVE_ELEVATION_DEG: f64 = 80.0;
/// Height over width from which an object counts as upright: it has a front and a back.
const MIN_UPRIGHT_FLATNESS: f64 = 0.6;
/// Elevations of the viewpoint of a cloud without height and of upright objects; in between it changes with the height.
const FLAT_ELEVATION_DEG: f64 = 40.0;
const UPRIGHT_ELEVATION_DEG: f64 = 15.0;
/// Height over width below which a cloud counts as terrain.
const MAX_TERRAIN_FLATNESS: f64 = 0.25;

/// Returns the direction of view toward `points`: the flatter the cloud, the higher the viewpoint.
///
/// Terrain has no front, so it is viewed from where it fills the picture best, and along its length if it is a corridor.
/// Anything else is viewed from the side from which most points are visible, or from above if it was scanned from there.
/// Objects that are visible equally well from all sides are viewed from the side that models face by convention, or from
/// behind it if that side has more relief.
pub(super) fn automatic_direction(points: &[Vec3], fit: &CameraFit) -> DVec3 {
    let (east, north) = ground_axes(fit.up);
    let extent = |axis: Vec3| {
        let (low, high) = range_along(points, axis);
        high - low
    };
    let flatness = f64::from(extent(fit.up) / extent(east).max(extent(north)).max(1e-9));
    let uprightness = (flatness / MIN_UPRIGHT_FLATNESS).min(1.0);
    let automatic_deg =
        FLAT_ELEVATION_DEG + (UPRIGHT_ELEVATION_DEG - FLAT_ELEVATION_DEG) * uprightness;
    let elevation_deg = fit.elevation_deg.unwrap_or(automatic_deg);
    let (azimuth_deg, elevation_deg) = if flatness < MAX_TERRAIN_FLATNESS {
        (best_fit_azimuth_deg(points, elevation_deg, fit), elevation_deg)
    } else {
        let azimuth_deg = most_visible_azimuth_deg(points, elevation_deg, fit);
        let is_front = azimuth_deg == FRONT_AZIMUTH_DEG && MIN_UPRIGHT_FLATNESS <= flatness;
        let from_side = (
            if is_front { front_azimuth_deg(points, elevation_deg, fit) } else { azimuth_deg },
            elevation_deg,
        );
        let from_above = (ABOVE_AZIMUTH_DEG, ABOVE_ELEVATION_DEG);
        let is_open = fit.elevation_deg.is_none() && !fit.is_turntable;
        if is_open && is_scan_from(from_above, from_side, points, fit) {
            from_above
        } else {
            from_side
        }
    };
    let across = direction_from(azimuth_deg, elevation_deg, fit.up);
    let along = if fit.is_turntable { None } else { view_along(points, across, fit) };
    // Azimuths count clockwise seen from above.
    let turn = DQuat::from_axis_angle(fit.up.as_dvec3(), -fit.azimuth_deg.to_radians());
    turn * along.unwrap_or(across)
}

/// True if nearly all points are visible from azimuth and elevation `seen_from`, and clearly more than from `side`: they are
/// a scan from there.
fn is_scan_from(seen_from: (f64, f64), side: (f64, f64), points: &[Vec3], fit: &CameraFit) -> bool {
    /// Fraction of the points that is visible from where a scan was made: edges hide some.
    const MIN_VISIBLE: f64 = 0.9;
    /// Minimum gain over the view from the side, from which objects are usually looked at.
    const MIN_GAIN: f64 = 0.15;
    let fraction = visible_from(seen_from, points, fit);
    MIN_VISIBLE < fraction && visible_from(side, points, fit) + MIN_GAIN < fraction
}

/// Returns the azimuth in the south from which the nearest camera shows the whole cloud.
fn best_fit_azimuth_deg(points: &[Vec3], elevation_deg: f64, fit: &CameraFit) -> f64 {
    let sample: Vec<Vec3> = points.iter().step_by(points.len().div_ceil(10_000)).copied().collect();
    let distance = |azimuth_deg: f64| {
        let forward = direction_from(azimuth_deg, elevation_deg, fit.up);
        let camera = fit_along(forward, &sample, fit);
        match camera.projection {
            Projection::Orthographic { height } => height,
            _ => camera.position.distance(camera.focal_point),
        }
    };
    let azimuths = (0..12).map(|step| FRONT_AZIMUTH_DEG + 15.0 * f64::from(step) - 60.0);
    let nearest = azimuths.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    nearest.unwrap_or(FRONT_AZIMUTH_DEG)
}

/// Returns the azimuth from which the most points are visible.
///
/// A scan from one side shows all points from where the scanner stood, and hollow backs from behind.
fn most_visible_azimuth_deg(points: &[Vec3], elevation_deg: f64, fit: &CameraFit) -> f64 {
    let visible = |azimuth_deg: f64| visible_from((azimuth_deg, elevation_deg), points, fit);
    let azimuths = (1..12).map(|step| FRONT_AZIMUTH_DEG + 30.0 * f64::from(step));
    let fractions = azimuths.map(|azimuth_deg| (visible(azimuth_deg), azimuth_deg));
    let best = fractions.max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((fraction, azimuth_deg)) if visible(FRONT_AZIMUTH_DEG) + MIN_GAIN < fraction => {
            azimuth_deg
        }
        _ => FRONT_AZIMUTH_DEG,
    }
}

/// Returns the azimuth of an upright object's front: the usual one, or the opposite if that has more relief and shows as much.
///
/// Models face +Z if up is +Y and -Y if up is +Z, which is south in both cases. Faces, hands and feet give the front of
/// a figure more relief than its back: the back of the Stanford armadillo, which faces north, has 0.77 times as much;
/// the two sides of the bunny, which faces west, differ by 4 %. The hollow back of a statue behind shrubs has the most relief.
fn front_azimuth_deg(points: &[Vec3], elevation_deg: f64, fit: &CameraFit) -> f64 {
    /// Relief of the opposite side over that of the usual front from which the opposite side is shown.
    const MIN_RELIEF_RATIO: f64 = 1.15;
    let around = |middle_deg: f64| {
        let sides = [-30.0, 0.0, 30.0].map(|turn_deg| middle_deg + turn_deg);
        sides.map(|azimuth_deg| relief(points, azimuth_deg, fit.up)).iter().sum::<f64>()
    };
    let opposite = FRONT_AZIMUTH_DEG + 180.0;
    let visible = |azimuth_deg: f64| visible_from((azimuth_deg, elevation_deg), points, fit);
    let is_opposite = MIN_RELIEF_RATIO * around(180.0) < around(0.0)
        && visible(FRONT_AZIMUTH_DEG) <= visible(opposite) + MIN_GAIN;
    if is_opposite { opposite } else { FRONT_AZIMUTH_DEG }
}

/// Returns the mean unevenness of the surface that is visible horizontally from an azimuth: the absolute Laplacian of
/// a small orthographic depth map, in pixels.
fn relief(points: &[Vec3], azimuth_deg: f64, up: Vec3) -> f64 {
    /// Limit of the Laplacian: silhouettes of limbs count, but not by their depth.
    const MAX_UNEVENNESS: f32 = 4.0;
    let forward = direction_from(azimuth_deg, 0.0, up).as_vec3();
    let right = forward.cross(up);
    // Each pixel has some ten points on each side of the object.
    let n_across = ((points.len() as f64 / 10.0).sqrt() as usize).clamp(8, 64);
    let (left, end) = range_along(points, right);
    let (bottom, top) = range_along(points, up);
    let pixel_size = ((end - left).max(top - bottom) / n_across as f32).max(f32::MIN_POSITIVE);
    let stride = n_across + 3;
    // A border of one empty pixel surrounds the picture.
    let mut nearest = vec![f32::INFINITY; stride * stride];
    for point in points {
        let column = ((point.dot(right) - left) / pixel_size) as usize;
        let row = ((point.dot(up) - bottom) / pixel_size) as usize;
        let depth = &mut nearest[(row.min(n_across) + 1) * stride + column.min(n_across) + 1];
        *depth = depth.min(point.dot(forward) / pixel_size);
    }
    let inner =
        (1..=n_across + 1).flat_map(|row| (1..=n_across + 1).map(move |column| (row, column)));
    let laplacians = inner.map(|(row, column)| {
        let pixel = row * stride + column;
        let around = [pixel - 1, pixel + 1, pixel - stride, pixel + stride];
        around.iter().map(|neighbor| nearest[*neighbor] - nearest[pixel]).sum::<f32>()
    });
    let covered = laplacians.filter(|laplacian| laplacian.is_finite());
    let (sum, count) = covered.fold((0.0, 0usize), |(sum, count), laplacian| {
        (sum + f64::from(laplacian.abs().min(MAX_UNEVENNESS)), count + 1)
    });
    sum / count.max(1) as f64
}

/// Returns the fraction of the points that are visible from this azimuth and elevation.
fn visible_from((azimuth_deg, elevation_deg): (f64, f64), points: &[Vec3], fit: &CameraFit) -> f64 {
    let forward = direction_from(azimuth_deg, elevation_deg, fit.up);
    visible_fraction(points, &fit_along(forward, points, fit), fit.aspect)
}

/// Returns the fraction of the points that no other point hides in a small picture.
fn visible_fraction(points: &[Vec3], camera: &Camera, aspect: f64) -> f64 {
    let map = DepthMap::new(points, camera, aspect);
    // A surface that is slanted within a pixel must not hide itself.
    let span = match camera.projection {
        Projection::Orthographic { .. } => 1.0,
        _ => camera.position.distance(camera.focal_point) as f32,
    };
    let slack = 4.0 * span * map.view.pixel_size();
    let n_visible = points.iter().filter(|point| map.shows(**point, slack)).count();
    n_visible as f64 / points.len() as f64
}

/// Returns the direction of view from a viewpoint at this azimuth and elevation.
fn direction_from(azimuth_deg: f64, elevation_deg: f64, up: Vec3) -> DVec3 {
    -direction(azimuth_deg, elevation_deg, up)
}

#[cfg(test)]
mod tests {
    //! Scans are viewed from the scanner's side, closed objects from the front.

    use super::*;
    use crate::math::Random;

    /// Two vertical sheets, one behind the other seen from `front`; the nearer one is half as wide.
    fn sheets(front: Vec3) -> Vec<Vec3> {
        let side = front.cross(Vec3::Z);
        let sheet = |depth: f32, width: f32| {
            (0..10_000).map(move |i| {
                let (u, v) = ((i % 100) as f32 / 99.0 - 0.5, (i / 100) as f32 / 99.0 - 0.5);
                depth * front + 2.0 * width * u * side + 2.0 * v * Vec3::Z
            })
        };
        // The scanner sees the rear sheet only where the front one does not hide it.
        let rear = sheet(-1.0, 1.0).filter(|p| 0.5 < p.dot(side).abs());
        sheet(1.0, 0.5).chain(rear).collect()
    }

    #[test]
    fn a_scan_is_viewed_from_the_side_of_the_scanner() {
        for front in [Vec3::X, Vec3::NEG_X, Vec3::Y] {
            let fit = CameraFit { aspect: 1.5, ..CameraFit::default() };
            let forward = automatic_direction(&sheets(front), &fit);
            // The sheets hide each other a little from every side but the front and the back.
            assert!(0.4 < forward.dot(front.as_dvec3()).abs(), "{front}: {forward}");
        }
    }

    #[test]
    fn a_figure_is_viewed_from_the_side_with_more_relief() {
        // A column with a smooth back and a front of horizontal ridges.
        for toward in [Vec3::NEG_Y, Vec3::Y] {
            let column = (0..40_000).map(|i| {
                let height = i as f32 / 20_000.0;
                let (sin, cos) = (2.399_963 * i as f32).sin_cos();
                let radius = if cos < 0.0 { 0.5 } else { 0.5 + 0.03 * (40.0 * height).sin() };
                radius * cos * toward + radius * sin * Vec3::X + height * Vec3::Z
            });
            let fit = CameraFit { aspect: 1.5, ..CameraFit::default() };
            let forward = automatic_direction(&column.collect::<Vec<Vec3>>(), &fit);
            assert!(forward.dot(toward.as_dvec3()) < -0.5, "{toward}: {forward}");
        }
    }

    #[test]
    fn a_hollow_back_behind_shrubs_is_no_front() {
        // Half a column, whose closed side faces the usual viewpoint, and leaves on its open side.
        let toward = -direction_from(FRONT_AZIMUTH_DEG, 0.0, Vec3::Z).as_vec3();
        let point = |across: f32, ahead: f32, height: f32| {
            across * toward.cross(Vec3::Z) + ahead * toward + height * Vec3::Z
        };
        let column = (0..40_000).map(|i| {
            let (height, angle) = (i as f32 / 20_000.0, 2.399_963 * i as f32);
            point(0.5 * angle.sin(), 0.5 * angle.cos().abs(), height)
        });
        let mut random = Random::new(8, 0);
        let mut next = || random.next_f32() - 0.5;
        let leaves = (0..4000).map(|_| point(1.6 * next(), next() - 1.0, 1.6 * next() + 1.0));
        let points: Vec<Vec3> = column.chain(leaves).collect();
        let forward = automatic_direction(&points, &CameraFit::default());
        assert!(forward.dot(toward.as_dvec3()) < -0.9, "{forward}");
    }

    #[test]
    fn an_object_scanned_from_above_is_viewed_from_there() {
        // Hills, and the same with a floor, which they hide from above.
        let side = |i: usize| i as f32 / 150.0 - 1.0;
        let hill = |i: usize| {
            let (x, y) = (side(i % 300), side(i / 300));
            Vec3::new(x, y, 0.35 * (8.0 * x).sin() * (8.0 * y).sin())
        };
        let hills: Vec<Vec3> = (0..90_000).map(hill).collect();
        let floor = hills.iter().map(|hill| Vec3::new(hill.x, hill.y, -0.35));
        let closed: Vec<Vec3> = hills.iter().copied().chain(floor).collect();
        let fit = CameraFit { up: Vec3::Z, ..CameraFit::default() };
        let down = |points: &[Vec3]| -automatic_direction(points, &fit).z;
        let [open, closed] = [&hills, &closed].map(|points| down(points));
        assert!(0.95 < open && closed < 0.6, "{open} {closed}");
    }

    #[test]
    fn a_closed_object_is_viewed_from_the_front() {
        let ball = (0..20_000).map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 20_000.0;
            let (sin, cos) = (2.399_963 * i as f32).sin_cos();
            Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        });
        let points: Vec<Vec3> = ball.collect();
        let fit = CameraFit { aspect: 1.5, ..CameraFit::default() };
        let forward = automatic_direction(&points, &fit);
        let expected = direction_from(FRONT_AZIMUTH_DEG, UPRIGHT_ELEVATION_DEG, Vec3::Z);
        assert!(forward.distance(expected) < 1e-6, "{forward}");
    }
}
