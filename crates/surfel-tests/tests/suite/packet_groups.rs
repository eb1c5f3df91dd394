//! Groups of adjacent packets, which share entry points below the root of the tree, against brute force.

use crate::brute_force::BruteForce;
use crate::rays::{TILE, centers, shadow_rays};
use crate::searches;
use surfel_core::flat::FlatCloud;
use surfel_core::math::{Aabb, Basis, Random, Ray, Vec3};
use surfel_core::surface::SurfaceKind;
use surfel_tests::clouds;
use surfel_tests::scenes;

/// The number of rays in a group of packets.
const GROUP: usize = 16 * TILE;

#[test]
fn grouped_packets_find_the_same_hits_as_brute_force() {
    let cube = ("cube", clouds::cube(12, 0.3, 5));
    for (name, cloud) in searches::test_clouds().into_iter().chain([cube]) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(cloud.clone(), kind);
            for width in [0.2, 0.02, 0.002] {
                let camera = BruteForce::new(&scene, window_rays(&scene, width));
                check_group(&format!("{name}, {width} wide"), &scene, &camera.rays);
                let shadow = shadow_rays(&scene, &camera);
                check_group(&format!("{name}, {width} wide, shadow"), &scene, &shadow);
                let scattered = scattered(&camera.rays);
                check_group(&format!("{name}, {width} wide, scattered"), &scene, &scattered);
            }
        }
    }
}

/// Returns camera rays from far away through sixteen adjacent tiles of four by four pixels.
fn window_rays(scene: &FlatCloud, width: f32) -> Vec<Ray> {
    let centers = centers(scene);
    let bounds = Aabb::of_points(centers.iter().copied());
    let target = centers[centers.len() / 3];
    let eye = target + (bounds.diagonal() + scene.points.radius(0)) * Vec3::new(0.3, -0.9, 0.4);
    let forward = (target - eye).normalize();
    let basis = Basis::around(forward);
    let pixel = |i: usize| {
        let (tile, i) = (i / TILE, i % TILE);
        let offset = |tile: usize, i: usize| (4 * tile + i) as f32 / TILE as f32 - 0.47;
        let (x, y) = (offset(tile % 4, i % 4), offset(tile / 4, i / 4));
        let across = width * (x * basis.tangent + y * basis.bitangent);
        Ray::new(eye, (forward + across).normalize())
    };
    (0..GROUP).map(pixel).collect()
}

/// Returns the rays with their origins moved at random.
fn scattered(rays: &[Ray]) -> Vec<Ray> {
    let mut random = Random::new(54, 0);
    let mut gaussian = || 0.05 * random.next_gaussian() as f32;
    let moved = rays.iter().map(|ray| {
        let offset = ray.origin.length() * Vec3::new(gaussian(), gaussian(), gaussian());
        Ray { origin: ray.origin + offset, ..*ray }
    });
    moved.collect()
}

/// Compares a group of rays with brute force: whole, in parts, and with some rays reversed.
fn check_group(name: &str, scene: &FlatCloud, rays: &[Ray]) {
    let n = rays.len();
    let reversed = rays.iter().map(|ray| Ray { direction: -ray.direction, ..*ray });
    let plain = BruteForce::new(scene, rays.iter().copied().chain(reversed).collect());
    let in_order: Vec<usize> = (0..n).collect();
    plain.check(name, &in_order, &[TILE, 40, 100, GROUP]);
    for step in [200, 37] {
        let some_reversed = (0..n).map(|i| if i % step == step / 2 { n + i } else { i });
        let order: Vec<usize> = some_reversed.collect();
        plain.check(&format!("{name}, each {step}th reversed"), &order, &[GROUP]);
    }
}
