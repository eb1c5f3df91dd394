//! Queries of rays against one cloud or one mesh: closest hit, any hit, gathered discs, the blended
//! surface, and the points that support its hits.
//!
//! A file uses only those above it.

pub mod hit;
pub mod leaf;
pub mod closest;
pub mod any;
pub mod packet_disc_hits;
pub mod plane_fit;
pub mod gather;
pub mod edge_test;
pub mod edge_filter;
pub mod smooth_query;
pub mod smooth_filter;
pub mod searching_rays;
pub mod point_lists;
pub mod mls_query;
pub mod mls_surface;
pub mod splat_query;
pub mod ray_field;
pub mod packet_field;
pub mod field_query;
pub mod octree_query;
pub mod gaussian_buffer;
pub mod gaussian_query;
pub mod gaussian_light;
pub mod support;
pub mod surface_hit;
pub mod gaussian_hits;
pub mod smooth_hits;
pub mod surface;
