//! Cleaning: invalid and duplicate points, subsampling, and outliers.
//!
//! A file uses only those above it.

pub mod clean_options;
pub mod clean;
pub mod subsample;
pub mod outliers;
