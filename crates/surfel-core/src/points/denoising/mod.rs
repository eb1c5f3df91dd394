//! Denoising: the noise of a cloud, the depth steps of a depth camera, and the points moved onto their surface or onto the axis
//! of their line.
//!
//! A file uses only those above it.

pub mod depth_steps;
pub mod flat_faces;
pub mod noise_at_point;
pub mod noise;
pub mod plants;
pub mod denoise;
pub mod line_axes;
