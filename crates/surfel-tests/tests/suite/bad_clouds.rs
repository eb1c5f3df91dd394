//! Trees over bad input: building ends, memory is bounded, and searches find every hit.

use crate::brute_force::BruteForce;
use surfel_core::bvh::NO_PRIMITIVE;
use surfel_core::flat::{FlatCloud, FlatPoints};
use surfel_core::math::{Aabb, Random, Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::surface::SurfaceKind;
use surfel_tests::scenes;

/// Returns the flat form of a cloud without preparing the cloud, which would repair it.
pub fn flat(cloud: PointCloud, surface: SurfaceKind) -> FlatCloud {
    let colors = vec![[188; 3]; cloud.len()];
    let columns = scenes::columns(&cloud, surface, &colors);
    let points = FlatPoints::new(columns, &NoProgress).unwrap();
    let max_radius = points.slots().map(|slot| points.radius(slot)).fold(0.0, f32::max);
    let max_blend_distance = if surface.blends_discs() { max_radius } else { 0.0 };
    FlatCloud { points, surface, max_blend_distance, ..FlatCloud::default() }
}

/// Returns a cloud with random normals and with radii that a function draws.
fn cloud(positions: Vec<Vec3>, radius: impl Fn(&mut Random) -> f32) -> PointCloud {
    let mut random = Random::new(21, 0);
    let radii = positions.iter().map(|_| radius(&mut random)).collect();
    let mut gaussian = || random.next_gaussian() as f32;
    let normals = positions.iter().map(|_| Vec3::new(gaussian(), gaussian(), gaussian()));
    let normals = normals.map(Vec3::normalize).collect();
    PointCloud { positions, normals: Some(normals), radii: Some(radii), ..Default::default() }
}

fn ball(n: usize) -> Vec<Vec3> {
    let mut random = Random::new(22, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    (0..n).map(|_| Vec3::new(gaussian(), gaussian(), gaussian())).collect()
}

/// Returns clouds that are hard to build trees for, each with a name; numbers overflow in the last two.
pub fn bad_clouds() -> Vec<(&'static str, PointCloud)> {
    let line = |x: fn(usize) -> f32, n: usize| (0..n).map(|i| Vec3::X * x(i)).collect();
    let with_duplicates = [ball(3000), vec![Vec3::splat(0.3); 10_000]].concat();
    let survey = ball(3000).iter().map(|p| 0.05 * *p + Vec3::new(1e7, -1e7, 0.0)).collect();
    vec![
        ("equal points", cloud(vec![Vec3::ONE; 5000], |_| 0.1)),
        ("ten thousand duplicates", cloud(with_duplicates, |_| 0.05)),
        (
            "radii over twelve decades",
            cloud(ball(5000), |random| 10f32.powf(12.0 * random.next_f32() - 6.0)),
        ),
        ("millimetres at ten thousand kilometres", cloud(survey, |_| 1e-3)),
        ("line", cloud(line(|i| i as f32, 5000), |_| 1.0)),
        ("powers of two", cloud(line(|i| 2f32.powi(i as i32 - 120), 240), |_| 1e-3)),
        (
            "powers of two in both directions",
            cloud(line(|i| (1 - 2 * (i % 2) as i32) as f32 * 1.1f32.powi(i as i32), 800), |_| 1e30),
        ),
        (
            "the whole range of f32",
            cloud(
                ball(2000)
                    .iter()
                    .map(|p| 1e38 * p.clamp(Vec3::splat(-3.0), Vec3::splat(3.0)))
                    .collect(),
                |_| 1.0,
            ),
        ),
    ]
}

#[test]
fn bad_clouds_have_sound_trees_of_bounded_size() {
    for (name, cloud) in bad_clouds() {
        for kind in [SurfaceKind::Points, SurfaceKind::Sphere, SurfaceKind::Disc] {
            let flat = flat(cloud.clone(), kind);
            flat.points.validate(kind);
            let mut ids: Vec<u32> =
                flat.points.ids.iter().copied().filter(|&id| id != NO_PRIMITIVE).collect();
            ids.sort_unstable();
            assert!(ids.into_iter().eq(0..cloud.len() as u32), "{name}, {kind:?}");
            let (tree, points) = flat.points.bytes();
            let per_point = (tree + points) as f64 / cloud.len() as f64;
            assert!(per_point < 200.0, "{name}, {kind:?}: {per_point} bytes a point");
        }
    }
}

#[test]
fn every_hit_in_a_bad_cloud_is_found() {
    for (name, cloud) in bad_clouds().into_iter().take(6) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let flat = flat(cloud.clone(), kind);
            let rays = rays_toward(&cloud, 150);
            BruteForce::new(&flat, rays).check_in_order(name);
        }
    }
}

#[test]
fn points_that_cannot_be_hit_are_left_out() {
    let mut cloud = cloud(ball(1000), |_| 0.1);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for (i, value) in bad.into_iter().enumerate() {
        cloud.positions[100 * i].y = value;
        cloud.radii.as_mut().unwrap()[100 * i + 1] = value;
        cloud.normals.as_mut().unwrap()[100 * i + 2].z = value;
    }
    cloud.radii.as_mut().unwrap()[500] = 0.0;
    cloud.radii.as_mut().unwrap()[501] = -1.0;
    cloud.normals.as_mut().unwrap()[502] = Vec3::ZERO;
    let left_out = [0, 1, 100, 101, 200, 201, 500, 501];
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
        let flat = flat(cloud.clone(), kind);
        flat.points.validate(kind);
        let ids: Vec<u32> = flat.points.slots().map(|slot| flat.points.id(slot)).collect();
        assert!(!ids.iter().any(|id| left_out.contains(id)));
        assert_eq!(ids.len() + left_out.len(), cloud.len());
        BruteForce::new(&flat, rays_toward(&cloud.subset(&ids), 300)).check_in_order("NaN");
    }
    cloud.positions.fill(Vec3::NAN);
    assert!(flat(cloud, SurfaceKind::Disc).points.nodes.is_empty());
}

/// Returns rays from around a cloud toward points of it.
pub fn rays_toward(cloud: &PointCloud, n: usize) -> Vec<Ray> {
    let bounds = Aabb::of_points(cloud.positions.iter().copied());
    let mut random = Random::new(23, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    (0..n)
        .map(|i| {
            let offset = Vec3::new(gaussian(), gaussian(), gaussian());
            let target = cloud.positions[i * 7919 % cloud.len()];
            let origin = bounds.center() + (1.0 + bounds.diagonal()) * offset.normalize();
            Ray::new(origin, (target - origin).normalize())
        })
        .collect()
}
