//! Renders a cloud that never was a file, beside a mirror: the renderer's own types, without a description.
//!
//! `cargo run --release -p surfel --example cloud_from_memory -- mirror.png`
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example prints what it does")]

use surfel_core::flat::FlatScene;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{PointCloud, Preparation, prepare};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Background, CameraFit, CloudGeometry, Geometry, Graph, Light, Material, Node, Primitive, Scene,
    Transform, fit_camera,
};
use surfel_core::trace::Simd;
use surfel_formats::{ImageOptions, save_image};

fn main() -> surfel::Result<()> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "mirror.png".into());

    // Points of the unit sphere, on a spiral that keeps them evenly apart.
    let ball = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f32 / 20_000.0;
        let (sin, cos) = (2.399_963 * i as f32).sin_cos();
        Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    };
    let cloud = PointCloud::from_positions((0..20_000).map(ball).collect());
    let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress)?;
    let camera = fit_camera(&cloud, &CameraFit { zoom: 0.5, ..CameraFit::default() });

    // The same points twice: once in colour, once as a mirror beside it.
    let geometry = CloudGeometry::with_uniform_color(cloud, [205, 120, 60]);
    let mut graph = Graph::from_geometry(Geometry::Points(geometry), Material::PLASTIC);
    graph.materials.push(Material::MIRROR);
    graph.add_node(Node {
        transform: Transform::from_translation(DVec3::new(2.2, 0.0, 0.0)),
        primitives: vec![Primitive { geometry: 0, material: 1 }],
        ..Node::new("mirror")
    });
    let background = Background::Gradient { top: Vec3::splat(0.2), bottom: Vec3::splat(0.8) };
    let scene = Scene { graph, lights: vec![Light::Headlight(0.8)], background, camera };

    let flat = FlatScene::new(&scene, &NoProgress)?;
    let settings = Settings { width: 960, height: 540, ..Settings::default() };
    let renderer = CpuRenderer { simd: Simd::detect() };
    let (image, _) = renderer.render(&flat, &settings, &NoProgress)?;
    Ok(save_image(output.as_ref(), &image, &ImageOptions::default())?)
}
