//! Rays in batches against a cloud, a mesh or a whole scene: closest hit, any hit, gather; SIMD lives here.

mod any;
mod batch;
mod block;
mod boxes;
mod boundary;
mod closest;
mod flight;
mod frustum;
mod gather;
mod group;
mod hit;
mod memory;
mod node;
mod packet;
mod region;
mod rounds;
mod sightings;
mod simd;
mod sparse;
mod splat;
mod surface;
mod tracer;
mod world;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

pub use hit::{Gather, Hit};
pub use simd::Simd;
pub use splat::Splat;
pub use surface::SurfaceHit;
pub use tracer::Tracer;
pub use world::{SceneHit, Which, scene_hits, scene_occlusions};

use crate::flat::{FlatCloud, FlatTriangles};
use crate::math::{Aabb, PortableLanes, Ray};
use boxes::Entries;
use simd::Level;

/// Runs a batch kernel at a SIMD level; every level gives the same bytes.
macro_rules! at_level {
    ($simd:expr, $module:ident::$kernel:ident($($argument:expr),*)) => {
        match $simd.level() {
            Level::Portable => $module::$kernel::<PortableLanes>($($argument),*),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a `Simd` of this level exists only where the processor has it.
            Level::Avx2 => unsafe { avx2::$kernel($($argument),*) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Level::Avx512 => unsafe { avx512::$kernel($($argument),*) },
        }
    };
}

/// The nearest shape on each ray, each point on its own.
pub fn closest_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], hits: &mut [Hit]) {
    if cloud.points.nodes.is_empty() {
        return hits.fill(Hit::MISS);
    }
    at_level!(simd, closest::closest_hits(cloud, rays, hits));
}

/// Whether any shape lies in each ray's range, each point on its own.
pub fn any_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.points.nodes.is_empty() {
        return occluded.fill(false);
    }
    at_level!(simd, any::any_hits(cloud, rays, occluded));
}

/// The nearest shapes on each ray, all within a radius of each other.
pub fn gathers(cloud: &FlatCloud, simd: Simd, rays: &[Ray], gathers: &mut [Gather]) {
    if cloud.points.nodes.is_empty() {
        return gathers.fill(Gather::EMPTY);
    }
    at_level!(simd, gather::gathers(cloud, rays, gathers));
}

/// The discs of `gathers` blended as the cloud's surface asks for, or else as `splat`; no regard is paid
/// to the surface's boundary.
pub fn splats(cloud: &FlatCloud, simd: Simd, rays: &[Ray], splats: &mut [Splat]) {
    if cloud.points.nodes.is_empty() {
        return splats.fill(Splat::MISS);
    }
    at_level!(simd, splat::splats(cloud, rays, splats));
}

/// The nearest place of the continuous surface on each ray.
pub fn surface_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], hits: &mut [SurfaceHit]) {
    if cloud.points.nodes.is_empty() {
        return hits.fill(SurfaceHit::MISS);
    }
    at_level!(simd, surface::surface_hits(cloud, rays, hits));
}

/// Whether the continuous surface lies in each ray's range.
pub fn occlusions(cloud: &FlatCloud, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.points.nodes.is_empty() {
        return occluded.fill(false);
    }
    at_level!(simd, surface::occlusions(cloud, rays, occluded));
}

/// Where rays enter boxes, by rows of sixteen rays: all boxes of one row after those of another.
fn box_entries(boxes: &[Aabb], simd: Simd, rays: &[Ray], entries: &mut [Entries]) {
    at_level!(simd, boxes::box_entries(boxes, rays, entries));
}

/// The nearest triangle on each ray.
pub fn closest_triangles(triangles: &FlatTriangles, simd: Simd, rays: &[Ray], hits: &mut [Hit]) {
    if triangles.nodes.is_empty() {
        return hits.fill(Hit::MISS);
    }
    at_level!(simd, closest::closest_triangles(triangles, rays, hits));
}

/// Whether any triangle lies in each ray's range.
pub fn any_triangles(triangles: &FlatTriangles, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if triangles.nodes.is_empty() {
        return occluded.fill(false);
    }
    at_level!(simd, any::any_triangles(triangles, rays, occluded));
}
