//! Radii of points: from the distances of neighbours, from curvature, and from the lengths of normals; and how far they overlap.
//!
//! A file uses only those above it.

pub mod radius;
pub mod curvature;
pub mod normal_lengths;
pub mod overlap;
