//! Queries of rays against a whole scene: each ray goes from instance to instance.
//!
//! A file uses only those above it.

pub mod instance_filter;
pub mod box_entries;
pub mod tlas;
pub mod scheduler;
pub mod scene_hit;
pub mod scene_query;
pub mod scene_support;
pub mod scene_gaussians;
