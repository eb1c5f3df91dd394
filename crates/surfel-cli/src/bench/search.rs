//! What is timed: a chunk of rays in, what a renderer would keep of each out.

use surfel::flat::FlatScene;
use surfel::math::{Ray, Vec3};
use surfel::trace::{self, Gather, Hit, Simd, SurfaceHit};

/// Rays that a thread claims at a time, at most.
pub const CHUNK: usize = 1024;
/// Gathers are large: this many stay near the processor until they are shaded.
const GATHERS: usize = 256;

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

pub fn gather(scene: &FlatScene, simd: Simd, rays: &[Ray], found: &mut [Shaded]) {
    let mut gathers = [Gather::EMPTY; GATHERS];
    for (rays, found) in rays.chunks(GATHERS).zip(found.chunks_mut(GATHERS)) {
        let gathers = &mut gathers[..rays.len()];
        trace::gathers(scene, simd, rays, gathers);
        for ((found, ray), gather) in found.iter_mut().zip(rays).zip(gathers) {
            *found = shade(scene, ray, gather.hits());
        }
    }
}

/// The mean of the discs' normals, each turned toward the ray's origin, by their nearness to the ray.
fn shade(scene: &FlatScene, ray: &Ray, hits: &[Hit]) -> Shaded {
    let mut sum = Vec3::ZERO;
    for hit in hits {
        let normal = scene.points.normal(hit.slot);
        let offset = ray.at(hit.distance) - scene.points.center(hit.slot);
        let weight = 1.0 - offset.length() / scene.points.radius(hit.slot);
        // A hit on the rim counts a little, so that a sum of only such has a direction.
        let weight = if weight <= 0.0 { 1e-6 } else { weight };
        sum += normal * if 0.0 < normal.dot(ray.direction) { -weight } else { weight };
    }
    Shaded { normal: sum.normalize_or_zero(), n_discs: hits.len() as f32 }
}
