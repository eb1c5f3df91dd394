//! Batches of rays: each ray finds the same surface whatever other rays its batch holds.

use crate::bad_clouds;
use crate::brute_force::BruteForce;
use crate::rays::{self, camera_rays, degenerate_rays, incoherent_rays, shadow_rays};
use surfel_core::flat::FlatCloud;
use surfel_core::math::{Ray, Vec3};
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_core::trace::{Simd, SurfaceHit, occlusions, surface_hits};
use surfel_tests::clouds;
use surfel_tests::scenes;

/// The hit of a ray and whether anything occludes the ray.
pub type SurfaceAnswer = (SurfaceHit, bool);

/// Searches the surface along all rays in one batch.
pub fn trace_surface(scene: &FlatCloud, simd: Simd, rays: &[Ray]) -> Vec<SurfaceAnswer> {
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    surface_hits(scene, simd, rays, &mut hits);
    occlusions(scene, simd, rays, &mut occluded);
    hits.into_iter().zip(occluded).collect()
}

#[test]
fn the_surface_does_not_depend_on_other_rays_of_the_batch() {
    for (name, cloud) in [
        ("one point", clouds::sphere(1, 1.0)),
        ("sphere", clouds::sphere(500, 1.0)),
        ("crossing planes", clouds::crossing_planes(20, 0.4, 2)),
        ("even cube", clouds::cube(5, 0.0, 5)),
        ("line", clouds::line(60)),
    ] {
        for (_, kind) in SurfaceKind::ALL {
            let flat = scenes::flat(cloud.clone(), kind);
            // Gaussians have no points of their own: rays are those of discs in their places.
            let discs = (kind == SurfaceKind::Gaussian)
                .then(|| scenes::flat(cloud.clone(), SurfaceKind::Disc));
            let points = discs.as_ref().unwrap_or(&flat);
            let camera = BruteForce::new(points, camera_rays(points, 8));
            let shadow = shadow_rays(points, &camera);
            let odd = degenerate_rays(points).into_iter().step_by(7).collect();
            let rays = [camera.rays, shadow, incoherent_rays(points, 100), odd].concat();
            let (ending, endless): (Vec<Ray>, Vec<Ray>) =
                rays.into_iter().partition(|ray| ray.t_max.is_finite());
            for edge_test in [EdgeTest::AngularGap, EdgeTest::Off] {
                let scene = FlatCloud { edge_test, ..flat.clone() };
                check_surface(name, &scene, &ending);
                check_surface(name, &scene, &endless);
            }
        }
    }
}

/// Compares batches of rays in order, shuffled, and of several sizes, with rays traced one by one.
fn check_surface(name: &str, scene: &FlatCloud, rays: &[Ray]) {
    let one_by_one: Vec<SurfaceAnswer> =
        rays.iter().flat_map(|&ray| trace_surface(scene, Simd::PORTABLE, &[ray])).collect();
    let in_order: Vec<usize> = (0..rays.len()).collect();
    let shuffled = rays::shuffled(in_order.clone());
    for simd in Simd::available() {
        for (order, batch_len) in
            [(&in_order, 1000), (&shuffled, 1000), (&shuffled, 17), (&in_order, 1)]
        {
            for batch in order.chunks(batch_len) {
                let batch_rays: Vec<Ray> = batch.iter().map(|&i| rays[i]).collect();
                let found = trace_surface(scene, simd, &batch_rays);
                for ((found, &i), ray) in found.iter().zip(batch).zip(&batch_rays) {
                    let (kind, edge_test, simd) = (scene.surface, scene.edge_test, simd.name());
                    let context = format!("{name}, {kind:?}, {edge_test:?}, {simd}, {ray:?}");
                    assert_eq!(*found, one_by_one[i], "{context}, batches of {batch_len}");
                }
            }
        }
    }
}

#[test]
fn smooth_hits_among_thousands_of_points_do_not_depend_on_other_rays() {
    // More points are in reach of each hit than f32 adds exactly.
    let mut cloud = clouds::plane(200, 0.4, 13);
    cloud.radii = Some(vec![0.5; cloud.len()]);
    for position in &mut cloud.positions {
        position.z = 0.2 * (3.0 * position.x).sin() * position.y;
    }
    let scene = bad_clouds::flat(cloud, SurfaceKind::Smooth);
    let scene = FlatCloud { edge_test: EdgeTest::Off, ..scene };
    let ray = |i: u8| {
        let aside = Vec3::new(f32::from(i % 4), f32::from(i / 4), 0.0);
        Ray::new(0.1 * aside + 2.0 * Vec3::Z, (0.02 * aside - Vec3::Z).normalize())
    };
    let rays: Vec<Ray> = (0..16).map(ray).collect();
    for simd in Simd::available() {
        let mut together = vec![SurfaceHit::MISS; rays.len()];
        surface_hits(&scene, simd, &rays, &mut together);
        for (ray, together) in rays.iter().zip(&together) {
            let mut single = [SurfaceHit::MISS];
            surface_hits(&scene, simd, &[*ray], &mut single);
            assert!(!together.is_miss(), "{ray:?}");
            assert_eq!(single[0], *together, "{ray:?}");
        }
    }
}

#[test]
fn a_cloud_of_nan_positions_is_not_hit() {
    let mut cloud =
        scenes::points(clouds::sphere(20, 1.0), SurfaceKind::Disc).cloud().clone().into_inner();
    cloud.positions.fill(Vec3::NAN);
    let scene = bad_clouds::flat(cloud, SurfaceKind::Disc);
    let rays = scenes::random_rays(40, 1.0, 54);
    BruteForce::new(&scene, rays.clone()).check_in_order("no points");
    let found = trace_surface(&scene, Simd::detect(), &rays);
    assert!(found.iter().all(|(hit, is_occluded)| hit.is_miss() && !is_occluded));
}
