//! Evaluations of searches for a ray, beside the time that they take.

use super::clouds;
use super::timing::RESOLUTION;
use std::time::Instant;
use surfel_core::flat::FlatCloud;
use surfel_core::math::{DVec3, Ray};
use surfel_core::progress::NoProgress;
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{Counted, Simd, SurfaceHit, surface_hits, take_counts};

/// Number of rays that are traced together.
const BATCH_SIZE: usize = 4096;

/// Prints evaluations and nanoseconds a ray, on one thread.
pub fn print_counts() {
    if take_counts().is_none() {
        return eprintln!("counts skipped: built without the feature `counts`");
    }
    let names = Counted::ALL.map(|(name, _)| name).join(" | ");
    println!("\n| surface | {names} | ns |\n{}|", "| --- ".repeat(Counted::ALL.len() + 2));
    let subject = clouds::head();
    let view = subject.camera.view(DVec3::ZERO, RESOLUTION, RESOLUTION);
    let tile = |i: u32| {
        let (x, y) = (i % RESOLUTION, i / RESOLUTION);
        view.ray(x as f32 + 0.5, y as f32 + 0.5)
    };
    let rays: Vec<Ray> = (0..RESOLUTION / 4)
        .flat_map(|row| {
            (0..4 * RESOLUTION).map(move |i| (i / 16 * 4 + i % 4, 4 * row + i % 16 / 4))
        })
        .map(|(x, y)| tile(y * RESOLUTION + x))
        .collect();
    for (name, kind) in SurfaceKind::ALL {
        if matches!(kind, SurfaceKind::Points | SurfaceKind::Gaussian) {
            continue;
        }
        let flat = FlatCloud::new(&subject.geometry(kind), &NoProgress).unwrap();
        take_counts();
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        let begin = Instant::now();
        for (rays, hits) in rays.chunks(BATCH_SIZE).zip(hits.chunks_mut(BATCH_SIZE)) {
            surface_hits(&flat, Simd::detect(), rays, hits);
        }
        let ns = begin.elapsed().as_nanos() as f64 / rays.len() as f64;
        let counts = take_counts().unwrap_or_default();
        let per_ray = counts.map(|count| format!("{:.1}", count as f64 / rays.len() as f64));
        println!("| `{name}` | {} | {ns:.0} |", per_ray.join(" | "));
    }
}
