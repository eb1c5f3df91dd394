//! The up axis of clouds whose file does not state it.
//!
//! - `inferred_up` and `sample`: the answer, and the points that are looked at;
//! - `axis_statistics`: floors, flat bases and terrain, by the points near the ends of each axis;
//! - `mirror_symmetry`: the axis along which an object is its own mirror image;
//! - `camera_axes`: the axes of a depth camera, by the field of view that its points fill;
//! - `infer_up`: the choice between them and the convention of a file's format.
//!
//! A file uses only those above it.

mod inferred_up;
mod sample;
mod axis_statistics;
mod mirror_symmetry;
mod camera_axes;
mod infer_up;

pub(crate) use camera_axes::CameraAxes;
pub use infer_up::{UpConvention, infer_up};
pub(crate) use infer_up::{is_mostly_land, is_terrain};
pub use inferred_up::InferredUp;
