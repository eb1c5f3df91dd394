//! Rays in batches against a flat scene: closest hit, any hit, gather; SIMD lives here.

mod any;
mod block;
mod boundary;
mod closest;
mod flight;
mod frustum;
mod gather;
mod hit;
mod memory;
mod node;
mod packet;
mod region;
mod sightings;
mod simd;
mod splat;
mod surface;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

pub use hit::{Gather, Hit};
pub use simd::Simd;
pub use splat::Splat;
pub use surface::SurfaceHit;

use crate::flat::FlatScene;
use crate::math::{PortableLanes, Ray};
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
pub fn closest_hits(scene: &FlatScene, simd: Simd, rays: &[Ray], hits: &mut [Hit]) {
    if scene.points.nodes.is_empty() {
        return hits.fill(Hit::MISS);
    }
    at_level!(simd, closest::closest_hits(scene, rays, hits));
}

/// Whether any shape lies in each ray's range, each point on its own.
pub fn any_hits(scene: &FlatScene, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if scene.points.nodes.is_empty() {
        return occluded.fill(false);
    }
    at_level!(simd, any::any_hits(scene, rays, occluded));
}

/// The nearest shapes on each ray, all within a radius of each other.
pub fn gathers(scene: &FlatScene, simd: Simd, rays: &[Ray], gathers: &mut [Gather]) {
    if scene.points.nodes.is_empty() {
        return gathers.fill(Gather::EMPTY);
    }
    at_level!(simd, gather::gathers(scene, rays, gathers));
}

/// The discs of `gathers` blended as the scene's surface asks for, or else as `splat`; no regard is paid
/// to the surface's boundary.
pub fn splats(scene: &FlatScene, simd: Simd, rays: &[Ray], splats: &mut [Splat]) {
    if scene.points.nodes.is_empty() {
        return splats.fill(Splat::MISS);
    }
    at_level!(simd, splat::splats(scene, rays, splats));
}

/// The nearest place of the continuous surface on each ray.
pub fn surface_hits(scene: &FlatScene, simd: Simd, rays: &[Ray], hits: &mut [SurfaceHit]) {
    if scene.points.nodes.is_empty() {
        return hits.fill(SurfaceHit::MISS);
    }
    at_level!(simd, surface::surface_hits(scene, rays, hits));
}

/// Whether the continuous surface lies in each ray's range.
pub fn occlusions(scene: &FlatScene, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if scene.points.nodes.is_empty() {
        return occluded.fill(false);
    }
    at_level!(simd, surface::occlusions(scene, rays, occluded));
}
