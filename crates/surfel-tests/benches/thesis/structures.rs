//! The field of `implicit` searched through its kd-tree, and through the bounding volume hierarchy of the points.

use super::clouds;
use rayon::prelude::*;
use std::time::Instant;
use surfel_core::flat::{FieldTree, FlatCloud};
use surfel_core::math::Ray;
use surfel_core::progress::NoProgress;
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_core::trace::{Counted, Simd, SurfaceHit, surface_hits, take_counts};
use surfel_tests::field_bvh::{FieldBvh, SearchCounts};

/// Width and height of the pictures.
const RESOLUTION: u32 = 256;
/// Difference, in radii, from which on two hits are not the same.
const TOLERANCE: f32 = 0.1;

/// Prints for both structures what a camera ray evaluates, time and memory to build them, and how many rays agree.
pub fn print_structures() {
    println!(
        "\n| cloud | structure | build, ms | bytes a point | nodes or cells | supports | terms | same hits |\n{}|",
        "| --- ".repeat(8)
    );
    for subject in [clouds::cube(), clouds::head(), clouds::ruin_scan()] {
        let mut flat =
            FlatCloud::new(&subject.geometry(SurfaceKind::Implicit), &NoProgress).unwrap();
        flat.edge_test = EdgeTest::Off;
        let view = subject.camera.view(subject.origin(), RESOLUTION, RESOLUTION);
        let pixels = (0..RESOLUTION * RESOLUTION).map(|i| (i % RESOLUTION, i / RESOLUTION));
        let rays: Vec<Ray> =
            pixels.map(|(x, y)| view.ray(x as f32 + 0.5, y as f32 + 0.5)).collect();

        let begin = Instant::now();
        FieldTree::new(&flat.points, flat.has_outward_normals, &NoProgress).unwrap();
        let kd_ms = 1000.0 * begin.elapsed().as_secs_f64();
        take_counts();
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        surface_hits(&flat, Simd::detect(), &rays, &mut hits);
        let counts = take_counts().map(|counts| {
            [Counted::Cells, Counted::Terms].map(|what| counts[what as usize] as f64)
        });

        let begin = Instant::now();
        let bvh = FieldBvh::new(&flat);
        let bvh_ms = 1000.0 * begin.elapsed().as_secs_f64();
        let search = |ray: &Ray| {
            let mut counts = SearchCounts::default();
            (bvh.first_zero(ray, &mut counts), counts)
        };
        let found: Vec<_> = rays.par_iter().map(search).collect();
        let is_same = |(hit, (zero, _)): &(&SurfaceHit, &(Option<f32>, SearchCounts))| match zero {
            Some(distance) => (hit.distance - distance).abs() <= TOLERANCE * hit.radius,
            None => hit.is_miss(),
        };
        let n_same = hits.iter().zip(&found).filter(is_same).count();

        let n_rays = rays.len() as f64;
        let per_ray = |count: f64| format!("{:.1}", count / n_rays);
        let [cells, terms] = counts.map_or(["".into(), "".into()], |counts| counts.map(per_ray));
        let sum = |of: fn(&SearchCounts) -> usize| {
            per_ray(found.iter().map(|(_, counts)| of(counts)).sum::<usize>() as f64)
        };
        let per_point = |bytes: usize| bytes as f64 / subject.n_points() as f64;
        println!(
            "| {} | kd-tree of the field | {kd_ms:.0} | {:.1} | {cells} | | {terms} | |",
            subject.name,
            per_point(flat.field.bytes())
        );
        println!(
            "| {} | hierarchy of the points | {bvh_ms:.0} | {:.1} | {} | {} | {} | {:.3} % |",
            subject.name,
            per_point(size_of_val(flat.points.nodes.as_slice())),
            sum(|counts| counts.nodes),
            sum(|counts| counts.supports),
            sum(|counts| counts.terms),
            100.0 * n_same as f64 / n_rays
        );
    }
}
