//! Denoising: the noise of a cloud, and the points moved onto their surface or onto the axis of their line; those of a depth
//! camera in its image first.
//!
//! A file uses only those above it.

pub mod depth_sensor;
pub mod disparity_plane;
pub mod depth_image;
pub mod flat_faces;
pub mod noise_at_point;
pub mod noise;
pub mod plants;
pub mod bilateral_normals;
pub mod denoise;
pub mod line_axes;
