//! Packets side by side, which begin together below the top of the tree, against a plain loop.

use crate::modes::{TILE, centers, shadow_rays};
use crate::plain::Plain;
use crate::trace;
use surfel::flat::FlatCloud;
use surfel::math::{Aabb, Frame, Random, Ray, Vec3};
use surfel::surface::SurfaceKind;
use surfel_tests::{clouds, scenes};

/// Rays of packets that begin together.
const GROUP: usize = 16 * TILE;

#[test]
fn packets_that_begin_together_find_the_same() {
    let cube = ("cube", clouds::cube(12, 0.3, 5));
    for (name, cloud) in trace::test_clouds().into_iter().chain([cube]) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(cloud.clone(), kind);
            for width in [0.2, 0.02, 0.002] {
                let camera = Plain::new(&scene, window_rays(&scene, width));
                check_group(&format!("{name}, {width} wide"), &scene, &camera.rays);
                let shadow = shadow_rays(&scene, &camera);
                check_group(&format!("{name}, {width} wide, shadow"), &scene, &shadow);
                let scattered = scattered(&camera.rays);
                check_group(&format!("{name}, {width} wide, scattered"), &scene, &scattered);
            }
        }
    }
}

/// From far away through sixteen tiles of four by four pixels, side by side.
fn window_rays(scene: &FlatCloud, width: f32) -> Vec<Ray> {
    let centers = centers(scene);
    let bounds = Aabb::of_points(centers.iter().copied());
    let target = centers[centers.len() / 3];
    let eye = target + (bounds.diagonal() + scene.points.radius(0)) * Vec3::new(0.3, -0.9, 0.4);
    let forward = (target - eye).normalize();
    let frame = Frame::around(forward);
    let pixel = |i: usize| {
        let (tile, i) = (i / TILE, i % TILE);
        let place = |tile: usize, i: usize| (4 * tile + i) as f32 / TILE as f32 - 0.47;
        let (x, y) = (place(tile % 4, i % 4), place(tile / 4, i / 4));
        let across = width * (x * frame.tangent + y * frame.bitangent);
        Ray::new(eye, (forward + across).normalize())
    };
    (0..GROUP).map(pixel).collect()
}

/// The same rays, each begun somewhere else.
fn scattered(rays: &[Ray]) -> Vec<Ray> {
    let mut random = Random::new(54, 0);
    let mut gaussian = || 0.05 * random.next_gaussian() as f32;
    let moved = rays.iter().map(|ray| {
        let offset = ray.origin.length() * Vec3::new(gaussian(), gaussian(), gaussian());
        Ray { origin: ray.origin + offset, ..*ray }
    });
    moved.collect()
}

/// Rays of a group as they are, in parts, and with some that go the other way.
fn check_group(name: &str, scene: &FlatCloud, rays: &[Ray]) {
    let n = rays.len();
    let backward = rays.iter().map(|ray| Ray { direction: -ray.direction, ..*ray });
    let plain = Plain::new(scene, rays.iter().copied().chain(backward).collect());
    let in_order: Vec<usize> = (0..n).collect();
    plain.check(name, &in_order, &[TILE, 40, 100, GROUP]);
    for step in [200, 37] {
        let some_backward = (0..n).map(|i| if i % step == step / 2 { n + i } else { i });
        let order: Vec<usize> = some_backward.collect();
        plain.check(&format!("{name}, each {step}th backward"), &order, &[GROUP]);
    }
}
