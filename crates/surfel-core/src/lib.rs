//! Ray tracing of point clouds as continuous surfaces.
//!
//! This example renders a lit picture of bare points:
//!
//! ```
//! use surfel_core::flat::FlatScene;
//! use surfel_core::math::Vec3;
//! use surfel_core::points::{PointCloud, Preparation, prepare};
//! use surfel_core::progress::NoProgress;
//! use surfel_core::render::{CpuRenderer, Renderer, Settings};
//! use surfel_core::scene::{
//!     Background, CameraFit, CloudGeometry, Geometry, Graph, Light, Material, Scene, fit_camera,
//! };
//! use surfel_core::trace::Simd;
//!
//! // A hill of 50 by 50 points. The crate `surfel-formats` reads clouds from files.
//! let hill = |i: usize| {
//!     let (x, y) = ((i % 50) as f32 / 25.0 - 1.0, (i / 50) as f32 / 25.0 - 1.0);
//!     Vec3::new(x, y, 0.5 * (-2.0 * (x * x + y * y)).exp())
//! };
//! let cloud = PointCloud::from_positions((0..2500).map(hill).collect());
//!
//! // Preparation adds the normals and radii that are missing.
//! let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress)?;
//! let camera = fit_camera(&cloud, &CameraFit { aspect: 4.0 / 3.0, ..CameraFit::default() });
//! let hill = CloudGeometry::with_uniform_color(cloud, [200, 180, 150]);
//! let scene = Scene {
//!     graph: Graph::from_geometry(Geometry::Points(hill), Material::PLASTIC),
//!     lights: vec![Light::Headlight(1.0)],
//!     background: Background::Transparent,
//!     camera,
//! };
//!
//! let settings = Settings { width: 64, height: 48, ..Settings::default() };
//! let flat = FlatScene::new(&scene, &NoProgress)?;
//! let (image, _) = CpuRenderer { simd: Simd::detect() }.render(&flat, &settings, &NoProgress)?;
//! assert_eq!(image.coverage[24 * 64 + 32], 1.0);
//! # Ok::<(), surfel_core::Error>(())
//! ```

pub mod bytes;
pub mod words;
mod error;
pub mod math;
pub mod progress;
pub mod locks;
pub mod image;
pub mod points;
pub mod bvh;
pub mod surface;
pub mod scene;
pub mod flat;
pub mod trace;
pub mod integrator;
pub mod render;

pub use error::{Error, Result};
