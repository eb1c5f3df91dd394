//! Automatic cameras: they show all of a cloud but its outliers, or look all around from inside of it.

use super::auto_viewpoint::automatic_direction;
use super::camera::{Camera, Projection};
use super::camera_fit::{CameraFit, fit_along};
use super::ground::{direction, ground_axes};
use super::inliers::{range_along, sample_inliers, sample_middle};
use super::turntable::fit_turntable;
use crate::math::{DVec3, Vec3};
use crate::points::PointCloud;

/// Radius of a point without neighbours and without a radius of its own, as the preparation gives it.
const LONE_RADIUS: f32 = 1.0;

/// Returns a camera that shows all of `cloud` but its outliers and a thin fringe far away from its middle, of each part
/// of a sampled scene for itself.
pub fn fit_camera(cloud: &PointCloud, fit: &CameraFit) -> Camera {
    let radius = cloud.radii.as_ref().and_then(|radii| radii.first().copied());
    let radius = radius.filter(|radius| 0.0 < *radius && radius.is_finite());
    let points = with_extent(sample_middle(cloud), radius.unwrap_or(LONE_RADIUS));
    let direction = fit.direction.and_then(DVec3::try_normalize);
    let forward = direction.unwrap_or_else(|| automatic_direction(&points, fit));
    let camera = match fit.is_turntable {
        true => fit_turntable(forward, &points, fit),
        false => fit_along(forward, &points, fit),
    };
    let world = |p: DVec3| cloud.origin + p;
    Camera { position: world(camera.position), focal_point: world(camera.focal_point), ..camera }
}

/// Returns `points`, or the corners of the cube around a ball of `radius` if all of them are at one position.
fn with_extent(points: Vec<Vec3>, radius: f32) -> Vec<Vec3> {
    let Some(first) = points.first().copied() else { return points };
    if points.iter().any(|p| *p != first) {
        return points;
    }
    let side = |i: usize, bit: usize| if i >> bit & 1 == 1 { radius } else { -radius };
    (0..8).map(|i| first + Vec3::new(side(i, 0), side(i, 1), side(i, 2))).collect()
}

/// Returns a panorama camera at a free position inside of `cloud`.
///
/// The middle of the picture looks north, rotated by `azimuth_deg` clockwise seen from above.
pub fn panorama_camera(cloud: &PointCloud, up: Vec3, azimuth_deg: f64) -> Camera {
    let position = cloud.origin + free_position(cloud, up).as_dvec3();
    Camera {
        position,
        focal_point: position + direction(azimuth_deg, 0.0, up),
        view_up: up.as_dvec3(),
        projection: Projection::Panorama,
    }
}

/// Returns the position that is farthest from all points, among a grid of positions in the middle half of the
/// cloud and not high up.
fn free_position(cloud: &PointCloud, up: Vec3) -> Vec3 {
    const MAX_POINTS: usize = 20_000;
    const N_ACROSS: usize = 12;
    const N_UP: usize = 4;
    let points = sample_inliers(cloud);
    let stride = points.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<Vec3> = points.iter().step_by(stride).copied().collect();
    let (east, north) = ground_axes(up);
    let within = |(low, high): (f32, f32), fraction: f32| low + fraction * (high - low);
    let [along_east, along_north, along_up] =
        [east, north, up].map(|axis| range_along(&points, axis));
    let middle = |i: usize| 0.25 + 0.5 * (i as f32 + 0.5) / N_ACROSS as f32;
    let candidates = (0..N_ACROSS * N_ACROSS * N_UP).map(|i| {
        let (x, y, z) = (i % N_ACROSS, i / N_ACROSS % N_ACROSS, i / (N_ACROSS * N_ACROSS));
        within(along_east, middle(x)) * east
            + within(along_north, middle(y)) * north
            + within(along_up, 0.1 * (z + 1) as f32) * up
    });
    let clearance = |position: Vec3| {
        points.iter().map(|p| p.distance_squared(position)).fold(f32::INFINITY, f32::min)
    };
    let freest = candidates.max_by(|a, b| clearance(*a).total_cmp(&clearance(*b)));
    freest.unwrap_or(Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    //! Automatic cameras fill the picture with the cloud and keep it inside, whatever its shape.

    use super::*;
    use crate::math::Random;
    use crate::scene::camera_fit::MARGIN;
    use crate::scene::{Geometry, Graph, Material, Mesh};

    #[test]
    fn a_single_point_is_seen_by_its_radius() {
        for (radii, radius) in
            [(None, LONE_RADIUS), (Some(vec![0.01]), 0.01), (Some(vec![50.0]), 50.0)]
        {
            let cloud = PointCloud { radii, ..PointCloud::from_positions(vec![Vec3::ONE]) };
            let camera = fit_camera(&cloud, &CameraFit::default());
            let distance = camera.position.distance(DVec3::ONE) as f32 / radius;
            assert!((2.0..12.0).contains(&distance), "{distance} of {radius}");
        }
    }

    #[test]
    fn a_mesh_of_few_vertices_is_no_outlier_of_the_ball_beside_it() {
        let mut random = Random::new(4, 0);
        let mut axis = || 2.0 * random.next_f32() - 1.0;
        let ball: Vec<Vec3> =
            (0..20_000).map(|_| Vec3::new(axis(), axis(), axis()).normalize()).collect();
        let indices: Vec<u32> = (0..19_998).collect();
        let triangles = indices.chunks(3).map(|it| [it[0], it[1], it[2]]).collect();
        let mesh = Mesh { positions: ball.clone(), triangles, ..Mesh::default() };
        let cloud = Geometry::Points(PointCloud::from_positions(ball));
        let corner = |i: i32| Vec3::new((i % 2) as f32 - 0.5, (i / 2) as f32 - 0.5, -0.1) * 10.0;
        let corners: Vec<Vec3> = (0..4).map(corner).collect();
        let triangles = vec![[0, 1, 2], [1, 3, 2]];
        let floor = Mesh { positions: corners.clone(), triangles, ..Mesh::default() };
        for ball in [cloud, Geometry::Triangles(mesh)] {
            let mut graph = Graph::from_geometry(ball, Material::default());
            let floor = Geometry::Triangles(floor.clone());
            graph.append(Graph::from_geometry(floor, Material::default()));
            let camera = fit_camera(&graph.sample_points(), &CameraFit::default());
            let view = camera.view(DVec3::ZERO, 1600, 900);
            for corner in &corners {
                let (x, y, _) = view.project(*corner).unwrap();
                assert!((0.0..1600.0).contains(&x) && (0.0..900.0).contains(&y), "{x} {y}");
            }
        }
    }

    #[test]
    fn a_second_cloud_of_few_points_is_no_outlier_of_the_first() {
        let mut random = Random::new(5, 0);
        let mut cube = |n: usize, size: f32, center: Vec3| -> Vec<Vec3> {
            let mut axis = || random.next_f32() - 0.5;
            (0..n).map(|_| size * Vec3::new(axis(), axis(), axis()) + center).collect()
        };
        let building = cube(30_000, 2.0, Vec3::ZERO);
        for (n_points, distance) in [(600, 3.5), (100, 40.0), (1, 5.0)] {
            let statue = cube(n_points, 1.0, distance * Vec3::X);
            let cloud = |points: &[Vec3]| {
                let geometry = Geometry::Points(PointCloud::from_positions(points.to_vec()));
                Graph::from_geometry(geometry, Material::default())
            };
            let mut graph = cloud(&building);
            graph.append(cloud(&statue));
            let camera = fit_camera(&graph.sample_points(), &CameraFit::default());
            let view = camera.view(DVec3::ZERO, 1600, 900);
            for point in statue.iter().chain(&building) {
                let (x, y, _) = view.project(*point).unwrap();
                assert!((0.0..1600.0).contains(&x) && (0.0..900.0).contains(&y), "{x} {y}");
            }
        }
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

    /// Bounds in pixels of the cloud in a 1600 x 900 picture: left, top, right and bottom.
    fn bounds_in_picture(cloud: &PointCloud, camera: &Camera) -> (f32, f32, f32, f32) {
        let view = camera.view(cloud.origin, 1600, 900);
        let pixels = cloud.positions.iter().filter_map(|&p| view.project(p));
        pixels.fold((f32::MAX, f32::MAX, f32::MIN, f32::MIN), |(a, b, c, d), (x, y, _)| {
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
    fn a_panorama_is_seen_from_a_free_position_with_north_in_the_middle() {
        let cloud = room();
        for (azimuth_deg, toward) in [(0.0, DVec3::Y), (90.0, DVec3::X), (-90.0, DVec3::NEG_X)] {
            let camera = panorama_camera(&cloud, Vec3::Z, azimuth_deg);
            let position = (camera.position - cloud.origin).as_vec3();
            let nearest = cloud.positions.iter().map(|p| p.distance(position)).fold(9.0, f32::min);
            assert!(0.6 < nearest && position.abs().max_element() < 2.0, "{position}");
            assert!((camera.focal_point - camera.position).distance(toward) < 1e-6);
        }
        // A cloud without free space still gives a position.
        let point = PointCloud::from_positions(vec![Vec3::ONE]);
        assert_eq!(panorama_camera(&point, Vec3::Z, 0.0).position, DVec3::ONE);
    }

    #[test]
    fn the_cloud_fills_the_picture_and_stays_inside() {
        for size in [Vec3::ONE, Vec3::new(400.0, 300.0, 15.0), Vec3::new(0.1, 0.1, 3.0)] {
            for is_orthographic in [false, true] {
                let cloud = box_of_points(size);
                let (left, top, right, bottom) = bounds_in_picture(
                    &cloud,
                    &fit_camera(&cloud, &CameraFit { is_orthographic, ..CameraFit::default() }),
                );
                assert!(
                    0.0 < left && 0.0 < top && right < 1600.0 && bottom < 900.0,
                    "{left} {top} {right} {bottom}"
                );
                assert!(0.85 < ((right - left) / 1600.0).max((bottom - top) / 900.0));
            }
        }
    }

    #[test]
    fn an_outlier_does_not_move_the_camera() {
        let cloud = box_of_points(Vec3::splat(10.0));
        let mut with_outlier = cloud.clone();
        with_outlier.positions[7] = Vec3::new(4000.0, 0.0, -9000.0);
        let (a, b) = (
            fit_camera(&cloud, &CameraFit::default()),
            fit_camera(&with_outlier, &CameraFit::default()),
        );
        assert!(a.position.distance(b.position) < 0.1, "{a:?} {b:?}");
    }

    #[test]
    fn a_map_has_north_at_its_top_and_fills_the_picture() {
        let cloud = box_of_points(Vec3::new(400.0, 200.0, 15.0));
        let fit =
            CameraFit { direction: Some(-DVec3::Z), is_orthographic: true, ..CameraFit::default() };
        let camera = fit_camera(&cloud, &fit);
        assert_eq!(camera.axes()[1].round(), DVec3::Y);
        let (left, _, right, _) = bounds_in_picture(&cloud, &camera);
        assert!(0.85 < (right - left) / 1600.0, "{left} {right}");
    }

    #[test]
    fn the_cloud_fills_the_picture_for_any_view_up() {
        let cloud = box_of_points(Vec3::new(600.0, 266.0, 67.0));
        let map =
            CameraFit { direction: Some(-DVec3::Z), is_orthographic: true, ..CameraFit::default() };
        let east_up = CameraFit { view_up: Some(DVec3::X), ..map };
        for (fit, expected) in [(map, 600.0 / (16.0 / 9.0)), (east_up, 600.0)] {
            let camera = fit_camera(&cloud, &fit);
            let Projection::Orthographic { height } = camera.projection else { panic!() };
            let expected = expected / (1.0 - 2.0 * MARGIN);
            assert!((height / expected - 1.0).abs() < 0.01, "{height} {expected}");
            let (left, top, right, bottom) = bounds_in_picture(&cloud, &camera);
            let filled = ((right - left) / 1600.0).max((bottom - top) / 900.0);
            assert!(0.9 < filled && 0.0 < left && 0.0 < top, "{left} {top} {right} {bottom}");
        }
    }

    #[test]
    fn the_camera_looks_at_terrain_across_its_long_side() {
        for size in [Vec3::new(300.0, 60.0, 5.0), Vec3::new(60.0, 300.0, 5.0)] {
            let cloud = box_of_points(size);
            let distance = |azimuth_deg: f64| {
                let camera = fit_camera(&cloud, &CameraFit { azimuth_deg, ..CameraFit::default() });
                camera.position.distance(camera.focal_point)
            };
            assert!(distance(0.0) < 0.95 * distance(90.0), "{size}");
        }
    }

    #[test]
    fn clouds_of_one_point_or_none_give_a_finite_camera() {
        for positions in [vec![], vec![Vec3::ONE], vec![Vec3::ONE; 5]] {
            let camera = fit_camera(&PointCloud::from_positions(positions), &CameraFit::default());
            assert!(camera.position.is_finite() && camera.focal_point != camera.position);
        }
    }
}
