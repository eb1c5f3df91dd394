//! What is timed: a chunk of rays in, what a renderer would keep of each out.

use surfel::flat::FlatGeometry;
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

pub fn closest(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], hits: &mut [Hit]) {
    match geometry {
        FlatGeometry::Cloud(cloud) => trace::closest_hits(cloud, simd, rays, hits),
        FlatGeometry::Mesh(mesh) => trace::closest_triangles(&mesh.triangles, simd, rays, hits),
    }
}

pub fn any(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    match geometry {
        FlatGeometry::Cloud(cloud) => trace::any_hits(cloud, simd, rays, occluded),
        FlatGeometry::Mesh(mesh) => trace::any_triangles(&mesh.triangles, simd, rays, occluded),
    }
}

pub fn nearest(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], found: &mut [Nearest]) {
    let mut hits = [Hit::MISS; CHUNK];
    let hits = &mut hits[..rays.len()];
    closest(geometry, simd, rays, hits);
    for (found, hit) in found.iter_mut().zip(hits) {
        let id = match geometry {
            _ if hit.is_miss() => Nearest::MISS.id,
            FlatGeometry::Cloud(cloud) => cloud.points.id(hit.slot),
            FlatGeometry::Mesh(mesh) => mesh.triangles.id(hit.slot),
        };
        *found = Nearest { distance: hit.distance, id };
    }
}

pub fn surface(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], found: &mut [Nearest]) {
    let FlatGeometry::Cloud(cloud) = geometry else { return nearest(geometry, simd, rays, found) };
    let mut hits = [SurfaceHit::MISS; CHUNK];
    let hits = &mut hits[..rays.len()];
    trace::surface_hits(cloud, simd, rays, hits);
    for (found, hit) in found.iter_mut().zip(hits) {
        *found = Nearest { distance: hit.distance, id: hit.id };
    }
}

/// The discs' normals are averaged as `splat` does: each turned with the nearest one, by their nearness to
/// the ray.
pub fn gather(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], found: &mut [Shaded]) {
    let FlatGeometry::Cloud(cloud) = geometry else { return found.fill(Shaded::EMPTY) };
    let mut splats = [Splat::MISS; CHUNK];
    let splats = &mut splats[..rays.len()];
    trace::splats(cloud, simd, rays, splats);
    for (found, splat) in found.iter_mut().zip(splats) {
        *found = Shaded { normal: splat.normal, n_discs: splat.n_discs as f32 };
    }
}
