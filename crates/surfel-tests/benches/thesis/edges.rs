//! Normals at the edges of a cube, as in figures 7 to 11 of the thesis.

use super::clouds::{self, Subject};
use surfel_core::flat::FlatCloud;
use surfel_core::math::{DVec3, Ray, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{Simd, SurfaceHit, surface_hits};

/// Distance from an edge of the cube in which hits count, in sides of the cube.
const EDGE_WIDTH: f32 = 0.02;
/// Angle in degrees from which on a normal is wrong.
const WRONG_DEG: f32 = 30.0;

/// Asserts that normals which all point outward are right at visible edges.
pub fn check() {
    let (_, wrong) = wrong_edges(&clouds::cube(), SurfaceKind::Splat, 128);
    assert!(wrong < 0.5, "{wrong}");
}

/// Prints for all kinds the share of wrong normals at the visible edges of a cube.
pub fn print_edges() {
    let outward = clouds::cube();
    let random = outward.with_random_signs();
    println!("\n| surface | outward normals | normals of random sign |\n| --- | --- | --- |");
    for (name, kind) in SurfaceKind::ALL {
        if matches!(kind, SurfaceKind::Points | SurfaceKind::Gaussian) {
            continue;
        }
        let [outward, random] =
            [&outward, &random].map(|subject| 100.0 * wrong_edges(subject, kind, 512).1);
        println!("| `{name}` | {outward:.1} | {random:.1} |");
    }
}

/// Returns the number of pixels at edges between two sides of the cube that are both seen, and the share of those whose
/// normal is wrong.
fn wrong_edges(subject: &Subject, kind: SurfaceKind, resolution: u32) -> (usize, f64) {
    let flat = FlatCloud::new(&subject.geometry(kind), &NoProgress).unwrap();
    let view = subject.camera.view(DVec3::ZERO, resolution, resolution);
    let pixels = (0..resolution * resolution).map(|i| (i % resolution, i / resolution));
    let ray = |(x, y): (u32, u32)| view.ray(x as f32 + 0.5, y as f32 + 0.5);
    let rays: Vec<Ray> = pixels.map(ray).collect();
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    surface_hits(&flat, Simd::detect(), &rays, &mut hits);
    let (mut n_edge, mut n_wrong) = (0, 0);
    for (ray, hit) in rays.iter().zip(&hits).filter(|(_, hit)| !hit.is_miss()) {
        let position = ray.at(hit.distance);
        let is_near = |axis: usize| 1.0 - 2.0 * EDGE_WIDTH < position[axis].abs();
        let seen = (0..3).filter(|axis| is_near(*axis)).map(|axis| side(axis, position));
        let seen: Vec<Vec3> = seen.filter(|normal| normal.dot(ray.direction) < 0.0).collect();
        if seen.len() < 2 {
            continue;
        }
        let angle = |normal: &Vec3| normal.angle_between(hit.normal).to_degrees();
        let between = seen.iter().copied().sum::<Vec3>().normalize();
        let least = seen.iter().chain([&between]).map(angle).fold(f32::INFINITY, f32::min);
        n_edge += 1;
        n_wrong += usize::from(WRONG_DEG < least);
    }
    (n_edge, n_wrong as f64 / n_edge.max(1) as f64)
}

/// Returns the outward normal of the cube's side at a position.
fn side(axis: usize, position: Vec3) -> Vec3 {
    Vec3::AXES[axis] * position[axis].signum()
}
