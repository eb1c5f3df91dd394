//! All kinds of surface compared with the meshes that points were taken from.

use super::clouds;
use super::figures;
use std::path::Path;
use std::time::Instant;
use surfel_core::flat::FlatCloud;
use surfel_core::points::{PointCloud, Preparation};
use surfel_core::progress::NoProgress;
use surfel_core::scene::Mesh;
use surfel_core::surface::SurfaceKind;
use surfel_tests::deviation::{Deviation, TrueViews};
use surfel_tests::ground_truth::GroundTruth;
use surfel_tests::sampling::{Sampling, mean_spacing};
use surfel_tests::scenes;
use surfel_tests::shapes;

/// Width and height of each of the four views.
const RESOLUTION: u32 = 384;
/// Number of times that the views are traced, of which the fastest counts.
const N_RUNS: usize = 3;

/// The figures of a kind.
pub struct KindFigures {
    deviation: Deviation,
    trace_ms: f64,
    build_ms: f64,
    bytes_per_point: f64,
}

/// A shape whose points are compared with it.
pub struct Sampled {
    mesh: GroundTruth,
    views: TrueViews,
    n_points: usize,
}

impl Sampled {
    /// Samples a mesh with random points, seen in four views.
    pub fn new(mesh: &Mesh, n_points: usize, resolution: u32) -> Self {
        let mesh = GroundTruth::from_mesh(mesh);
        Self { views: TrueViews::new(&mesh, resolution), mesh, n_points }
    }
}

/// Returns the preparation of a cloud as one surface, with normals where a kind needs them.
pub fn preparation(kind: SurfaceKind) -> Preparation {
    Preparation { estimates_normals: kind.needs_normals(), ..scenes::one_surface() }
}

/// Asserts the figures of all kinds for a small cloud.
pub fn check() {
    let sampled = Sampled::new(&shapes::blob(), 3000, 64);
    for (name, kind) in SurfaceKind::ALL {
        if !matches!(kind, SurfaceKind::Points | SurfaceKind::Gaussian) {
            let figures = compare(&sampled, kind, &preparation(kind));
            assert!(figures.deviation.misses < 0.05, "{name}: {:?}", figures.deviation);
        }
    }
}

/// Prints the table, and writes a picture of each kind.
pub fn print_kinds(folder: Option<&Path>) {
    print_header();
    let all = [
        ("cube", shapes::cube(), 20_000),
        ("blob", shapes::blob(), 20_000),
        ("head", shapes::head(), 60_000),
    ];
    for (cloud, mesh, n_points) in all {
        let sampled = Sampled::new(&mesh, n_points, RESOLUTION);
        for (name, kind) in SurfaceKind::ALL {
            if matches!(kind, SurfaceKind::Points | SurfaceKind::Gaussian) {
                continue;
            }
            print_row(cloud, &format!("`{name}`"), &compare(&sampled, kind, &preparation(kind)));
        }
    }
    if let Some(folder) = folder {
        let subject = clouds::bunny().unwrap_or_else(clouds::head);
        figures::write_kinds(folder, &subject);
    }
}

/// Prints the head of a table of figures.
pub fn print_header() {
    println!(
        "\n| cloud | surface | missing % | false % | depth, s | over 5 s, % | normals: mean, 95 % | \
         trace, ms | build, ms | bytes a point |\n{}",
        "| --- ".repeat(10) + "|"
    );
}

/// Prints the figures of a surface.
pub fn print_row(cloud: &str, surface: &str, figures: &KindFigures) {
    let KindFigures { deviation, trace_ms, build_ms, bytes_per_point } = figures;
    println!(
        "| {cloud} | {surface} | {:.3} | {:.3} | {:.3} | {:.2} | {:.1}°, {:.1}° | {trace_ms:.0} | \
         {build_ms:.0} | {bytes_per_point:.1} |",
        100.0 * deviation.misses,
        100.0 * deviation.false_hits,
        deviation.depth_rms,
        100.0 * deviation.far_off,
        deviation.normal_deg,
        deviation.normal_p95_deg,
    );
}

/// Compares the surface of a kind with the shape that its points were taken from.
pub fn compare(sampled: &Sampled, kind: SurfaceKind, preparation: &Preparation) -> KindFigures {
    let Sampled { mesh, views, n_points } = sampled;
    let positions = Sampling::Random.sample(mesh, *n_points, 1);
    let points = scenes::prepared(PointCloud::from_positions(positions), preparation, kind);
    let begin = Instant::now();
    let flat = FlatCloud::new(&points, &NoProgress).unwrap();
    let build_ms = 1000.0 * begin.elapsed().as_secs_f64();
    let (mut trace_ms, mut hits) = (f64::INFINITY, Vec::new());
    for _ in 0..N_RUNS {
        let begin = Instant::now();
        hits = views.trace(&flat);
        trace_ms = trace_ms.min(1000.0 * begin.elapsed().as_secs_f64());
    }
    let (tree, points) = flat.bytes();
    KindFigures {
        deviation: views.compare(&hits, mean_spacing(mesh, *n_points)),
        trace_ms,
        build_ms,
        bytes_per_point: (tree + points) as f64 / *n_points as f64,
    }
}
