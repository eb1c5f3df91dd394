//! The rays of scanners: the grids of stations, the rings of spinning scanners, the scan angles of airborne ones.
//!
//! A file uses only those above it.

pub mod scan_grid;
pub mod grid_rays;
pub mod mixed_pixels;
pub mod scan_angle;
pub mod scan_rings;
