//! Normals: from planes and from cubics fitted to neighbours, and their orientation.
//!
//! A file uses only those above it.

pub mod planes;
pub mod jets;
pub mod outward_votes;
pub mod spanning_tree;
pub mod orient;
