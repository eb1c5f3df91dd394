//! The timed searches: a chunk of rays in, the data that a renderer would keep of each out.

use surfel_core::flat::FlatGeometry;
use surfel_core::math::{Ray, Vec3};
use surfel_core::trace::{self, Hit, Simd, Splat, SurfaceHit};

/// Maximum number of rays that a thread claims at a time.
pub const CHUNK: usize = 1024;

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Distance from the ray's origin; infinite without a hit.
    pub distance: f32,
    /// Index of the point in its cloud, or of the triangle in its mesh.
    id: u32,
}

impl Nearest {
    /// No hit.
    pub const MISS: Self = Self { distance: f32::INFINITY, id: u32::MAX };

    /// Returns true without a hit.
    pub fn is_miss(&self) -> bool {
        self.id == Self::MISS.id
    }
}

/// The blend of all discs near the first disc that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaded {
    /// Mean of the discs' normals, unit length; zero without a hit.
    normal: Vec3,
    /// Number of discs.
    pub n_discs: f32,
}

impl Shaded {
    /// No disc.
    pub const EMPTY: Self = Self { normal: Vec3::ZERO, n_discs: 0.0 };
}

/// Finds the nearest hits, with everything that shading needs.
pub fn closest(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], hits: &mut [Hit]) {
    match geometry {
        FlatGeometry::Cloud(cloud) => trace::closest_hits(cloud, simd, rays, hits),
        FlatGeometry::Mesh(mesh) => trace::closest_triangles(&mesh.triangles, simd, rays, hits),
    }
}

/// Finds out whether rays hit anything.
pub fn any(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    match geometry {
        FlatGeometry::Cloud(cloud) => trace::any_hits(cloud, simd, rays, occluded),
        FlatGeometry::Mesh(mesh) => trace::any_triangles(&mesh.triangles, simd, rays, occluded),
    }
}

/// Finds distance and index of the nearest hits.
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

/// Finds distance and index of the finished surface, with its edge test.
pub fn surface(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], found: &mut [Nearest]) {
    let FlatGeometry::Cloud(cloud) = geometry else { return nearest(geometry, simd, rays, found) };
    let mut hits = [SurfaceHit::MISS; CHUNK];
    let hits = &mut hits[..rays.len()];
    trace::surface_hits(cloud, simd, rays, hits);
    for (found, hit) in found.iter_mut().zip(hits) {
        *found = Nearest { distance: hit.distance, id: hit.id };
    }
}

/// Gathers discs and averages their normals as `splat` does: each flipped to the side of the nearest one, weighted by
/// the distance from the ray.
pub fn gather(geometry: &FlatGeometry, simd: Simd, rays: &[Ray], found: &mut [Shaded]) {
    let FlatGeometry::Cloud(cloud) = geometry else { return found.fill(Shaded::EMPTY) };
    let mut splats = [Splat::MISS; CHUNK];
    let splats = &mut splats[..rays.len()];
    trace::splats(cloud, simd, rays, splats);
    for (found, splat) in found.iter_mut().zip(splats) {
        *found = Shaded { normal: splat.normal, n_discs: splat.n_discs as f32 };
    }
}
