//! The continuous surface of a cloud: blended discs without the hits that the edge test rejects, or spheres.

use crate::flat::FlatCloud;
use crate::math::{Lanes, Ray, Vec3};
use crate::surface::{Disc, EdgeTest};
use crate::trace::query::any::{any_accepted_hit, any_hits_kernel};
use crate::trace::query::closest::closest_hits_kernel;
use crate::trace::query::edge_filter::EdgeFilter;
use crate::trace::query::hit::Hit;
use crate::trace::query::splat_query::{Splat, SplatTracer};
use crate::trace::simd::{Simd, dispatch_simd};

/// The hit of a ray on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Distance along the ray, infinite if nothing was hit.
    pub distance: f32,
    /// Index of the nearest point in its cloud.
    pub id: u32,
    /// Radius of that point, in object space.
    pub radius: f32,
    /// Unit normal, facing the ray's origin.
    pub normal: Vec3,
    /// Linear colour.
    pub color: Vec3,
    /// True if that point's own normal faces away from the ray's origin: the ray hits its back.
    pub is_backface: bool,
}

impl SurfaceHit {
    /// The result of a ray that hits nothing.
    pub const MISS: Self = Self {
        distance: f32::INFINITY,
        id: u32::MAX,
        radius: 0.0,
        normal: Vec3::ZERO,
        color: Vec3::ZERO,
        is_backface: false,
    };

    /// True if nothing was hit.
    pub fn is_miss(&self) -> bool {
        self.id == u32::MAX
    }
}

/// Maximum number of rejected hits of a ray. A ray with more runs along a rim, where each step is tiny, and
/// is taken to miss.
const MAX_REJECTED_HITS: usize = 24;
/// Distance behind a rejected hit at which the search restarts, in radii.
const RESTART_OFFSET: f32 = 0.05;

/// Finds the closest hit of each ray on the continuous surface.
pub fn surface_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], hits: &mut [SurfaceHit]) {
    if cloud.points.nodes.is_empty() {
        return hits.fill(SurfaceHit::MISS);
    }
    dispatch_simd!(
        simd,
        surface_hits_kernel(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit])
    );
}

#[inline(always)]
fn surface_hits_kernel<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    if cloud.surface.uses_discs() {
        splat_hits::<L>(cloud, rays, hits);
    } else {
        sphere_hits::<L>(cloud, rays, hits);
    }
}

/// Finds out for each ray whether the continuous surface lies in its range.
pub fn occlusions(cloud: &FlatCloud, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.points.nodes.is_empty() {
        return occluded.fill(false);
    }
    dispatch_simd!(simd, occlusions_kernel(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]));
}

#[inline(always)]
fn occlusions_kernel<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]) {
    if !cloud.surface.uses_discs() || cloud.edge_test == EdgeTest::Off {
        any_hits_kernel::<L>(cloud, rays, occluded);
    } else {
        any_accepted_hit::<L, Disc, _>(&cloud.points, rays, EdgeFilter(cloud), occluded);
    }
}

#[inline(always)]
fn sphere_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    let mut nearest = vec![Hit::MISS; rays.len()];
    closest_hits_kernel::<L>(cloud, rays, &mut nearest);
    for ((ray, nearest), hit) in rays.iter().zip(nearest).zip(hits) {
        *hit = SurfaceHit::MISS;
        if nearest.is_miss() {
            continue;
        }
        let sphere = cloud.points.surfel(nearest.slot);
        let outward = (ray.at(nearest.distance) - sphere.center) / sphere.radius;
        let normal = if outward.dot(ray.direction) < 0.0 { outward } else { -outward };
        *hit = SurfaceHit {
            distance: nearest.distance,
            id: cloud.points.id(nearest.slot),
            radius: sphere.radius,
            normal: normal.normalize_or(-ray.direction),
            color: sphere.color,
            is_backface: 0.0 < outward.dot(ray.direction),
        };
    }
}

/// Traces all rays together until each has a hit within the edge of the surface, or hits nothing more.
#[inline(always)]
fn splat_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    hits.fill(SurfaceHit::MISS);
    if cloud.edge_test == EdgeTest::Off {
        let mut splats = vec![Splat::MISS; rays.len()];
        SplatTracer::new(cloud, cloud.surface, EdgeTest::Off).trace::<L>(rays, &mut splats);
        for ((hit, ray), splat) in hits.iter_mut().zip(rays).zip(&splats) {
            *hit = surface_hit(cloud, ray, splat);
        }
        return;
    }
    let mut searching: Vec<u32> = (0..rays.len() as u32).collect();
    let mut rays = rays.to_vec();
    let mut splats = vec![Splat::MISS; rays.len()];
    let mut tracer = SplatTracer::new(cloud, cloud.surface, EdgeTest::AngularGap);
    for _ in 0..MAX_REJECTED_HITS {
        let splats = &mut splats[..rays.len()];
        tracer.trace::<L>(&rays, splats);
        let mut n_left = 0;
        for i in 0..splats.len() {
            let (splat, ray, ray_idx) = (&splats[i], rays[i], searching[i]);
            if splat.hit.is_miss() {
                continue;
            }
            let found = surface_hit(cloud, &ray, splat);
            if splat.is_enclosed {
                hits[ray_idx as usize] = found;
                continue;
            }
            let behind = splat.hit.distance + RESTART_OFFSET * found.radius;
            let t_min = behind.max(splat.hit.distance * (1.0 + 2.0 * f32::EPSILON));
            (rays[n_left], searching[n_left]) = (Ray { t_min, ..ray }, ray_idx);
            n_left += 1;
        }
        rays.truncate(n_left);
        if rays.is_empty() {
            return;
        }
    }
}

#[inline(always)]
fn surface_hit(cloud: &FlatCloud, ray: &Ray, splat: &Splat) -> SurfaceHit {
    if splat.hit.is_miss() {
        return SurfaceHit::MISS;
    }
    SurfaceHit {
        distance: splat.hit.distance,
        id: cloud.points.id(splat.hit.slot),
        radius: splat.radius / cloud.surface.radius_factor(),
        normal: splat.normal,
        color: splat.color,
        is_backface: 0.0 < cloud.points.normal(splat.hit.slot).dot(ray.direction),
    }
}
