//! Point clouds as columns, the columns that have a meaning, conditions on them, and merging.
//!
//! A file uses only those above it.

pub mod deformation;
pub mod scan_station;
pub mod kept_points;
pub mod point_cloud;
pub mod color_bits;
pub mod flags;
pub mod known_column;
pub mod gaussians;
mod transform;
pub mod filter;
pub mod merge;
pub mod density;
