//! The surface before many rays at once: each sees what it would see alone.

use crate::build;
use crate::modes::{camera_rays, degenerate_rays, loose_rays, shadow_rays, shuffled};
use crate::plain::Plain;
use surfel::flat::FlatCloud;
use surfel::math::{Ray, Vec3};
use surfel::surface::{Boundary, SurfaceKind};
use surfel::trace::{Simd, SurfaceHit, occlusions, surface_hits};
use surfel_tests::{clouds, scenes};

pub type Seen = (SurfaceHit, bool);

pub fn surface(scene: &FlatCloud, simd: Simd, rays: &[Ray]) -> Vec<Seen> {
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    surface_hits(scene, simd, rays, &mut hits);
    occlusions(scene, simd, rays, &mut occluded);
    hits.into_iter().zip(occluded).collect()
}

#[test]
fn the_surface_is_the_same_whatever_rays_are_beside() {
    for (name, cloud) in [
        ("one point", clouds::sphere(1, 1.0)),
        ("sphere", clouds::sphere(500, 1.0)),
        ("crossing planes", clouds::crossing_planes(20, 0.4, 2)),
        ("even cube", clouds::cube(5, 0.0, 5)),
        ("line", clouds::line(60)),
    ] {
        for (_, kind) in SurfaceKind::ALL {
            let flat = scenes::flat(cloud.clone(), kind);
            let camera = Plain::new(&flat, camera_rays(&flat, 8));
            let shadow = shadow_rays(&flat, &camera);
            let odd = degenerate_rays(&flat).into_iter().step_by(7).collect();
            let rays = [camera.rays, shadow, loose_rays(&flat, 100), odd].concat();
            let (ending, endless): (Vec<Ray>, Vec<Ray>) =
                rays.into_iter().partition(|ray| ray.t_max.is_finite());
            for boundary in [Boundary::Gap, Boundary::Off] {
                let scene = FlatCloud { boundary, ..flat.clone() };
                check_surface(name, &scene, &ending);
                check_surface(name, &scene, &endless);
            }
        }
    }
}

/// In order, shuffled, in small batches and one by one.
fn check_surface(name: &str, scene: &FlatCloud, rays: &[Ray]) {
    let one_by_one: Vec<Seen> =
        rays.iter().flat_map(|&ray| surface(scene, Simd::PORTABLE, &[ray])).collect();
    let in_order: Vec<usize> = (0..rays.len()).collect();
    let shuffled = shuffled(in_order.clone());
    for simd in Simd::available() {
        for (order, batch_len) in
            [(&in_order, 1000), (&shuffled, 1000), (&shuffled, 17), (&in_order, 1)]
        {
            for batch in order.chunks(batch_len) {
                let batch_rays: Vec<Ray> = batch.iter().map(|&i| rays[i]).collect();
                let seen = surface(scene, simd, &batch_rays);
                for ((seen, &i), ray) in seen.iter().zip(batch).zip(&batch_rays) {
                    let (kind, boundary, simd) = (scene.surface, scene.boundary, simd.name());
                    let context = format!("{name}, {kind:?}, {boundary:?}, {simd}, {ray:?}");
                    assert_eq!(*seen, one_by_one[i], "{context}, batches of {batch_len}");
                }
            }
        }
    }
}

#[test]
fn nothing_is_hit_where_no_point_can_be() {
    let mut cloud = scenes::points(clouds::sphere(20, 1.0), SurfaceKind::Disc).cloud;
    cloud.positions.fill(Vec3::NAN);
    let scene = build::flat(cloud, SurfaceKind::Disc);
    let rays = scenes::random_rays(40, 1.0, 54);
    Plain::new(&scene, rays.clone()).check_in_order("no points");
    let seen = surface(&scene, Simd::detect(), &rays);
    assert!(seen.iter().all(|(hit, is_occluded)| hit.is_miss() && !is_occluded));
}
