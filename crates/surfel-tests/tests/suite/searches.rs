//! Every search against brute force over the decoded points, at every SIMD level, and the bytes and precision
//! of the flat form.

use crate::brute_force::BruteForce;
use surfel_core::flat::{FlatCloud, FlatScene};
use surfel_core::math::{DVec3, LANES, Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::CloudGeometry;
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_core::trace::{self, Hit, Simd, SurfaceHit};
use surfel_tests::clouds;
use surfel_tests::scenes;

/// Returns clouds of all shapes that the searches have to deal with, each with a name.
pub fn test_clouds() -> Vec<(&'static str, PointCloud)> {
    let far = |cloud: &PointCloud| {
        let positions =
            cloud.positions.iter().map(|&p| p + Vec3::new(3000.0, -2000.0, 0.0)).collect();
        PointCloud { positions, ..cloud.clone() }
    };
    let mut outlier = clouds::sphere(500, 1.0);
    outlier.positions[3] = Vec3::new(0.0, 1e5, 0.0);
    vec![
        ("one point", clouds::sphere(1, 1.0)),
        ("two points", clouds::sphere(2, 1.0)),
        ("nine points", clouds::sphere(9, 1.0)),
        ("sphere", clouds::sphere(3000, 1.0)),
        ("plane", clouds::plane(40, 0.4, 1)),
        ("even plane", clouds::plane(40, 0.0, 1)),
        ("crossing planes", clouds::crossing_planes(30, 0.4, 2)),
        ("line", clouds::line(300)),
        ("far away", far(&clouds::sphere(1000, 1.0))),
        ("outlier", outlier),
    ]
}

#[test]
fn every_search_equals_brute_force() {
    for (name, cloud) in test_clouds() {
        let center = if name == "far away" { Vec3::new(3000.0, -2000.0, 0.0) } else { Vec3::ZERO };
        let rays: Vec<Ray> = scenes::random_rays(400, 1.2, 7)
            .into_iter()
            .map(|ray| Ray { origin: ray.origin + center, ..ray })
            .collect();
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::SplatFit] {
            let flat = scenes::flat(cloud.clone(), kind);
            BruteForce::new(&flat, rays.clone()).check_in_order(name);
        }
    }
}

#[test]
fn the_lowest_slot_of_equal_points_is_hit() {
    // Preparation would drop all points but one.
    let n = 100;
    let cloud = PointCloud {
        normals: Some(vec![Vec3::X; n]),
        radii: Some(vec![0.5; n]),
        ..clouds::equal_points(n)
    };
    let mut points = scenes::grey(cloud);
    points.surface = SurfaceKind::Disc;
    let flat = FlatCloud::new(&points, &surfel_core::progress::NoProgress).unwrap();
    let rays = [Ray::new(Vec3::new(5.0, 2.1, 3.0), -Vec3::X)];
    BruteForce::new(&flat, rays.to_vec()).check_in_order("equal points");
    let mut hits = [Hit::MISS];
    trace::closest_hits(&flat, Simd::detect(), &rays, &mut hits);
    assert_eq!(hits[0].slot, 0);
}

#[test]
fn the_surface_is_the_same_at_every_simd_level() {
    let rays = scenes::random_rays(3000, 1.2, 9);
    for (_, kind) in SurfaceKind::ALL {
        for edge_test in [EdgeTest::AngularGap, EdgeTest::Off] {
            let flat = FlatCloud { edge_test, ..scenes::flat(clouds::sphere(2000, 1.0), kind) };
            let results: Vec<_> = Simd::available()
                .into_iter()
                .map(|simd| {
                    let mut hits = vec![SurfaceHit::MISS; rays.len()];
                    let mut occluded = vec![false; rays.len()];
                    trace::surface_hits(&flat, simd, &rays, &mut hits);
                    trace::occlusions(&flat, simd, &rays, &mut occluded);
                    (hits, occluded)
                })
                .collect();
            assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{kind:?} {edge_test:?}");
        }
    }
}

#[test]
fn a_closed_surface_occludes_where_it_is_hit() {
    let rays = scenes::random_rays(3000, 1.2, 10);
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::Splat] {
        let flat = scenes::flat(clouds::sphere(2000, 1.0), kind);
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        let mut occluded = vec![false; rays.len()];
        trace::surface_hits(&flat, Simd::detect(), &rays, &mut hits);
        trace::occlusions(&flat, Simd::detect(), &rays, &mut occluded);
        let differing = hits
            .iter()
            .zip(&occluded)
            .filter(|(hit, occluded)| hit.is_miss() == **occluded)
            .count();
        // Occlusions test an edge by the normal of one disc, hits by the blended normal: 3 rays in a thousand may
        // differ.
        assert!(differing <= 9, "{kind:?}: {differing} of {}", rays.len());
    }
}

#[test]
fn the_tree_holds_every_point_once_within_its_boxes() {
    use surfel_core::bvh::{BvhPrimitive, build};
    let cloud = scenes::points(clouds::sphere(20_000, 1.0), SurfaceKind::Disc).cloud().clone();
    let primitives: Vec<BvhPrimitive> = (0..cloud.len())
        .map(|i| {
            let normal = cloud.normals.as_ref().unwrap()[i];
            let bounds = SurfaceKind::Disc.bounds(cloud.positions[i], normal, 0.02);
            BvhPrimitive::new(bounds, i as u32, 0.02)
        })
        .collect();
    let tree = build(primitives.clone(), |_| true, &surfel_core::progress::NoProgress).unwrap();
    tree.validate(&primitives);
    let filled = cloud.len() as f64 / (tree.blocks.len() * LANES) as f64;
    assert!(0.97 < filled, "blocks are {filled} full");
}

#[test]
fn the_flat_form_takes_at_most_24_bytes_a_point() {
    for (name, cloud) in
        [("sphere", clouds::sphere(100_000, 1.0)), ("planes", clouds::crossing_planes(200, 0.5, 3))]
    {
        let n = cloud.len();
        let (tree, points) = scenes::flat(cloud, SurfaceKind::Splat).points.bytes();
        assert!(
            (tree + points) as f64 / n as f64 <= 24.0,
            "{name}: {tree} + {points} bytes for {n} points"
        );
    }
}

#[test]
fn decoded_points_are_within_a_thousandth_of_their_radius() {
    for (name, cloud) in test_clouds() {
        let points = scenes::points(cloud, SurfaceKind::Splat);
        let flat = FlatCloud::new(&points, &surfel_core::progress::NoProgress).unwrap();
        for slot in flat.points.slots() {
            let (id, disc) = (flat.points.id(slot) as usize, flat.points.surfel(slot));
            let radius = points.cloud().radii()[id];
            assert!(
                disc.center.distance(points.cloud().positions[id])
                    <= 1e-3 * radius + 2e-4 * f32::from(name == "far away" || name == "outlier"),
                "{name} {id}"
            );
            assert!((disc.radius - radius).abs() < 2e-3 * radius, "{name} {id}");
        }
    }
}

#[test]
fn an_empty_cloud_shows_nothing() {
    let scene = scenes::lit(CloudGeometry::default());
    let flat = FlatScene::new(&scene, &surfel_core::progress::NoProgress).unwrap();
    assert!(flat.instances.is_empty());
    assert_eq!(scene.camera.focal_point, DVec3::ZERO);
}
