//! Ray tracing of point clouds as continuous surfaces.

pub mod math;
pub mod progress;
pub mod image;
pub mod points;
pub mod scanner;

mod error;

pub use error::{Error, Result};
