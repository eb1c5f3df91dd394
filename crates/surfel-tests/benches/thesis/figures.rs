//! The figures of the thesis with other clouds, and a picture of each kind.

use super::clouds::{self, Subject};
use super::timing::{scene, settings};
use std::path::Path;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::math::Vec3;
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{Background, Geometry, Scene};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_formats::{Alpha, ImageOptions, save_image};

/// Width and height of each picture.
const SIZE: u32 = 320;

/// Writes the figures that rays make, each as `figure-NN.jpg`.
pub fn write_figures(folder: &Path) {
    let (head, ruin) = (clouds::head(), clouds::ruin_scan());
    let bunny = clouds::bunny().unwrap_or_else(|| {
        eprintln!("figures: the head stands for the bunny, whose file is not there");
        head.clone()
    });
    let random = bunny.with_random_signs();
    let cube = clouds::coarse_cube().with_random_signs();
    let figures = [
        (1, &head, SurfaceKind::Points),
        (2, &head, SurfaceKind::Sphere),
        (3, &ruin, SurfaceKind::Sphere),
        (5, &bunny, SurfaceKind::Disc),
        (6, &head, SurfaceKind::Disc),
        (7, &random, SurfaceKind::SplatMean),
        (8, &cube, SurfaceKind::SplatMean),
        (9, &random, SurfaceKind::Splat),
        (10, &cube, SurfaceKind::Splat),
        (12, &bunny, SurfaceKind::SplatFit),
        (13, &head, SurfaceKind::SplatFit),
    ];
    for (number, subject, kind) in figures {
        let mut scene = scene(subject, kind);
        let is_unlit = kind == SurfaceKind::Points;
        scene.graph.materials.iter_mut().for_each(|material| material.is_unlit = is_unlit);
        save(folder, &format!("figure-{number:02}"), &picture(&scene));
    }
    let mut without_distance = scene(&bunny, SurfaceKind::Disc);
    let clouds = without_distance.graph.geometries.iter_mut();
    for geometry in clouds {
        if let Geometry::Points(cloud) = geometry {
            cloud.options.min_distance = Some(0.0);
        }
    }
    save(folder, "figure-04", &picture(&without_distance));
}

/// Writes a picture of each kind, as `kind-NAME.jpg`.
pub fn write_kinds(folder: &Path, subject: &Subject) {
    let kinds = SurfaceKind::ALL.into_iter().filter(|(_, kind)| *kind != SurfaceKind::Gaussian);
    for (name, kind) in kinds {
        save(folder, &format!("kind-{name}"), &picture(&scene(subject, kind)));
    }
}

fn picture(scene: &Scene) -> Image {
    let mut flat = FlatScene::new(scene, &NoProgress).unwrap();
    flat.background = Background::Gradient { top: Vec3::ONE, bottom: Vec3::ONE };
    let settings = Settings { samples_per_pixel: 4, ..settings(SIZE) };
    let (image, _) =
        CpuRenderer { simd: Simd::detect() }.render(&flat, &settings, &NoProgress).unwrap();
    let covered: f32 = image.coverage.iter().sum();
    assert!(0.1 < covered / (SIZE * SIZE) as f32, "nothing is seen");
    image
}

fn save(folder: &Path, name: &str, image: &Image) {
    let options = ImageOptions { alpha: Alpha::Drop, ..ImageOptions::default() };
    save_image(&folder.join(format!("{name}.jpg")), image, &options).unwrap();
}
