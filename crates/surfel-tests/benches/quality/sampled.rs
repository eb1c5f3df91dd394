//! Sampled shapes compared with their meshes.

use crate::pictures;
use crate::processor_time::processor_secs;
use crate::reconstruction::{self, METHOD};
use crate::selection::Selection;
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;
use surfel_core::flat::FlatCloud;
use surfel_core::image::Image;
use surfel_core::math::{DVec3, Random, Ray, Vec3};
use surfel_core::points::{PointCloud, Preparation};
use surfel_core::progress::NoProgress;
use surfel_core::scene::{CloudGeometry, Geometry};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{self, Simd, SurfaceHit};
use surfel_tests::deviation::{Deviation, TrueViews};
use surfel_tests::ground_truth::GroundTruth;
use surfel_tests::picture_difference::LitViews;
use surfel_tests::sampling::{Sampling, mean_spacing};
use surfel_tests::scenes;
use surfel_tests::shapes;
use surfel_tests::shared_data::shared_data;

/// A shape and the number of points that it is sampled with.
struct Shape {
    name: &'static str,
    n_points: usize,
    mesh: fn(&Path) -> GroundTruth,
    /// True if the mesh comes from a file.
    is_file: bool,
}

/// A shape as its pictures show it.
struct Truth {
    views: TrueViews,
    lit: LitViews,
}

impl Truth {
    fn new(mesh: &GroundTruth, resolution: u32) -> Self {
        Self { views: TrueViews::new(mesh, resolution), lit: LitViews::new(mesh, resolution) }
    }
}

/// Points of a shape.
struct Sample {
    name: String,
    cloud: PointCloud,
    /// Mean distance between points.
    spacing: f32,
}

/// Runs small clouds and asserts their figures.
pub fn check() {
    let kind = SurfaceKind::Splat;
    let mesh = GroundTruth::from_mesh(&shapes::low_poly_blob());
    let truth = Truth::new(&mesh, 64);
    let cloud = PointCloud::from_positions(Sampling::Uniform.sample(&mesh, 1000, 1));
    let sample = Sample { name: "blob".to_owned(), cloud, spacing: mean_spacing(&mesh, 1000) };
    compare_surface(&sample, &truth, "splat", kind);
    let n_uncovered = n_uncovered_pixels(kind, 2000, 100);
    assert!(n_uncovered < 500, "{n_uncovered} of 10,000 pixels are not covered");
}

fn all_shapes() -> [Shape; 6] {
    let built_in = |name, n_points, mesh| Shape { name, n_points, mesh, is_file: false };
    let file = |name, n_points, mesh| Shape { name, n_points, mesh, is_file: true };
    [
        built_in("cube", 20_000, |_| GroundTruth::from_mesh(&shapes::cube())),
        built_in("blob", 20_000, |_| GroundTruth::from_mesh(&shapes::blob())),
        built_in("low-poly", 20_000, |_| GroundTruth::from_mesh(&shapes::low_poly_blob())),
        built_in("head", 60_000, |_| GroundTruth::from_mesh(&shapes::head())),
        file("bunny", 40_000, |data| GroundTruth::from_file(&data.join("meshes/bun_zipper.ply"))),
        file("armadillo", 60_000, |data| {
            GroundTruth::from_file(&data.join("meshes/armadillo_26k.ply"))
        }),
    ]
}

/// Prints the table of all shapes.
pub fn compare_shapes(selection: &Selection) {
    const RESOLUTION: u32 = 512;
    let mut has_header = false;
    let data = shared_data();
    for shape in all_shapes() {
        let names = Sampling::ALL.map(|(name, sampling)| {
            let name = format!("{}-{name}", shape.name);
            (name, Some(sampling))
        });
        // The vertices of the bunny are a merged scan.
        let vertices = (format!("{}-vertices", shape.name), None);
        let names = names.into_iter().chain((shape.name == "bunny").then_some(vertices));
        let names: Vec<_> = names.filter(|(name, _)| selection.includes(name)).collect();
        let folder = match &data {
            _ if names.is_empty() => continue,
            None if shape.is_file => continue,
            folder => folder.as_deref().unwrap_or(Path::new("")),
        };
        if !has_header {
            print_header();
            has_header = true;
        }
        let mesh = (shape.mesh)(folder);
        let truth = Truth::new(&mesh, RESOLUTION);
        for (name, sampling) in names {
            let points = match sampling {
                Some(sampling) => sampling.sample(&mesh, shape.n_points, 1),
                None => mesh.vertices.clone(),
            };
            let spacing = mean_spacing(&mesh, points.len());
            let sample = Sample { name, cloud: PointCloud::from_positions(points), spacing };
            compare_sample(&sample, &truth, selection);
        }
    }
}

/// Compares all surfaces of a cloud, and its reconstruction, with its shape.
fn compare_sample(sample: &Sample, truth: &Truth, selection: &Selection) {
    reconstruction::write_cloud(selection, &sample.name, &sample.cloud);
    let mut images = vec![truth.lit.images().to_vec()];
    for (surface, kind) in &selection.kinds {
        images.push(compare_surface(sample, truth, surface, *kind));
    }
    images.extend(compare_reconstruction(sample, truth, selection));
    let first_views: Vec<&Image> = images.iter().map(|images| &images[0]).collect();
    pictures::write_strip(selection, &sample.name, &first_views);
}

/// Returns a cloud prepared by default, as users see it.
fn prepared(cloud: PointCloud, kind: SurfaceKind) -> CloudGeometry {
    scenes::prepared(cloud, &Preparation::default(), kind)
}

/// Prints the row of a surface and returns its lit pictures.
fn compare_surface(sample: &Sample, truth: &Truth, surface: &str, kind: SurfaceKind) -> Vec<Image> {
    let cloud = sample.cloud.clone();
    let begin = processor_secs();
    let points = prepared(cloud, kind);
    let flat = FlatCloud::new(&points, &NoProgress).unwrap();
    let prepare_secs = processor_secs() - begin;
    let begin = Instant::now();
    let hits = truth.views.trace(&flat);
    let trace_secs = begin.elapsed().as_secs_f64();
    let figures = truth.views.compare(&hits, sample.spacing);
    let images = truth.lit.render(Geometry::Points(points));
    let lit_psnr_db = truth.lit.compare(&images).psnr_db();
    print_row(&sample.name, &format!("`{surface}`"), &figures, lit_psnr_db, prepare_secs);
    eprintln!("{}, {surface}: {} rays traced in {trace_secs:.2} s", sample.name, hits.len());
    images
}

/// Prints the row of the mesh that another program made from the cloud, if there is one, and returns its lit pictures.
fn compare_reconstruction(
    sample: &Sample,
    truth: &Truth,
    selection: &Selection,
) -> Option<Vec<Image>> {
    let found = reconstruction::read(selection, &sample.name)?;
    let hits = truth.views.trace_mesh(&GroundTruth::from_smooth_mesh(&found.mesh));
    let figures = truth.views.compare(&hits, sample.spacing);
    let images = truth.lit.render(Geometry::Triangles(found.mesh));
    let lit_psnr_db = truth.lit.compare(&images).psnr_db();
    print_row(&sample.name, METHOD, &figures, lit_psnr_db, found.secs);
    Some(images)
}

fn print_header() {
    println!(
        "| cloud | surface | missing % | false % | depth, s | over 5 s, % | normals: mean, 95 % | \
         lit, dB | prepare, CPU s |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
}

fn print_row(cloud: &str, surface: &str, figures: &Deviation, lit_psnr_db: f64, prepare_secs: f64) {
    println!(
        "| {cloud} | {surface} | {:.3} | {:.3} | {:.3} | {:.2} | {:.1}°, {:.1}° | \
         {lit_psnr_db:.1} | {prepare_secs:.2} |",
        100.0 * figures.misses,
        100.0 * figures.false_hits,
        figures.depth_rms,
        100.0 * figures.far_off,
        figures.normal_deg,
        figures.normal_p95_deg,
    );
}

/// Prints how many pixels of a flat cloud show gaps.
pub fn cover_plane(selection: &Selection) {
    const N_POINTS: usize = 20_000;
    const RESOLUTION: u32 = 720;
    if !selection.includes("plane-random") {
        return;
    }
    println!("\n| cloud | surface | pixels | not fully covered |\n| --- | --- | --- | --- |");
    for (surface, kind) in &selection.kinds {
        let n_uncovered = n_uncovered_pixels(*kind, N_POINTS, RESOLUTION);
        let n_pixels = RESOLUTION * RESOLUTION;
        println!("| plane-random | `{surface}` | {n_pixels} | {n_uncovered} |");
    }
}

/// Counts the pixels of a flat square of random points, seen from above inside of its border, in which one of four
/// rays passes between the points.
fn n_uncovered_pixels(kind: SurfaceKind, n_points: usize, resolution: u32) -> usize {
    let mut random = Random::new(1, 0);
    let mut coordinate = || 2.0 * random.next_f32() - 1.0;
    let points = (0..n_points).map(|_| Vec3::new(coordinate(), coordinate(), 0.0)).collect();
    let points = prepared(PointCloud::from_positions(points), kind);
    let flat = FlatCloud::new(&points, &NoProgress).unwrap();
    // A margin of four spacings is left out.
    let height = 2.0 * (1.0 - 4.0 * 2.0 / (n_points as f64).sqrt());
    let view = scenes::from_above(height).view(DVec3::ZERO, resolution, resolution);
    let subpixels = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];
    let row_count = |y: u32| {
        let rays: Vec<Ray> = (0..resolution)
            .flat_map(|x| subpixels.map(|(dx, dy)| view.ray(x as f32 + dx, y as f32 + dy)))
            .collect();
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        trace::surface_hits(&flat, Simd::detect(), &rays, &mut hits);
        hits.chunks(4).filter(|hits| hits.iter().any(SurfaceHit::is_miss)).count()
    };
    (0..resolution).into_par_iter().map(row_count).sum()
}
