//! The device that tests run on, and small scenes.

use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::renderer::GpuRenderer;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use surfel_core::flat::FlatScene;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{PointCloud, Preparation, StructureChoice, prepare};
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::scene::{
    Background, Camera, CloudGeometry, Geometry, Graph, Material, Projection, Scene,
};
use surfel_core::surface::SurfaceKind;

/// Opens the first device, or the one that the variable `SURFEL_DEVICE` names. On a machine without devices the test says
/// that it is skipped; every other failure is one of the test.
pub fn open_gpu() -> Option<Gpu> {
    found(|device| Gpu::open(device, u64::MAX))
}

/// Opens the renderer of the device that [`open_gpu`] opens.
pub fn open_renderer() -> Option<GpuRenderer> {
    found(GpuRenderer::open)
}

fn found<T>(open: impl FnOnce(Option<&str>) -> Result<T>) -> Option<T> {
    match open(std::env::var("SURFEL_DEVICE").ok().as_deref()) {
        Ok(opened) => Some(opened),
        Err(error @ Error::NoDevice) => {
            report_skipped(&error.to_string());
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Says why a test does nothing.
#[expect(clippy::print_stdout, reason = "a test that does nothing says so")]
pub fn report_skipped(reason: &str) {
    println!("skipped: {reason}");
}

/// Counts how often the work asks whether to stop before its first stage, and cancels it there after `n_max` times.
pub struct CancelledAfter {
    n_max: u32,
    n_asked: AtomicU32,
    has_begun: AtomicBool,
}

impl CancelledAfter {
    /// Lets the work ask `n_max` times.
    pub fn new(n_max: u32) -> Self {
        Self { n_max, n_asked: AtomicU32::new(0), has_begun: AtomicBool::new(false) }
    }

    /// Returns how often the work has asked.
    pub fn n_asked(&self) -> u32 {
        self.n_asked.load(Ordering::Relaxed)
    }
}

impl Progress for CancelledAfter {
    fn begin(&self, _: &str, _: u64) {
        self.has_begun.store(true, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        !self.has_begun.load(Ordering::Relaxed)
            && self.n_max <= self.n_asked.fetch_add(1, Ordering::Relaxed)
    }
}

/// Returns a scene of nothing but a camera.
pub fn empty_scene() -> FlatScene {
    scene_of(Graph::default())
}

/// Returns a scene of 400 points with this surface.
pub fn scene_of_points(surface: SurfaceKind) -> FlatScene {
    scene_of_prepared(surface, &Preparation::default(), Material::MATTE)
}

/// Returns the scene of [`scene_of_points`] without normals, lines and scatter.
pub fn scene_of_points_without_normals(surface: SurfaceKind) -> FlatScene {
    let preparation = Preparation { estimates_normals: false, ..one_surface() };
    scene_of_prepared(surface, &preparation, Material::MATTE)
}

/// Returns the scene of [`scene_of_points`] without lines and scatter, of points that emit this radiance.
pub fn scene_of_lit_points(surface: SurfaceKind, emissive: Vec3) -> FlatScene {
    let material = Material { emissive, ..Material::MATTE };
    scene_of_prepared(surface, &one_surface(), material)
}

/// Returns settings by which all points form a surface.
fn one_surface() -> Preparation {
    Preparation { structure: StructureChoice::Surface, ..Preparation::default() }
}

fn scene_of_prepared(
    surface: SurfaceKind,
    preparation: &Preparation,
    material: Material,
) -> FlatScene {
    let position = |i: u16| {
        let (x, y) = (f32::from(i % 20), f32::from(i / 20));
        Vec3::new(x, y, (x * y).sin())
    };
    let cloud = PointCloud::from_positions((0..400).map(position).collect());
    let (cloud, _) = prepare(cloud, preparation, &NoProgress).unwrap();
    let mut points = CloudGeometry::with_uniform_color(cloud, [200; 3]);
    points.surface = surface;
    scene_of(Graph::from_geometry(Geometry::Points(points), material))
}

fn scene_of(graph: Graph) -> FlatScene {
    let camera = Camera {
        position: DVec3::ZERO,
        focal_point: DVec3::Y,
        view_up: DVec3::Z,
        projection: Projection::Panorama,
    };
    let background = Background::Transparent;
    let scene = Scene { graph, lights: Vec::new(), background, camera };
    FlatScene::new(&scene, &NoProgress).unwrap()
}
