//! Ray tracing of point clouds as continuous surfaces.
//!
//! From bare points to a lit picture:
//!
//! ```
//! use surfel::flat::FlatScene;
//! use surfel::math::Vec3;
//! use surfel::points::{PointCloud, Preparation, prepare};
//! use surfel::progress::Silent;
//! use surfel::render::{CpuRenderer, Renderer, Settings};
//! use surfel::scene::{
//!     Background, Framing, Geometry, Graph, Light, Material, Points, Scene, frame,
//! };
//! use surfel::trace::Simd;
//!
//! // A hill of 50 by 50 points; files are read by the crate `surfel-formats`.
//! let hill = |i: usize| {
//!     let (x, y) = ((i % 50) as f32 / 25.0 - 1.0, (i / 50) as f32 / 25.0 - 1.0);
//!     Vec3::new(x, y, 0.5 * (-2.0 * (x * x + y * y)).exp())
//! };
//! let cloud = PointCloud::from_positions((0..2500).map(hill).collect());
//!
//! // Normals and radii are added where they are missing.
//! let (cloud, _) = prepare(cloud, &Preparation::default(), &Silent)?;
//! let camera = frame(&cloud, &Framing::automatic(Vec3::Z, 4.0 / 3.0));
//! let colors = vec![[200, 180, 150]; cloud.len()];
//! let hill = Points { cloud, colors, ..Points::default() };
//! let scene = Scene {
//!     graph: Graph::of(Geometry::Points(hill), Material::PLASTIC),
//!     lights: vec![Light::Headlight(1.0)],
//!     background: Background::Transparent,
//!     camera,
//! };
//!
//! let settings = Settings {
//!     width: 64,
//!     height: 48,
//!     samples_per_pixel: 1,
//!     light_samples: 1,
//!     max_depth: 8,
//!     seed: 0,
//!     with_layers: false,
//! };
//! let flat = FlatScene::new(&scene, &Silent)?;
//! let (image, _) = CpuRenderer { simd: Simd::detect() }.render(&flat, &settings, &Silent)?;
//! assert_eq!(image.coverage[24 * 64 + 32], 1.0);
//! # Ok::<(), surfel::Error>(())
//! ```

pub mod math;
pub mod progress;
pub mod image;
pub mod points;
pub mod scanner;
pub mod bvh;
pub mod surface;
pub mod scene;
pub mod flat;
pub mod trace;
pub mod integrator;
pub mod render;

mod error;

pub use error::{Error, Result};
