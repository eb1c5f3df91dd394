//! What is timed: a chunk of rays in, what a renderer would keep of each out.

use surfel::flat::FlatScene;
use surfel::math::{Ray, Vec3};
use surfel::trace::{self, Hit, Simd, Splat, SurfaceHit};

/// Rays that a thread claims at a time, at most.
pub const CHUNK: usize = 1024;

/// Of a ray's nearest hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    pub distance: f32,
    /// Index of the point in its cloud.
    id: u32,
}

impl Nearest {
    pub const MISS: Self = Self { distance: f32::INFINITY, id: u32::MAX };

    pub fn is_miss(&self) -> bool {
        self.id == Self::MISS.id
    }
}

/// Of all discs near a ray's first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaded {
    /// Averaged, unit; zero if nothing was hit.
    normal: Vec3,
    pub n_discs: f32,
}

impl Shaded {
    pub const EMPTY: Self = Self { normal: Vec3::ZERO, n_discs: 0.0 };
}

pub fn nearest(scene: &FlatScene, simd: Simd, rays: &[Ray], found: &mut [Nearest]) {
    let mut hits = [Hit::MISS; CHUNK];
    let hits = &mut hits[..rays.len()];
    trace::closest_hits(scene, simd, rays, hits);
    for (found, hit) in found.iter_mut().zip(hits) {
        let id = if *hit == Hit::MISS { Nearest::MISS.id } else { scene.points.id(hit.slot) };
        *found = Nearest { distance: hit.distance, id };
    }
}

pub fn surface(scene: &FlatScene, simd: Simd, rays: &[Ray], found: &mut [Nearest]) {
    let mut hits = [SurfaceHit::MISS; CHUNK];
    let hits = &mut hits[..rays.len()];
    trace::surface_hits(scene, simd, rays, hits);
    for (found, hit) in found.iter_mut().zip(hits) {
        *found = Nearest { distance: hit.distance, id: hit.id };
    }
}

/// The discs' normals are averaged as `splat` does: each turned with the nearest one, by their nearness to
/// the ray.
pub fn gather(scene: &FlatScene, simd: Simd, rays: &[Ray], found: &mut [Shaded]) {
    let mut splats = [Splat::MISS; CHUNK];
    let splats = &mut splats[..rays.len()];
    trace::splats(scene, simd, rays, splats);
    for (found, splat) in found.iter_mut().zip(splats) {
        *found = Shaded { normal: splat.normal, n_discs: splat.n_discs as f32 };
    }
}
