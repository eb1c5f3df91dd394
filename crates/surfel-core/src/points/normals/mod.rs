//! Normals: from planes and from cubics fitted to neighbours, and their orientation.
//!
//! A file uses only those above it.

pub mod planes;
pub mod jets;
pub mod spanning_tree;
pub mod orient;
