//! Evaluations of searches for a ray, the operations of their arithmetic, and the time that they take.

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
/// Number of times that the rays are traced, of which the fastest counts.
const N_RUNS: usize = 3;

/// Returns the arithmetic operations of an evaluation of each kind, in the order of [`Counted::ALL`]: additions,
/// multiplications, divisions, roots, minima, comparisons and selections of one lane, counted in the code by hand.
fn operations(kind: SurfaceKind) -> [f64; Counted::ALL.len()] {
    let shape = match kind {
        SurfaceKind::Sphere | SurfaceKind::Mls => 29.0,
        _ => 28.0,
    };
    let term = match kind {
        SurfaceKind::Smooth => 106.0,
        // Planes take 36, polynomials 72; of seven points four are in sums for planes.
        SurfaceKind::Mls => 51.0,
        SurfaceKind::SplatFit => 26.0,
        _ => 13.0,
    };
    let root = if kind == SurfaceKind::Octree { 97.0 } else { 22.0 };
    let (cell, edge_point) = (29.0, 93.0);
    [shape, term, cell, root, edge_point]
}

/// Prints nanoseconds a ray on one thread, or, with the feature `counts`, which makes it slower, evaluations and
/// operations a ray.
pub fn print_counts() {
    let has_counts = take_counts().is_some();
    let names = match has_counts {
        true => Counted::ALL.map(|(name, _)| name).join(" | ") + " | operations",
        false => "ns".to_owned(),
    };
    println!("\n| surface | {names} |\n| --- |{}", " --- |".repeat(1 + names.matches('|').count()));
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
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        let mut ns = f64::INFINITY;
        for _ in 0..N_RUNS {
            take_counts();
            let begin = Instant::now();
            for (rays, hits) in rays.chunks(BATCH_SIZE).zip(hits.chunks_mut(BATCH_SIZE)) {
                surface_hits(&flat, Simd::detect(), rays, hits);
            }
            ns = ns.min(begin.elapsed().as_nanos() as f64 / rays.len() as f64);
        }
        let columns = match take_counts() {
            Some(counts) => {
                let per_ray = counts.map(|count| count as f64 / rays.len() as f64);
                let operations: f64 =
                    per_ray.iter().zip(operations(kind)).map(|(n, each)| n * each).sum();
                let per_ray = per_ray.map(|n| format!("{n:.1}")).join(" | ");
                format!("{per_ray} | {operations:.0}")
            }
            None => format!("{ns:.0}"),
        };
        println!("| `{name}` | {columns} |");
    }
}
