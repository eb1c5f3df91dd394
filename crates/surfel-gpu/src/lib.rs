//! Renders the flat scenes of [`surfel_core`] on a GPU, by kernels in WGSL that are twins of its Rust.
//!
//! [`GpuRenderer`] is a [`Renderer`](surfel_core::render::Renderer) like the CPU's and draws the same pictures up to
//! rounding. What it cannot draw it refuses, with the reasons that [`unsupported`] lists:
//!
//! ```
//! use surfel_core::flat::FlatScene;
//! use surfel_core::math::DVec3;
//! use surfel_core::progress::NoProgress;
//! use surfel_core::render::{Renderer, Settings};
//! use surfel_core::scene::{Background, Camera, Graph, Projection, Scene};
//! use surfel_gpu::GpuRenderer;
//!
//! let camera = Camera {
//!     position: DVec3::ZERO,
//!     focal_point: DVec3::Y,
//!     view_up: DVec3::Z,
//!     projection: Projection::Panorama,
//! };
//! let scene = Scene {
//!     graph: Graph::default(),
//!     lights: Vec::new(),
//!     background: Background::Transparent,
//!     camera,
//! };
//! let flat = FlatScene::new(&scene, &NoProgress)?;
//! let settings = Settings { width: 8, height: 4, ..Settings::default() };
//! match GpuRenderer::open(None) {
//!     Ok(renderer) => {
//!         let (image, _) = renderer.render(&flat, &settings, &NoProgress)?;
//!         assert_eq!(image.coverage, [0.0; 32]);
//!     }
//!     Err(error) => println!("{error}"),
//! }
//! # Ok::<(), surfel_core::Error>(())
//! ```

mod error;
pub mod numbers;
pub mod records;
mod payload;
mod field_arrays;
mod constants;
mod surface;
pub mod shader;
mod device;
mod kernels;
mod unsupported;
mod mesh_blocks;
mod gaussian_arrays;
mod threads;
mod transfer;
mod upload;
mod scene_records;
mod search;
mod scene_words;
mod pixel_order;
mod part_size;
mod readback;
mod wavefront;
mod tree_visits;
mod passes;
mod kernel_times;
mod submitter;
mod aovs;
mod picture_memory;
mod job;
mod ray_timing;
mod renderer;
#[cfg(test)]
mod test_support;

pub use device::{DeviceInfo, DeviceKind, devices};
pub use error::{Error, Result};
pub use kernel_times::KernelTime;
pub use ray_timing::{RayTimes, TimedQuery, Timing};
pub use renderer::GpuRenderer;
pub use unsupported::unsupported;
pub use upload::UploadTime;
