//! The device that tests run on, and a scene without anything.

use crate::device::Gpu;
use crate::error::Result;
use crate::renderer::GpuRenderer;
use surfel_core::flat::FlatScene;
use surfel_core::math::DVec3;
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Background, Camera, Graph, Projection, Scene};

/// Opens the first device, or the one that the variable `SURFEL_DEVICE` names. Without one the test says that it is skipped.
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
        Err(error) => {
            report_skipped(&error.to_string());
            None
        }
    }
}

/// Says why a test does nothing.
#[expect(clippy::print_stdout, reason = "a test that does nothing says so")]
pub fn report_skipped(reason: &str) {
    println!("skipped: {reason}");
}

/// Returns a scene of nothing but a camera.
pub fn empty_scene() -> FlatScene {
    let camera = Camera {
        position: DVec3::ZERO,
        focal_point: DVec3::Y,
        view_up: DVec3::Z,
        projection: Projection::Panorama,
    };
    let (graph, background) = (Graph::default(), Background::Transparent);
    let scene = Scene { graph, lights: Vec::new(), background, camera };
    FlatScene::new(&scene, &NoProgress).unwrap()
}
