//! Automatic cameras: the whole cloud in the picture, stray outliers left out.

use super::light::ground_axes;
use super::prospect::automatic_direction;
use super::{Camera, Projection};
use crate::math::{Aabb, DVec3, Vec3};
use crate::points::{PointCloud, is_somewhere};

/// What is known of the wanted camera; the rest follows from the cloud.
#[derive(Clone, Copy, Debug)]
pub struct Framing {
    pub up: Vec3,
    /// Width over height of the picture.
    pub aspect: f64,
    pub is_orthographic: bool,
    pub view_angle_deg: f64,
    /// Direction of view, if it is given.
    pub direction: Option<DVec3>,
    /// What is up in the picture, if it is not `up`.
    pub view_up: Option<DVec3>,
    /// Turns the automatic position about `up`, clockwise from above.
    pub azimuth_deg: f64,
    /// Height of the automatic position over the horizon; chosen from the cloud's shape if not given.
    pub elevation_deg: Option<f64>,
    /// Values above 1 come nearer.
    pub zoom: f64,
}

impl Framing {
    /// Nothing is known but `up` and the picture's aspect.
    pub fn automatic(up: Vec3, aspect: f64) -> Self {
        Self {
            up,
            aspect,
            is_orthographic: false,
            view_angle_deg: 35.0,
            direction: None,
            view_up: None,
            azimuth_deg: 0.0,
            elevation_deg: None,
            zoom: 1.0,
        }
    }
}

/// Share of points on each side of an axis that may be stray.
const STRAY: f64 = 0.005;
/// Points looked at, at most.
const MAX_SAMPLES: usize = 200_000;
/// Free room around the cloud, as a share of the picture.
const MARGIN: f64 = 0.04;

/// A camera that shows all of `cloud` but its outliers.
pub fn frame(cloud: &PointCloud, framing: &Framing) -> Camera {
    let points = without_outliers(&sample(cloud));
    let direction = framing.direction.and_then(DVec3::try_normalize);
    let forward = direction.unwrap_or_else(|| automatic_direction(&points, framing));
    let camera = fit_along(forward, &points, framing);
    let world = |p: DVec3| cloud.origin + p;
    Camera { position: world(camera.position), focal_point: world(camera.focal_point), ..camera }
}

/// A camera that sees all around from a free place inside `cloud`; north, turned by `azimuth_deg` clockwise
/// from above, is in the middle of the picture.
pub fn look_around(cloud: &PointCloud, up: Vec3, azimuth_deg: f64) -> Camera {
    let (east, north) = ground_axes(up);
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let position = cloud.origin + free_place(cloud, up).as_dvec3();
    Camera {
        position,
        focal_point: position + sin * east.as_dvec3() + cos * north.as_dvec3(),
        view_up: up.as_dvec3(),
        projection: Projection::Panorama,
    }
}

/// Of places in the middle half of the cloud and not high up, the one farthest from all points.
fn free_place(cloud: &PointCloud, up: Vec3) -> Vec3 {
    const MOST_POINTS: usize = 20_000;
    const N_ACROSS: usize = 12;
    const N_UP: usize = 4;
    let points = without_outliers(&sample(cloud));
    let stride = points.len().div_ceil(MOST_POINTS).max(1);
    let points: Vec<Vec3> = points.iter().step_by(stride).copied().collect();
    let (east, north) = ground_axes(up);
    let within = |(low, high): (f32, f32), share: f32| low + share * (high - low);
    let [along_east, along_north, along_up] = [east, north, up].map(|axis| range(&points, axis));
    let middle = |i: usize| 0.25 + 0.5 * (i as f32 + 0.5) / N_ACROSS as f32;
    let places = (0..N_ACROSS * N_ACROSS * N_UP).map(|i| {
        let (x, y, z) = (i % N_ACROSS, i / N_ACROSS % N_ACROSS, i / (N_ACROSS * N_ACROSS));
        within(along_east, middle(x)) * east
            + within(along_north, middle(y)) * north
            + within(along_up, 0.1 * (z + 1) as f32) * up
    });
    let room = |place: Vec3| {
        points.iter().map(|p| p.distance_squared(place)).fold(f32::INFINITY, f32::min)
    };
    let freest = places.max_by(|a, b| room(*a).total_cmp(&room(*b)));
    freest.unwrap_or(Vec3::ZERO)
}

/// From where to where `points` reach along an axis.
pub(super) fn range(points: &[Vec3], axis: Vec3) -> (f32, f32) {
    let along = points.iter().map(|p| p.dot(axis));
    (along.clone().fold(f32::MAX, f32::min), along.fold(f32::MIN, f32::max))
}

/// A camera that looks along `forward` at all of `points`, and is relative to the same zero.
pub(super) fn fit_along(forward: DVec3, points: &[Vec3], framing: &Framing) -> Camera {
    let view_up = framing.view_up.unwrap_or_else(|| upright(framing.up, forward));
    let axes = Camera {
        position: DVec3::ZERO,
        focal_point: forward,
        view_up,
        projection: Projection::Orthographic { height: 1.0 },
    }
    .axes();
    let local: Vec<DVec3> =
        points.iter().map(|p| DVec3::from_array(axes.map(|axis| p.as_dvec3().dot(axis)))).collect();
    let (eye, focal, projection) = fit(&local, framing);
    let unturned = |p: DVec3| p.x * axes[0] + p.y * axes[1] + p.z * axes[2];
    Camera { position: unturned(eye), focal_point: unturned(focal), view_up, projection }
}

/// What is up in a picture seen along `forward`: the world's up, or north where that is hidden, as on a map.
pub fn upright(up: Vec3, forward: DVec3) -> DVec3 {
    let is_hidden = forward.normalize_or_zero().cross(up.as_dvec3()).length() < 1e-3;
    let up = if is_hidden { ground_axes(up).1 } else { up };
    up.as_dvec3()
}

/// Bounds of all but the outliers, relative to the cloud's origin.
pub fn usual_bounds(cloud: &PointCloud) -> Aabb {
    Aabb::of_points(without_outliers(&sample(cloud)))
}

/// The part of the view in which a cloud's points lie when their stray ones are left out.
fn without_outliers(points: &[Vec3]) -> Vec<Vec3> {
    if points.is_empty() {
        return vec![Vec3::ZERO];
    }
    let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
    for axis in 0..3 {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        let stray = (STRAY * values.len() as f64) as usize;
        let (first, last) = (values[stray], values[values.len() - 1 - stray]);
        let room = 0.25 * (last - first);
        (low[axis], high[axis]) = (first - room, last + room);
    }
    points.iter().copied().filter(|p| low.cmple(*p).all() && p.cmple(high).all()).collect()
}

fn sample(cloud: &PointCloud) -> Vec<Vec3> {
    let stride = cloud.len().div_ceil(MAX_SAMPLES).max(1);
    cloud.positions.iter().step_by(stride).copied().filter(|p| is_somewhere(*p)).collect()
}

/// Eye, focal point and projection in the camera's own axes, so that all `points` are seen.
fn fit(points: &[DVec3], framing: &Framing) -> (DVec3, DVec3, Projection) {
    let low = points.iter().fold(DVec3::INFINITY, |all, p| all.min(*p));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |all, p| all.max(*p));
    let (center, size) = (0.5 * (low + high), (high - low).max(DVec3::splat(1e-6)));
    let scale = 1.0 / (1.0 - 2.0 * MARGIN) / framing.zoom;
    if framing.is_orthographic {
        let height = scale * size.y.max(size.x / framing.aspect);
        let eye = center.with_z(low.z - size.length());
        return (eye, center, Projection::Orthographic { height });
    }
    let tan = (framing.view_angle_deg.to_radians() / 2.0).tan();
    // Each side plane of the view must have all points inside: p.x - x <= t (p.z - z) and its mirror
    // image bound x + t z and x - t z; both are met with equality by one x and one z.
    let apex = |axis: usize, t: f64| {
        let right = points.iter().map(|p| p[axis] - t * p.z).fold(f64::MIN, f64::max);
        let left = points.iter().map(|p| p[axis] + t * p.z).fold(f64::MAX, f64::min);
        (0.5 * (left + right), (left - right) / (2.0 * t))
    };
    let (x, z_of_x) = apex(0, (1.0 - 2.0 * MARGIN) * tan * framing.aspect);
    let (y, z_of_y) = apex(1, (1.0 - 2.0 * MARGIN) * tan);
    let z = z_of_x.min(z_of_y).min(low.z - 1e-3 * size.length());
    let distance = (center.z - z) / framing.zoom;
    let focal = DVec3::new(x, y, center.z);
    (
        focal.with_z(center.z - distance),
        focal,
        Projection::Perspective { view_angle_deg: framing.view_angle_deg },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    fn framing() -> Framing {
        Framing::automatic(Vec3::Z, 16.0 / 9.0)
    }

    fn box_of_points(size: Vec3) -> PointCloud {
        let mut random = Random::new(2, 0);
        let mut axis = || random.next_f32() - 0.5;
        let positions = (0..20_000).map(|_| Vec3::new(axis(), axis(), axis()) * size).collect();
        PointCloud {
            origin: DVec3::new(500_000.0, 4e6, 100.0),
            ..PointCloud::from_positions(positions)
        }
    }

    /// Bounds in pixels of what a 1600 x 900 picture shows.
    fn shown(cloud: &PointCloud, camera: &Camera) -> (f32, f32, f32, f32) {
        let view = camera.view(cloud.origin, 1600, 900);
        let places = cloud.positions.iter().filter_map(|&p| view.project(p));
        places.fold((f32::MAX, f32::MAX, f32::MIN, f32::MIN), |(a, b, c, d), (x, y, _)| {
            (a.min(x), b.min(y), c.max(x), d.max(y))
        })
    }

    /// A square room with a pillar a little off its middle.
    fn room() -> PointCloud {
        let side = |i: i32| i as f32 / 20.0;
        let mut points = Vec::new();
        for i in -60..=60 {
            for j in 0..=40 {
                let (along, height) = (side(i), side(j));
                points.extend([Vec3::new(along, -3.0, height), Vec3::new(along, 3.0, height)]);
                points.extend([Vec3::new(-3.0, along, height), Vec3::new(3.0, along, height)]);
                let (sin, cos) = side(i).sin_cos();
                points.push(Vec3::new(0.3 + 0.5 * cos, 0.2 + 0.5 * sin, height));
            }
            points.extend((-60..=60).map(|j| Vec3::new(side(i), side(j), 0.0)));
        }
        let origin = DVec3::new(500.0, 600.0, 70.0);
        PointCloud { origin, ..PointCloud::from_positions(points) }
    }

    #[test]
    fn a_panorama_is_seen_from_where_there_is_room_with_north_in_the_middle() {
        let cloud = room();
        for (azimuth_deg, toward) in [(0.0, DVec3::Y), (90.0, DVec3::X), (-90.0, DVec3::NEG_X)] {
            let camera = look_around(&cloud, Vec3::Z, azimuth_deg);
            let place = (camera.position - cloud.origin).as_vec3();
            let nearest = cloud.positions.iter().map(|p| p.distance(place)).fold(9.0, f32::min);
            assert!(0.6 < nearest && place.abs().max_element() < 2.0, "{place}");
            assert!((camera.focal_point - camera.position).distance(toward) < 1e-6);
        }
        // Anywhere in a cloud without room.
        let point = PointCloud::from_positions(vec![Vec3::ONE]);
        assert_eq!(look_around(&point, Vec3::Z, 0.0).position, DVec3::ONE);
    }

    #[test]
    fn the_cloud_fills_the_picture_and_stays_inside() {
        for size in [Vec3::ONE, Vec3::new(400.0, 300.0, 15.0), Vec3::new(0.1, 0.1, 3.0)] {
            for is_orthographic in [false, true] {
                let cloud = box_of_points(size);
                let (left, top, right, bottom) =
                    shown(&cloud, &frame(&cloud, &Framing { is_orthographic, ..framing() }));
                assert!(
                    0.0 < left && 0.0 < top && right < 1600.0 && bottom < 900.0,
                    "{left} {top} {right} {bottom}"
                );
                assert!(0.85 < ((right - left) / 1600.0).max((bottom - top) / 900.0));
            }
        }
    }

    #[test]
    fn a_stray_point_does_not_move_the_camera() {
        let cloud = box_of_points(Vec3::splat(10.0));
        let mut strayed = cloud.clone();
        strayed.positions[7] = Vec3::new(4000.0, 0.0, -9000.0);
        let (a, b) = (frame(&cloud, &framing()), frame(&strayed, &framing()));
        assert!(a.position.distance(b.position) < 0.1, "{a:?} {b:?}");
    }

    #[test]
    fn a_map_has_north_at_its_top_and_fills_the_picture() {
        let cloud = box_of_points(Vec3::new(400.0, 200.0, 15.0));
        let framing = Framing { direction: Some(-DVec3::Z), is_orthographic: true, ..framing() };
        let camera = frame(&cloud, &framing);
        assert_eq!(camera.axes()[1].round(), DVec3::Y);
        let (left, _, right, _) = shown(&cloud, &camera);
        assert!(0.85 < (right - left) / 1600.0, "{left} {right}");
    }

    #[test]
    fn the_picture_is_filled_whatever_is_up_in_it() {
        let cloud = box_of_points(Vec3::new(600.0, 266.0, 67.0));
        let map = Framing { direction: Some(-DVec3::Z), is_orthographic: true, ..framing() };
        let east_up = Framing { view_up: Some(DVec3::X), ..map };
        for (framing, expected) in [(map, 600.0 / (16.0 / 9.0)), (east_up, 600.0)] {
            let camera = frame(&cloud, &framing);
            let Projection::Orthographic { height } = camera.projection else { panic!() };
            let expected = expected / (1.0 - 2.0 * MARGIN);
            assert!((height / expected - 1.0).abs() < 0.01, "{height} {expected}");
            let (left, top, right, bottom) = shown(&cloud, &camera);
            let filled = ((right - left) / 1600.0).max((bottom - top) / 900.0);
            assert!(0.9 < filled && 0.0 < left && 0.0 < top, "{left} {top} {right} {bottom}");
        }
    }

    #[test]
    fn land_is_turned_to_be_seen_from_nearby() {
        for size in [Vec3::new(300.0, 60.0, 5.0), Vec3::new(60.0, 300.0, 5.0)] {
            let cloud = box_of_points(size);
            let distance = |azimuth_deg: f64| {
                let camera = frame(&cloud, &Framing { azimuth_deg, ..framing() });
                camera.position.distance(camera.focal_point)
            };
            assert!(distance(0.0) < 0.95 * distance(90.0), "{size}");
        }
    }

    #[test]
    fn one_point_and_none_give_a_finite_camera() {
        for positions in [vec![], vec![Vec3::ONE], vec![Vec3::ONE; 5]] {
            let camera = frame(&PointCloud::from_positions(positions), &framing());
            assert!(camera.position.is_finite() && camera.focal_point != camera.position);
        }
    }
}
