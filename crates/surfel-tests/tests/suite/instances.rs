//! Instances: what nodes show is what copies would be that had been moved beforehand.

use std::f64::consts::FRAC_PI_3;
use surfel::flat::FlatScene;
use surfel::math::{DAffine3, DMat3, DQuat, DVec3, Ray, Vec3};
use surfel::points::PointCloud;
use surfel::progress::Silent;
use surfel::scene::{
    Background, Geometry, Graph, Lamp, LampKind, Light, Material, Mesh, Node, Points, Scene,
    Transform,
};
use surfel::surface::{Boundary, SurfaceKind};
use surfel::trace::{self, SceneHit, Simd, Which};
use surfel_tests::{clouds, scenes};

pub fn flat(graph: Graph) -> FlatScene {
    let (lights, background) = (vec![Light::Headlight(1.0)], Background::Transparent);
    let scene = Scene { graph, lights, background, camera: scenes::from_above(4.0) };
    FlatScene::new(&scene, &Silent).unwrap()
}

pub fn hits(scene: &FlatScene, which: Which, rays: &[Ray]) -> Vec<SceneHit> {
    let all = Simd::available().into_iter().map(|simd| {
        let mut hits = vec![SceneHit::MISS; rays.len()];
        trace::scene_hits(scene, simd, which, rays, &mut hits);
        hits
    });
    let all: Vec<_> = all.collect();
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    all.into_iter().next().unwrap()
}

pub fn occlusions(scene: &FlatScene, which: Which, rays: &[Ray]) -> Vec<bool> {
    let mut occluded = vec![false; rays.len()];
    trace::scene_occlusions(scene, Simd::detect(), which, rays, &mut occluded);
    occluded
}

pub fn at(translation: DVec3) -> DAffine3 {
    DAffine3::from_translation(translation)
}

/// Turned, scaled, stretched, mirrored, sheared, and far away.
fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    let stretch = DVec3::new(2.0, 1.0, 0.5);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(0.2, -0.4, 1.0));
    vec![
        ("in place", DAffine3::IDENTITY),
        ("turned", DAffine3::from_rotation_translation(turn, DVec3::X)),
        ("larger", DAffine3::from_scale(DVec3::splat(3.0))),
        ("smaller", DAffine3::from_scale(DVec3::splat(0.01))),
        ("stretched", DAffine3::from_scale_rotation_translation(stretch, turn, DVec3::Y)),
        ("mirrored", DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))),
        ("mirrored and stretched", DAffine3::from_scale(DVec3::new(1.5, -0.5, -2.0))),
        ("all mirrored", DAffine3::from_scale_rotation_translation(-stretch, turn, DVec3::Z)),
        ("sheared", DAffine3::from_mat3_translation(shear, DVec3::new(-1.0, 0.5, 0.0))),
        ("far away", DAffine3::from_rotation_translation(turn, DVec3::new(3e6, -4e6, 700.0))),
    ]
}

/// Whether angles stay as they are.
fn keeps_shapes(place: &DAffine3) -> bool {
    let scale = place.matrix3.determinant().abs().cbrt();
    let unit = place.matrix3 * (1.0 / scale);
    (unit.transpose() * unit).abs_diff_eq(DMat3::IDENTITY, 1e-9)
}

/// Rays about an object of size 1 that `transform` places in a scene about `origin`.
fn rays_about(transform: DAffine3, origin: DVec3, n: usize) -> Vec<Ray> {
    let moved = |ray: &Ray| {
        let start = transform.transform_point3(ray.origin.as_dvec3()) - origin;
        let direction = transform.transform_vector3(ray.direction.as_dvec3()).normalize();
        Ray::new(start.as_vec3(), direction.as_vec3())
    };
    scenes::random_rays(n, 1.2, 71).iter().map(moved).collect()
}

fn smooth_and_flat() -> [Mesh; 2] {
    let turn = DAffine3::from_rotation_z(0.3);
    [scenes::uv_sphere(16, 32, 1.0), scenes::baked(&scenes::cuboid(-Vec3::ONE, Vec3::ONE), turn)]
}

#[test]
fn an_instance_of_a_mesh_is_hit_as_its_moved_copy_is() {
    for mesh in smooth_and_flat() {
        for (name, place) in transforms() {
            let geometry = Geometry::Triangles(mesh.clone());
            let mut graph = Graph::of(geometry, Material::MATTE);
            graph.nodes = vec![scenes::node(0, 0, place)];
            let copy = Geometry::Triangles(scenes::baked(&mesh, place));
            let (instance, copy) = (flat(graph), flat(Graph::of(copy, Material::MATTE)));
            assert_eq!(instance.origin, copy.origin);
            let rays = rays_about(place, copy.origin, 2000);
            let n_hits = compare(name, &instance, &copy, &rays, keeps_shapes(&place));
            assert!(500 < n_hits, "{name}: {n_hits}");
        }
    }
}

/// Panics unless both are hit alike; returns how often they are.
fn compare(
    name: &str,
    instance: &FlatScene,
    copy: &FlatScene,
    rays: &[Ray],
    keeps_shape: bool,
) -> usize {
    let (instance, copy) = (hits(instance, Which::All, rays), hits(copy, Which::All, rays));
    let (mut n_hits, mut n_rim) = (0, 0);
    for (i, (found, expected)) in instance.iter().zip(&copy).enumerate() {
        let context = || format!("{name}, {:?}: {found:?} {expected:?}", rays[i]);
        if found.is_miss() || expected.is_miss() || found.id != expected.id {
            // A ray through an edge or past a rim may go either way.
            n_rim += usize::from(found.id != expected.id);
            continue;
        }
        n_hits += 1;
        let bounds = rays[i].origin.length() + expected.distance;
        // Roundings of the coordinates, more where a ray meets a triangle edge on.
        let cos = expected.facet.dot(rays[i].direction).abs();
        let rounding = 16.0 * f32::EPSILON * bounds / cos;
        assert!((found.distance - expected.distance).abs() < rounding, "{}", context());
        assert!(found.facet.distance(expected.facet) < 1e-5, "{}", context());
        // Between corners the normal is interpolated by shares, which are off by roundings; and a
        // normal interpolated after a stretch is not quite the stretched interpolated one.
        let bend = if keeps_shape { 1e-3 } else { 0.05 };
        assert!(found.normal.distance(expected.normal) < bend, "{}", context());
        assert_eq!(found.is_inner, expected.is_inner, "{}", context());
    }
    assert!(n_rim <= 2, "{name}: {n_rim} rays differ");
    n_hits
}

/// A triangle that is seen from above.
fn triangle() -> Mesh {
    let positions = vec![Vec3::new(-1.0, -0.7, 0.1), Vec3::new(1.0, -0.6, -0.2), Vec3::Y];
    Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() }
}

#[test]
fn of_equal_surfaces_the_first_is_seen_at_any_scale() {
    // As near as the other, but in a box that rays enter earlier.
    let mut taller = triangle();
    taller.positions.extend([0.0, 0.1, 0.2].map(|x| Vec3::new(9.0 + x, x * x, 3.0)));
    taller.triangles.push([3, 4, 5]);
    for scale in [1.0, 2.5, 0.3, 3.0, 10.0, 0.01, 1.7] {
        let place = DAffine3::from_scale(DVec3::splat(scale));
        let meshes = [triangle(), taller.clone()].map(Geometry::Triangles);
        let mut graph = scenes::graph(meshes.map(|mesh| (mesh, Material::MATTE)).into());
        graph.nodes = vec![scenes::node(0, 0, place), scenes::node(1, 1, place)];
        let scene = flat(graph);
        let rays = rays_about(place, scene.origin, 4000);
        let found = hits(&scene, Which::All, &rays);
        let found = found.iter().filter(|hit| !hit.is_miss() && hit.id == 0);
        let first: Vec<bool> = found.map(|hit| hit.instance == 0).collect();
        assert!(200 < first.len());
        assert!(first.iter().all(|is_first| *is_first), "at {scale}");
    }
}

#[test]
fn rays_along_a_side_of_an_instance_meet_its_edges() {
    let cube = || Geometry::Triangles(scenes::cuboid(-Vec3::ONE, Vec3::ONE));
    let alone = flat(Graph::of(cube(), Material::MATTE));
    let mut graph = Graph::of(cube(), Material::MATTE);
    graph.nodes.push(scenes::node(0, 0, at(DVec3::splat(50.0))));
    let beside_another = flat(graph);
    assert_eq!(alone.origin, beside_another.origin);
    let along = |x: f32, z: f32| Ray::new(Vec3::new(x, -5.0, z), Vec3::Y);
    let rays = [along(1.0, 0.3), along(-1.0, 0.3), along(0.3, 1.0), along(0.3, -1.0)];
    let expected = hits(&alone, Which::All, &rays);
    assert!(expected.iter().all(|hit| hit.distance == 4.0));
    assert_eq!(hits(&beside_another, Which::All, &rays), expected);
}

fn prepared(kind: SurfaceKind) -> Points {
    Points { has_outward_normals: true, ..scenes::points(clouds::sphere(2000, 1.0), kind) }
}

/// Points where a transform that keeps shapes takes them.
fn moved_points(points: &Points, place: DAffine3) -> Points {
    let scale = place.matrix3.determinant().abs().cbrt();
    let mut moved = points.clone();
    let cloud = &mut moved.cloud;
    cloud.origin = place.transform_point3(cloud.origin);
    for position in &mut cloud.positions {
        *position = place.transform_vector3(position.as_dvec3()).as_vec3();
    }
    for normal in cloud.normals.iter_mut().flatten() {
        *normal = place.transform_vector3(normal.as_dvec3()).normalize().as_vec3();
    }
    cloud.radii.iter_mut().flatten().for_each(|radius| *radius *= scale as f32);
    moved
}

#[test]
fn an_instance_of_a_cloud_is_hit_as_its_moved_copy_is() {
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::Splat] {
        let points = prepared(kind);
        let radius = points.cloud.radii.as_ref().unwrap()[0];
        for (name, place) in transforms().into_iter().filter(|(_, place)| keeps_shapes(place)) {
            let scale = place.matrix3.determinant().abs().cbrt() as f32;
            let mut graph = Graph::of(Geometry::Points(points.clone()), Material::MATTE);
            graph.nodes = vec![scenes::node(0, 0, place)];
            let copy = Geometry::Points(moved_points(&points, place));
            let (instance, copy) = (flat(graph), flat(Graph::of(copy, Material::MATTE)));
            let rays = rays_about(place, copy.origin, 2000);
            let (found, expected) =
                (hits(&instance, Which::All, &rays), hits(&copy, Which::All, &rays));
            let (mut n_hits, mut n_far, mut n_rim) = (0, 0, 0);
            for (found, expected) in found.iter().zip(&expected) {
                if found.is_miss() || expected.is_miss() {
                    n_rim += u32::from(found.is_miss() != expected.is_miss());
                    continue;
                }
                n_hits += 1;
                let radii = found.radius / expected.radius;
                assert!(found.id != expected.id || (radii - 1.0).abs() < 5e-3, "{name}: {radii}");
                n_rim += u32::from(found.is_inner != expected.is_inner);
                // Stored positions are off by 1/1000 of the radius, normals by 0.08 degrees; where the
                // rim of a disc decides, the next one is hit.
                let is_near = (found.distance - expected.distance).abs() < 0.02 * scale * radius;
                n_far += u32::from(!is_near || 0.02 < found.normal.distance(expected.normal));
            }
            assert!(500 < n_hits, "{name}: {n_hits}");
            assert!(
                n_rim <= 10 && n_far <= n_hits / 20,
                "{kind:?} {name}: {n_rim} {n_far} of {n_hits}"
            );
        }
    }
}

/// One point of radius 1 at the origin.
fn one_point(kind: SurfaceKind, normal: Vec3) -> Points {
    let cloud = PointCloud {
        normals: Some(vec![normal]),
        radii: Some(vec![1.0]),
        ..PointCloud::from_positions(vec![Vec3::ZERO])
    };
    let boundary = Boundary::Off;
    Points { cloud, colors: vec![[188; 3]], surface: kind, boundary, has_outward_normals: true }
}

#[test]
fn a_stretched_disc_is_an_ellipse_and_a_stretched_ball_an_ellipsoid() {
    let stretch = DVec3::new(2.0, 1.0, 0.5);
    let turn = DQuat::from_rotation_x(0.4);
    let place = DAffine3::from_scale_rotation_translation(stretch, turn, DVec3::new(0.3, 0.2, 5.0));
    for (kind, normal) in [
        (SurfaceKind::Disc, Vec3::Z),
        (SurfaceKind::Disc, Vec3::new(0.6, 0.0, 0.8)),
        (SurfaceKind::Sphere, Vec3::Z),
    ] {
        let mut graph = Graph::of(Geometry::Points(one_point(kind, normal)), Material::MATTE);
        graph.nodes = vec![scenes::node(0, 0, place)];
        let scene = flat(graph);
        let rays: Vec<Ray> = scenes::random_rays(6000, 2.5, 72)
            .into_iter()
            .map(|ray| Ray { t_min: 0.0, t_max: f32::INFINITY, ..ray })
            .collect();
        let mut n_hits = 0;
        for (ray, hit) in rays.iter().zip(hits(&scene, Which::All, &rays)) {
            // In the axes of the ellipse, in double precision.
            let (origin, direction) = (
                turn.inverse() * ray.origin.as_dvec3() / stretch,
                turn.inverse() * ray.direction.as_dvec3() / stretch,
            );
            let (answer, margin) = match kind {
                SurfaceKind::Disc => disc_answer(origin, direction, normal.as_dvec3()),
                _ => ball_answer(origin, direction),
            };
            // Radii are stored to 0.2 percent, normals to 0.08 degrees.
            if margin < 0.01 {
                continue;
            }
            assert_eq!(hit.is_miss(), answer.is_none(), "{kind:?} {ray:?} {margin}");
            let Some((distance, normal)) = answer else { continue };
            n_hits += 1;
            let normal = (turn * (normal / stretch)).normalize();
            let cos = normal.dot(ray.direction.as_dvec3());
            let normal = if 0.0 < cos { -normal } else { normal };
            // Twice what the stored normal and radius are off by, more where it is met edge on.
            let off = (f64::from(hit.distance) - distance).abs();
            assert!(off < 0.02 / cos.abs(), "{kind:?} {ray:?}: off by {off}");
            let bend = hit.normal.as_dvec3().distance(normal);
            assert!(bend < 0.02, "{kind:?} {ray:?}: {} for {normal}", hit.normal);
        }
        assert!(300 < n_hits, "{kind:?}: {n_hits}");
    }
}

/// Distance and normal at which the unit disc about the origin is hit, and how far from its rim.
fn disc_answer(origin: DVec3, direction: DVec3, normal: DVec3) -> (Option<(f64, DVec3)>, f64) {
    let distance = -normal.dot(origin) / normal.dot(direction);
    let from_center = (origin + distance * direction).length();
    let is_hit = 0.0 < distance && from_center < 1.0;
    (is_hit.then_some((distance, normal)), (from_center - 1.0).abs().min(distance.abs()))
}

/// The same of the unit ball.
fn ball_answer(origin: DVec3, direction: DVec3) -> (Option<(f64, DVec3)>, f64) {
    let (a, b) = (direction.length_squared(), origin.dot(direction));
    let nearest_squared = origin.length_squared() - b * b / a;
    let margin = (nearest_squared.sqrt() - 1.0).abs().min((origin.length() - 1.0).abs());
    if 1.0 < nearest_squared {
        return (None, margin);
    }
    let half = ((1.0 - nearest_squared) / a).sqrt();
    let distances = [-b / a - half, -b / a + half];
    let distance = distances.into_iter().find(|distance| 0.0 < *distance);
    (distance.map(|distance| (distance, origin + distance * direction)), margin)
}

#[test]
fn nodes_stand_in_their_parents_and_vanish_with_them() {
    let ball = Geometry::Triangles(scenes::uv_sphere(16, 32, 0.5));
    let mut graph = Graph::of(ball, Material::MATTE);
    let turn = DAffine3::from_rotation_z(FRAC_PI_3);
    let place = turn * DAffine3::from_scale(DVec3::splat(2.0));
    graph.nodes.push(Node { transform: Transform::Matrix(place), ..Node::new("arm") });
    graph.nodes.push(Node { parent: Some(1), ..scenes::node(0, 0, at(3.0 * DVec3::X)) });
    graph.nodes.push(Node { parent: Some(2), ..scenes::node(0, 0, at(2.0 * DVec3::X)) });
    graph.nodes[3].lamp =
        Some(Lamp { kind: LampKind::Point, color: Vec3::ONE, range: f32::INFINITY, radius: 0.0 });
    let scene = flat(graph.clone());
    let along = turn.transform_vector3(DVec3::X).as_vec3();
    // At 0 with radius 0.5; at 6 and 10 with radius 1.
    let rays = [20.0, 8.0, 3.0, 1.0].map(|distance| Ray::new(distance * along, -along));
    let distances = |scene: &FlatScene| -> Vec<f32> {
        hits(scene, Which::All, &rays).iter().map(|hit| hit.distance).collect()
    };
    assert_near(&distances(&scene), &[9.0, 1.0, 2.5, 0.5]);
    assert!(scene.lamps[0].position.distance(10.0 * along) < 1e-5);
    graph.nodes[2].is_visible = false;
    let scene = flat(graph.clone());
    assert_near(&distances(&scene), &[19.5, 7.5, 2.5, 0.5]);
    assert_eq!((scene.instances.len(), scene.lamps.len()), (1, 0));
    graph.nodes[0].is_visible = false;
    let scene = flat(graph);
    assert!(hits(&scene, Which::All, &rays).iter().all(SceneHit::is_miss));
    assert!(!occlusions(&scene, Which::All, &rays).contains(&true));
}

/// Up to what a ball of facets lacks of a ball.
fn assert_near(found: &[f32], expected: &[f32]) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 0.03, "{found:?} {expected:?}");
    }
}
