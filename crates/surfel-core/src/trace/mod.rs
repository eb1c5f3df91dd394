//! Queries of rays, in batches, against a cloud, a mesh or a whole scene: closest hit, any hit, gather.
//!
//! `simd` has the SIMD levels, `traversal` the ways through a tree, `query` the questions about one cloud or
//! mesh, and `scene` those about a scene of instances. Each folder uses only those above it, and so does each
//! file of a folder.

mod counts;
mod simd;
mod traversal;
mod query;
mod scene;
mod tracer;
pub mod constants;

pub use counts::{Counted, take_counts};
pub use query::any::{any_hits, any_triangles};
pub use query::closest::{closest_hits, closest_triangles};
pub use query::gather::gathers;
pub use query::gaussian_light::GaussianLight;
pub use query::hit::{Gather, Hit};
pub use query::splat_query::{Splat, splats};
pub use query::support::Support;
pub use query::surface::{occlusions, surface_hits, surface_hits_at};
pub use query::surface_hit::SurfaceHit;
pub use scene::instance_filter::InstanceFilter;
pub use scene::scene_gaussians::scene_gaussians;
pub use scene::scene_hit::SceneHit;
pub use scene::scene_query::{scene_hits, scene_occlusions};
pub use scene::scene_support::scene_supports;
pub use simd::Simd;
pub use tracer::Tracer;
pub use traversal::octree_walk::PixelSize;
