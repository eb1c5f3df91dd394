//! Ray tracing of point clouds as continuous surfaces.

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
