//! Many instances, overlapping or ten thousand: searches find the same hits as brute force over the instances.

use surfel_core::flat::{FlatGeometry, FlatScene, Instance};
use surfel_core::math::{DAffine3, DQuat, DVec3, Random, Ray, Vec3};
use surfel_core::scene::{AlphaMode, Geometry, Graph, Material, Mesh, Node, Transform};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{self, Hit, InstanceFilter, SceneHit, Simd, SurfaceHit};
use surfel_tests::clouds;
use surfel_tests::scenes;

use crate::instances::{at, flat, hits, occlusions};

/// Returns the nearest of the hits of each instance on its own; the first instance wins a tie.
fn brute_force_hits(
    scene: &FlatScene,
    which: impl Fn(&Instance) -> bool,
    rays: &[Ray],
) -> Vec<InstanceHit> {
    let mut nearest = vec![InstanceHit::MISS; rays.len()];
    for (i, instance) in scene.instances.iter().enumerate().filter(|(_, i)| which(i)) {
        let inside: Vec<(Ray, f32)> = rays.iter().map(|ray| instance.object_ray(ray)).collect();
        let (object_rays, scales): (Vec<Ray>, Vec<f32>) = inside.into_iter().unzip();
        let found: Vec<(f32, Vec3)> = match scene.geometry(instance) {
            FlatGeometry::Cloud(cloud) => {
                let mut hits = vec![SurfaceHit::MISS; rays.len()];
                trace::surface_hits(cloud, Simd::detect(), &object_rays, &mut hits);
                hits.iter().map(|hit| (hit.distance, hit.normal)).collect()
            }
            FlatGeometry::Mesh(mesh) => {
                let mut hits = vec![Hit::MISS; rays.len()];
                trace::closest_triangles(&mesh.triangles, Simd::detect(), &object_rays, &mut hits);
                hits.iter().map(|hit| (hit.distance, Vec3::ZERO)).collect()
            }
        };
        for ((nearest, (distance, normal)), scale) in nearest.iter_mut().zip(found).zip(scales) {
            if distance / scale < nearest.distance {
                let normal =
                    if normal == Vec3::ZERO { normal } else { instance.world_normal(normal) };
                *nearest = InstanceHit { distance: distance / scale, instance: i as u32, normal };
            }
        }
    }
    nearest
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct InstanceHit {
    distance: f32,
    instance: u32,
    /// The normal of a hit of points; zero for hits of meshes.
    normal: Vec3,
}

impl InstanceHit {
    const MISS: Self = Self { distance: f32::INFINITY, instance: u32::MAX, normal: Vec3::ZERO };

    fn of(scene: &FlatScene, hit: &SceneHit) -> Self {
        let is_point = !hit.is_miss()
            && matches!(
                scene.geometry(&scene.instances[hit.instance as usize]),
                FlatGeometry::Cloud(_)
            );
        let normal = if is_point { hit.normal } else { Vec3::ZERO };
        Self { distance: hit.distance, instance: hit.instance, normal }
    }
}

/// Panics unless searches find the same bits as brute force over the instances; returns the number of hits.
fn check_against_brute_force(name: &str, scene: &FlatScene, rays: &[Ray]) -> usize {
    let expected = brute_force_hits(scene, |_| true, rays);
    let found = hits(scene, InstanceFilter::All, rays);
    let occluded = occlusions(scene, InstanceFilter::All, rays);
    let one_by_one = rays.iter().flat_map(|ray| hits(scene, InstanceFilter::All, &[*ray]));
    assert!(found.iter().copied().eq(one_by_one), "{name}");
    let mut n_differing = 0;
    for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!(InstanceHit::of(scene, found), *expected, "{name} {:?}", rays[i]);
        n_differing += usize::from(occluded[i] != (expected.instance != u32::MAX));
    }
    // Hits test an edge by the blended normal, occlusions by that of one disc: 3 rays in a thousand may differ. On smooth
    // surfaces a ray skips discs close behind a rejected one, which an occlusion test may judge: 5 in a thousand of a cloud.
    let allowed_of = |instance: &Instance| match scene.geometry(instance) {
        FlatGeometry::Cloud(cloud) if cloud.surface == SurfaceKind::Smooth => 5,
        _ => 0,
    };
    let blends_discs = scene.clouds().any(|cloud| cloud.surface.blends_discs());
    let of_smooth: usize = scene.instances.iter().map(allowed_of).sum();
    let allowed = (of_smooth + if blends_discs { 3 } else { 0 }) * rays.len() / 1000;
    assert!(n_differing <= allowed, "{name}: {n_differing}");
    expected.iter().filter(|hit| hit.instance != u32::MAX).count()
}

#[test]
fn ten_thousand_instances_share_one_geometry_and_are_all_hit() {
    let points = scenes::points(clouds::sphere(200, 0.3), SurfaceKind::Disc);
    let bytes_of_one = scenes::flat(clouds::sphere(200, 0.3), SurfaceKind::Disc).points.bytes();
    let mut graph = Graph::from_geometry(Geometry::Points(points), Material::MATTE);
    let mut random = Random::new(73, 0);
    let mut along = || 40.0 * random.next_f64() - 20.0;
    graph.nodes = (0..10_000)
        .map(|i| {
            let turn = DQuat::from_rotation_y(f64::from(i));
            let position = DVec3::new(along(), along(), along());
            let scale = DVec3::splat(0.5 + 0.1 * f64::from(i % 10));
            let matrix = DAffine3::from_scale_rotation_translation(scale, turn, position);
            scenes::node(0, 0, matrix)
        })
        .collect();
    let scene = flat(graph);
    assert_eq!((scene.geometries.len(), scene.instances.len()), (1, 10_000));
    assert_eq!(
        scene.clouds().map(|cloud| cloud.points.bytes()).collect::<Vec<_>>(),
        [bytes_of_one]
    );
    let n_hits =
        check_against_brute_force("ten thousand", &scene, &scenes::random_rays(64, 20.0, 74));
    assert!((20..60).contains(&n_hits), "{n_hits}");
}

/// Returns the memory that a scene takes for its instances, without their geometries.
fn bytes_of_instances(scene: &FlatScene) -> usize {
    let FlatScene { instances, tlas, .. } = scene;
    instances.capacity() * size_of::<Instance>()
        + size_of_val(tlas.nodes.as_slice())
        + size_of_val(tlas.blocks.as_slice())
}

#[test]
fn an_instance_of_a_million_points_takes_a_few_hundred_bytes() {
    /// An instance takes 208 bytes, in a list that grows by doubling, and 5 bytes of the tree over all.
    const MAX_BYTES: usize = 400;
    const N_INSTANCES: usize = 10_000;
    let mut points = scenes::grey(clouds::waves(1_000_000, 0.0));
    points.surface = SurfaceKind::Disc;
    let mut graph = Graph::from_geometry(Geometry::Points(points), Material::MATTE);
    let bytes_of_one: Vec<_> =
        flat(graph.clone()).clouds().map(|cloud| cloud.points.bytes()).collect();
    let [(tree, points)] = bytes_of_one[..] else { panic!("{} clouds", bytes_of_one.len()) };
    assert!(20_000_000 < tree + points && tree + points < 24_000_000);
    let mut random = Random::new(78, 0);
    let mut along = || 40.0 * random.next_f64() - 20.0;
    let matrices = (0..N_INSTANCES).map(|i| {
        let turn = DQuat::from_rotation_y(i as f64) * DQuat::from_rotation_x(0.3 * i as f64);
        let position = DVec3::new(along(), along(), along());
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.002), turn, position)
    });
    graph.nodes = matrices.map(|matrix| scenes::node(0, 0, matrix)).collect();
    let scene = flat(graph);
    assert_eq!((scene.geometries.len(), scene.instances.len()), (1, N_INSTANCES));
    let bytes: Vec<_> = scene.clouds().map(|cloud| cloud.points.bytes()).collect();
    assert_eq!(bytes, bytes_of_one);
    let each = bytes_of_instances(&scene) / N_INSTANCES;
    assert!(each <= MAX_BYTES, "{each} bytes an instance");
    let n_hits =
        check_against_brute_force("a million each", &scene, &scenes::random_rays(64, 20.0, 79));
    assert!(30 < n_hits, "{n_hits}");
}

/// Returns a graph of clouds and balls that overlap, two of them in one position and others 0.01 to 0.03 away.
fn overlapping(kind: SurfaceKind) -> Graph {
    let ball = Geometry::Triangles(scenes::uv_sphere(16, 32, 0.99));
    let points = scenes::points(clouds::sphere(1000, 1.0), kind);
    let things = vec![(Geometry::Points(points), Material::MATTE), (ball, Material::MATTE)];
    let mut graph = scenes::graph(things);
    let turn = DAffine3::from_rotation_y(0.4);
    let shifted = |shift: f64| turn * at(shift * DVec3::new(0.6, -0.8, 0.0));
    graph.nodes.extend([
        scenes::node(0, 0, shifted(0.0)),
        scenes::node(1, 1, shifted(0.01)),
        scenes::node(0, 0, shifted(0.03)),
        scenes::node(0, 0, shifted(0.0)),
    ]);
    graph
}

#[test]
fn overlapping_instances_are_hit_like_separate_ones() {
    let rays = scenes::random_rays(1500, 1.2, 75);
    for kind in scenes::hit_kinds() {
        let scene = flat(overlapping(kind));
        let n_hits = check_against_brute_force(kind.name(), &scene, &rays);
        assert!(500 < n_hits, "{n_hits}");
    }
}

#[test]
fn the_first_of_coinciding_instances_is_hit() {
    let quad = Geometry::Triangles(scenes::floor(0.0, 1.0));
    let mut graph = Graph::from_geometry(quad, Material::MATTE);
    let matrix = DAffine3::from_rotation_z(0.5) * at(DVec3::X);
    graph.nodes =
        [matrix, at(9.0 * DVec3::Z), matrix, matrix].map(|p| scenes::node(0, 0, p)).into();
    // The first instance is at the origin of the scene.
    let scene = flat(graph);
    let rays: Vec<Ray> =
        (0..40).map(|i| Ray::new(Vec3::new(0.04 * i as f32 - 0.8, 0.3, 5.0), -Vec3::Z)).collect();
    let found = hits(&scene, InstanceFilter::All, &rays);
    assert!(20 < found.iter().filter(|hit| !hit.is_miss()).count());
    assert!(found.iter().all(|hit| hit.is_miss() || hit.instance == 0));
}

#[test]
fn filters_select_opaque_and_transmissive_instances() {
    let ball = Geometry::Triangles(scenes::uv_sphere(8, 16, 0.5));
    let materials = [
        Material::GLASS,
        Material::MATTE,
        Material { alpha_mode: AlphaMode::Blend, alpha: 0.5, ..Material::MATTE },
        Material { alpha_mode: AlphaMode::Mask(0.5), ..Material::MATTE },
        Material::MIRROR,
    ];
    let mut graph = scenes::graph(materials.map(|material| (ball.clone(), material)).into());
    for (i, node) in graph.nodes.iter_mut().enumerate() {
        node.transform = Transform::Matrix(at(0.7 * i as f64 * DVec3::X));
    }
    let scene = flat(graph);
    let rays = scenes::random_rays(3000, 2.0, 76);
    for (which, counts) in [
        (InstanceFilter::All, [true; 5]),
        (InstanceFilter::Opaque, [false, true, false, false, true]),
        (InstanceFilter::Transmissive, [true, false, true, true, false]),
    ] {
        let counts = |instance: &Instance| counts[instance.node_idx as usize];
        let expected = brute_force_hits(&scene, counts, &rays);
        let found = hits(&scene, which, &rays);
        assert!(expected.iter().filter(|hit| hit.instance != u32::MAX).count() > 50);
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(InstanceHit::of(&scene, found), *expected, "{which:?}");
        }
        let is_blocked = expected.iter().map(|hit| hit.instance != u32::MAX);
        assert!(occlusions(&scene, which, &rays).into_iter().eq(is_blocked), "{which:?}");
    }
}

#[test]
fn no_ray_slips_between_instances_that_share_an_edge() {
    let half = |side: f32| {
        let quad = scenes::quad(side * 0.5 * Vec3::X, 0.5 * Vec3::X, Vec3::Y);
        (Geometry::Triangles(quad), Material::MATTE)
    };
    let mut graph = scenes::graph(vec![half(-1.0), half(1.0)]);
    let unmoved = flat(graph.clone());
    // The same plane with its halves moved by their nodes; the origin of the scene is in the middle of one.
    graph.geometries = vec![Geometry::Triangles(scenes::floor(0.0, 1.0))];
    graph.nodes = [-1.0, 1.0].map(|side| scenes::node(0, 0, at(side * DVec3::X))).into();
    graph.nodes.insert(0, Node::new("empty"));
    let moved = flat(graph);
    for (scene, edge) in [(&unmoved, 0.0), (&moved, 1.0)] {
        let edge = edge * Vec3::X;
        let rays: Vec<Ray> = (-40..=40)
            .flat_map(|i| {
                let target = edge + 0.02 * i as f32 * Vec3::Y;
                [-Vec3::Z, Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.6, 0.0, -0.8)]
                    .map(|direction| Ray::new(target - 2.0 * direction, direction))
            })
            .collect();
        let found = hits(scene, InstanceFilter::All, &rays);
        let missed = found.iter().position(SceneHit::is_miss);
        assert_eq!(missed.map(|i| rays[i]), None);
        assert!(!occlusions(scene, InstanceFilter::All, &rays).contains(&false));
    }
}

/// Regression tests of cases that once failed.
mod known {
    use super::*;

    /// Rays that never reach the slab of a box once had NaN as the key by which instances are ordered.
    #[test]
    fn a_ray_along_an_axis_passes_boxes_beside_it() {
        let ball = Geometry::Triangles(scenes::uv_sphere(8, 16, 0.5));
        let mut graph = Graph::from_geometry(ball, Material::MATTE);
        let positions = [DVec3::ZERO, 3.0 * DVec3::Y, -3.0 * DVec3::Z, 3.0 * DVec3::X];
        graph.nodes = positions.map(|position| scenes::node(0, 0, at(position))).into();
        let scene = flat(graph);
        for axis in Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
            let ray = Ray::new(-9.0 * axis, axis);
            assert!(!hits(&scene, InstanceFilter::All, &[ray])[0].is_miss(), "{axis}");
            assert_eq!(occlusions(&scene, InstanceFilter::All, &[ray]), [true], "{axis}");
        }
    }

    #[test]
    fn vertex_normals_of_zero_length_are_replaced_by_the_geometric_normal() {
        let mesh = Mesh { normals: Some(vec![Vec3::ZERO; 4]), ..scenes::floor(0.0, 1.0) };
        let mut graph = Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE);
        graph.nodes = vec![scenes::node(0, 0, DAffine3::from_rotation_x(1.0))];
        let up = Vec3::new(0.0, -1f32.sin(), 1f32.cos());
        let found = hits(&flat(graph), InstanceFilter::All, &[Ray::new(2.0 * up, -up)]);
        assert!(found[0].normal.distance(up) < 1e-6, "{found:?}");
    }

    #[test]
    fn tiny_and_huge_triangles_have_unit_normals() {
        for scale in [1e-11f32, 1e-8, 1e-5, 1.0, 1e5, 1e8, 1e11] {
            for mesh in [scenes::floor(0.0, scale), scenes::uv_sphere(8, 16, scale)] {
                let scene = flat(Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE));
                let origin = scale * Vec3::new(0.1, 0.2, 3.0);
                let found = hits(&scene, InstanceFilter::All, &[Ray::new(origin, -Vec3::Z)]);
                let (normal, facet) = (found[0].normal, found[0].geometric_normal);
                assert!(
                    !found[0].is_miss() && 0.9 < normal.z && 0.9 < facet.z,
                    "{scale}: {found:?}"
                );
                assert!(
                    (normal.length() - 1.0).abs() < 1e-5 && (facet.length() - 1.0).abs() < 1e-5
                );
            }
        }
    }
}
