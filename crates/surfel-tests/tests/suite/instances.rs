//! Instances: a transformed instance is hit like a copy whose vertices or points were transformed beforehand.

use std::f64::consts::FRAC_PI_3;
use surfel_core::flat::FlatScene;
use surfel_core::math::{DAffine3, DMat3, DQuat, DVec3, Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::{
    Background, CloudGeometry, Geometry, Graph, Light, Material, Mesh, Node, PunctualLight,
    PunctualLightKind, Scene, Transform,
};
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_core::trace::{self, InstanceFilter, SceneHit, Simd};
use surfel_tests::clouds;
use surfel_tests::scenes;

pub fn flat(graph: Graph) -> FlatScene {
    let (lights, background) = (vec![Light::Headlight(1.0)], Background::Transparent);
    let scene = Scene { graph, lights, background, camera: scenes::from_above(4.0) };
    FlatScene::new(&scene, &NoProgress).unwrap()
}

pub fn hits(scene: &FlatScene, which: InstanceFilter, rays: &[Ray]) -> Vec<SceneHit> {
    let all = Simd::available().into_iter().map(|simd| {
        let mut hits = vec![SceneHit::MISS; rays.len()];
        trace::scene_hits(scene, simd, which, rays, &mut hits);
        hits
    });
    let all: Vec<_> = all.collect();
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    all.into_iter().next().unwrap()
}

pub fn occlusions(scene: &FlatScene, which: InstanceFilter, rays: &[Ray]) -> Vec<bool> {
    let mut occluded = vec![false; rays.len()];
    trace::scene_occlusions(scene, Simd::detect(), which, rays, &mut occluded);
    occluded
}

pub fn at(translation: DVec3) -> DAffine3 {
    DAffine3::from_translation(translation)
}

/// Returns transforms of all kinds, each with a name.
fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    let stretch = DVec3::new(2.0, 1.0, 0.5);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(0.2, -0.4, 1.0));
    vec![
        ("identity", DAffine3::IDENTITY),
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

/// Returns whether a transform preserves angles.
fn keeps_shapes(matrix: &DAffine3) -> bool {
    let scale = matrix.matrix3.determinant().abs().cbrt();
    let unit = matrix.matrix3 * (1.0 / scale);
    (unit.transpose() * unit).abs_diff_eq(DMat3::IDENTITY, 1e-9)
}

/// Returns rays about an object of size 1 that `transform` moves, relative to the scene's origin.
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
fn an_instance_of_a_mesh_is_hit_like_its_transformed_copy() {
    for mesh in smooth_and_flat() {
        for (name, matrix) in transforms() {
            let geometry = Geometry::Triangles(mesh.clone());
            let mut graph = Graph::from_geometry(geometry, Material::MATTE);
            graph.nodes = vec![scenes::node(0, 0, matrix)];
            let copy = Geometry::Triangles(scenes::baked(&mesh, matrix));
            let (instance, copy) = (flat(graph), flat(Graph::from_geometry(copy, Material::MATTE)));
            assert_eq!(instance.origin, copy.origin);
            let rays = rays_about(matrix, copy.origin, 2000);
            let n_hits = compare(name, &instance, &copy, &rays, keeps_shapes(&matrix));
            assert!(500 < n_hits, "{name}: {n_hits}");
        }
    }
}

/// Panics unless an instance and a copy have the same hits; returns the number of hits.
fn compare(
    name: &str,
    instance: &FlatScene,
    copy: &FlatScene,
    rays: &[Ray],
    keeps_shape: bool,
) -> usize {
    let (instance, copy) =
        (hits(instance, InstanceFilter::All, rays), hits(copy, InstanceFilter::All, rays));
    let (mut n_hits, mut n_rim) = (0, 0);
    for (i, (found, expected)) in instance.iter().zip(&copy).enumerate() {
        let context = || format!("{name}, {:?}: {found:?} {expected:?}", rays[i]);
        if found.is_miss() || expected.is_miss() || found.id != expected.id {
            // A ray through an edge or past a rim may hit either triangle.
            n_rim += usize::from(found.id != expected.id);
            continue;
        }
        n_hits += 1;
        let bounds = rays[i].origin.length() + expected.distance;
        // The coordinates are rounded, which shifts the hits of grazing rays more.
        let cos = expected.geometric_normal.dot(rays[i].direction).abs();
        let rounding = 16.0 * f32::EPSILON * bounds / cos;
        assert!((found.distance - expected.distance).abs() < rounding, "{}", context());
        assert!(found.geometric_normal.distance(expected.geometric_normal) < 1e-5, "{}", context());
        // Barycentric weights are rounded, too; and interpolating stretched normals is not quite the same as
        // stretching interpolated ones.
        let bend = if keeps_shape { 1e-3 } else { 0.05 };
        assert!(found.normal.distance(expected.normal) < bend, "{}", context());
        assert_eq!(found.is_backface, expected.is_backface, "{}", context());
    }
    assert!(n_rim <= 2, "{name}: {n_rim} rays differ");
    n_hits
}

/// Returns a triangle whose front faces up.
fn triangle() -> Mesh {
    let positions = vec![Vec3::new(-1.0, -0.7, 0.1), Vec3::new(1.0, -0.6, -0.2), Vec3::Y];
    Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() }
}

#[test]
fn the_first_of_equal_surfaces_is_hit_at_any_scale() {
    // This mesh is as near as the other, but rays enter its box earlier.
    let mut taller = triangle();
    taller.positions.extend([0.0, 0.1, 0.2].map(|x| Vec3::new(9.0 + x, x * x, 3.0)));
    taller.triangles.push([3, 4, 5]);
    for scale in [1.0, 2.5, 0.3, 3.0, 10.0, 0.01, 1.7] {
        let matrix = DAffine3::from_scale(DVec3::splat(scale));
        let meshes = [triangle(), taller.clone()].map(Geometry::Triangles);
        let mut graph = scenes::graph(meshes.map(|mesh| (mesh, Material::MATTE)).into());
        graph.nodes = vec![scenes::node(0, 0, matrix), scenes::node(1, 1, matrix)];
        let scene = flat(graph);
        let rays = rays_about(matrix, scene.origin, 4000);
        let found = hits(&scene, InstanceFilter::All, &rays);
        let found = found.iter().filter(|hit| !hit.is_miss() && hit.id == 0);
        let first: Vec<bool> = found.map(|hit| hit.instance == 0).collect();
        assert!(200 < first.len());
        assert!(first.iter().all(|is_first| *is_first), "at {scale}");
    }
}

#[test]
fn rays_along_a_side_of_an_instance_hit_its_edges() {
    let cube = || Geometry::Triangles(scenes::cuboid(-Vec3::ONE, Vec3::ONE));
    let single = flat(Graph::from_geometry(cube(), Material::MATTE));
    let mut graph = Graph::from_geometry(cube(), Material::MATTE);
    graph.nodes.push(scenes::node(0, 0, at(DVec3::splat(50.0))));
    let with_another = flat(graph);
    assert_eq!(single.origin, with_another.origin);
    let along = |x: f32, z: f32| Ray::new(Vec3::new(x, -5.0, z), Vec3::Y);
    let rays = [along(1.0, 0.3), along(-1.0, 0.3), along(0.3, 1.0), along(0.3, -1.0)];
    let expected = hits(&single, InstanceFilter::All, &rays);
    assert!(expected.iter().all(|hit| hit.distance == 4.0));
    assert_eq!(hits(&with_another, InstanceFilter::All, &rays), expected);
}

fn prepared(kind: SurfaceKind) -> CloudGeometry {
    scenes::outward(&scenes::points(clouds::sphere(2000, 1.0), kind))
}

/// Returns points moved by a transform that preserves angles.
fn moved_points(points: &CloudGeometry, matrix: DAffine3) -> CloudGeometry {
    let scale = matrix.matrix3.determinant().abs().cbrt();
    scenes::changed(points, |cloud| {
        cloud.origin = matrix.transform_point3(cloud.origin);
        for position in &mut cloud.positions {
            *position = matrix.transform_vector3(position.as_dvec3()).as_vec3();
        }
        for normal in cloud.normals.iter_mut().flatten() {
            *normal = matrix.transform_vector3(normal.as_dvec3()).normalize().as_vec3();
        }
        cloud.radii.iter_mut().flatten().for_each(|radius| *radius *= scale as f32);
    })
}

#[test]
fn an_instance_of_a_cloud_is_hit_like_its_transformed_copy() {
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::Splat] {
        let points = prepared(kind);
        let radius = points.cloud().radii()[0];
        for (name, matrix) in transforms().into_iter().filter(|(_, matrix)| keeps_shapes(matrix)) {
            let scale = matrix.matrix3.determinant().abs().cbrt() as f32;
            let mut graph = Graph::from_geometry(Geometry::Points(points.clone()), Material::MATTE);
            graph.nodes = vec![scenes::node(0, 0, matrix)];
            let copy = Geometry::Points(moved_points(&points, matrix));
            let (instance, copy) = (flat(graph), flat(Graph::from_geometry(copy, Material::MATTE)));
            let rays = rays_about(matrix, copy.origin, 2000);
            let (found, expected) = (
                hits(&instance, InstanceFilter::All, &rays),
                hits(&copy, InstanceFilter::All, &rays),
            );
            let (mut n_hits, mut n_far, mut n_rim) = (0, 0, 0);
            for (found, expected) in found.iter().zip(&expected) {
                if found.is_miss() || expected.is_miss() {
                    n_rim += u32::from(found.is_miss() != expected.is_miss());
                    continue;
                }
                n_hits += 1;
                let radii = found.radius / expected.radius;
                assert!(found.id != expected.id || (radii - 1.0).abs() < 5e-3, "{name}: {radii}");
                n_rim += u32::from(found.is_backface != expected.is_backface);
                // Stored positions are off by 1/1000 of the radius, normals by 0.08 degrees; a ray near the rim
                // of a disc may hit the next one.
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

/// Returns one point of radius 1 at the origin.
fn one_point(kind: SurfaceKind, normal: Vec3) -> CloudGeometry {
    let cloud = PointCloud {
        normals: Some(vec![normal]),
        radii: Some(vec![1.0]),
        ..PointCloud::from_positions(vec![Vec3::ZERO])
    };
    let mut point = scenes::outward(&scenes::grey(cloud));
    point.surface = kind;
    point.edge_test = EdgeTest::Off;
    point
}

#[test]
fn a_stretched_disc_is_an_ellipse_and_a_stretched_ball_an_ellipsoid() {
    let stretch = DVec3::new(2.0, 1.0, 0.5);
    let turn = DQuat::from_rotation_x(0.4);
    let matrix =
        DAffine3::from_scale_rotation_translation(stretch, turn, DVec3::new(0.3, 0.2, 5.0));
    for (kind, normal) in [
        (SurfaceKind::Disc, Vec3::Z),
        (SurfaceKind::Disc, Vec3::new(0.6, 0.0, 0.8)),
        (SurfaceKind::Sphere, Vec3::Z),
    ] {
        let mut graph =
            Graph::from_geometry(Geometry::Points(one_point(kind, normal)), Material::MATTE);
        graph.nodes = vec![scenes::node(0, 0, matrix)];
        let scene = flat(graph);
        let rays: Vec<Ray> = scenes::random_rays(6000, 2.5, 72)
            .into_iter()
            .map(|ray| Ray { t_min: 0.0, t_max: f32::INFINITY, ..ray })
            .collect();
        let mut n_hits = 0;
        for (ray, hit) in rays.iter().zip(hits(&scene, InstanceFilter::All, &rays)) {
            // The ray in the axes of the ellipsoid, in double precision.
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
            // The limit is twice the error of the stored normal and radius, larger for grazing rays.
            let off = (f64::from(hit.distance) - distance).abs();
            assert!(off < 0.02 / cos.abs(), "{kind:?} {ray:?}: off by {off}");
            let bend = hit.normal.as_dvec3().distance(normal);
            assert!(bend < 0.02, "{kind:?} {ray:?}: {} for {normal}", hit.normal);
        }
        assert!(300 < n_hits, "{kind:?}: {n_hits}");
    }
}

/// Returns the distance and normal of a hit of the unit disc about the origin, and the distance to its rim.
fn disc_answer(origin: DVec3, direction: DVec3, normal: DVec3) -> (Option<(f64, DVec3)>, f64) {
    let distance = -normal.dot(origin) / normal.dot(direction);
    let from_center = (origin + distance * direction).length();
    let is_hit = 0.0 < distance && from_center < 1.0;
    (is_hit.then_some((distance, normal)), (from_center - 1.0).abs().min(distance.abs()))
}

/// Returns the distance and normal of a hit of the unit ball about the origin, and the distance to its silhouette.
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
fn nodes_inherit_transforms_and_visibility() {
    let ball = Geometry::Triangles(scenes::uv_sphere(16, 32, 0.5));
    let mut graph = Graph::from_geometry(ball, Material::MATTE);
    let turn = DAffine3::from_rotation_z(FRAC_PI_3);
    let matrix = turn * DAffine3::from_scale(DVec3::splat(2.0));
    graph.nodes.push(Node { transform: Transform::Matrix(matrix), ..Node::new("arm") });
    graph.nodes.push(Node { parent: Some(1), ..scenes::node(0, 0, at(3.0 * DVec3::X)) });
    graph.nodes.push(Node { parent: Some(2), ..scenes::node(0, 0, at(2.0 * DVec3::X)) });
    graph.nodes[3].light = Some(PunctualLight {
        kind: PunctualLightKind::Point,
        color: Vec3::ONE,
        range: f32::INFINITY,
        radius: 0.0,
    });
    let scene = flat(graph.clone());
    let along = turn.transform_vector3(DVec3::X).as_vec3();
    // The balls are at 0 with radius 0.5, and at 6 and 10 with radius 1.
    let rays = [20.0, 8.0, 3.0, 1.0].map(|distance| Ray::new(distance * along, -along));
    let distances = |scene: &FlatScene| -> Vec<f32> {
        hits(scene, InstanceFilter::All, &rays).iter().map(|hit| hit.distance).collect()
    };
    assert_near(&distances(&scene), &[9.0, 1.0, 2.5, 0.5]);
    assert!(scene.punctual_lights[0].position.distance(10.0 * along) < 1e-5);
    graph.nodes[2].is_visible = false;
    let scene = flat(graph.clone());
    assert_near(&distances(&scene), &[19.5, 7.5, 2.5, 0.5]);
    assert_eq!((scene.instances.len(), scene.punctual_lights.len()), (1, 0));
    graph.nodes[0].is_visible = false;
    let scene = flat(graph);
    assert!(hits(&scene, InstanceFilter::All, &rays).iter().all(SceneHit::is_miss));
    assert!(!occlusions(&scene, InstanceFilter::All, &rays).contains(&true));
}

/// Panics unless distances are equal up to the difference between a ball and its facets.
fn assert_near(found: &[f32], expected: &[f32]) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 0.03, "{found:?} {expected:?}");
    }
}
