//! The continuous surface: discs gathered and blended, hits beyond its boundary refused.

use super::any::{Judge, any_hits, any_that_counts};
use super::boundary::{WideHits, enclosed, is_enclosed};
use super::closest::closest_hits;
use super::hit::Hit;
use super::packet::WideRays;
use super::splat::{Finder, Splat};
use crate::flat::{FlatCloud, Slot};
use crate::math::{Floats, Lanes, Ray, Vec3, Vec3Lanes, WIDE, Wide};
use crate::surface::{Boundary, Candidate, Disc};

/// Where a ray meets the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Infinite if nothing was hit.
    pub distance: f32,
    /// Index in its cloud of the nearest point hit.
    pub id: u32,
    /// Of that point, in the cloud's own units.
    pub radius: f32,
    /// Unit, facing the ray's origin.
    pub normal: Vec3,
    /// Linear.
    pub color: Vec3,
    /// Whether that point's own normal faces away: the ray comes from behind it.
    pub is_inner: bool,
}

impl SurfaceHit {
    pub const MISS: Self = Self {
        distance: f32::INFINITY,
        id: u32::MAX,
        radius: 0.0,
        normal: Vec3::ZERO,
        color: Vec3::ZERO,
        is_inner: false,
    };

    pub fn is_miss(&self) -> bool {
        self.id == u32::MAX
    }
}

/// Refused hits after which a ray is taken to miss: it runs along a rim, where each step is tiny.
const MAX_REFUSALS: usize = 24;
/// A search goes on this many radii behind a refused hit.
const RESUME: f32 = 0.05;

#[inline(always)]
pub(super) fn surface_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    if cloud.surface.is_oriented() {
        splat_hits::<L>(cloud, rays, hits);
    } else {
        sphere_hits::<L>(cloud, rays, hits);
    }
}

/// Whether the surface blocks each ray.
#[inline(always)]
pub(super) fn occlusions<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]) {
    if !cloud.surface.is_oriented() || cloud.boundary == Boundary::Off {
        any_hits::<L>(cloud, rays, occluded);
    } else {
        any_that_counts::<L, Disc, _>(&cloud.points, rays, WithinBoundary(cloud), occluded);
    }
}

#[derive(Clone, Copy)]
struct WithinBoundary<'s>(&'s FlatCloud);

impl WithinBoundary<'_> {
    fn radius(&self, slot: Slot) -> f32 {
        self.0.points.radius(slot) / self.0.surface.radius_factor()
    }
}

impl Judge for WithinBoundary<'_> {
    const IS_LENIENT: bool = false;

    #[inline(always)]
    fn counts<L: Lanes>(&self, ray: &Ray, hit: &Hit) -> bool {
        let normal = self.0.points.normal(hit.slot);
        let candidate = Candidate {
            normal: if 0.0 < normal.dot(ray.direction) { -normal } else { normal },
            direction: ray.direction,
            radius: self.radius(hit.slot),
        };
        is_enclosed::<L>(&self.0.points, ray.at(hit.distance), candidate)
    }

    #[inline(always)]
    fn counting<L: Lanes>(
        &self,
        rays: &WideRays<L::Wide>,
        lanes: u32,
        distances: L::Wide,
        slots: &[Slot; WIDE],
    ) -> u32 {
        let (origin, direction) = (rays.origin(), rays.direction());
        let (mut normals, mut radii) = ([[0.0; WIDE]; 3], [0.0; WIDE]);
        let mut left = lanes;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % WIDE;
            left &= left - 1;
            [normals[0][lane], normals[1][lane], normals[2][lane]] =
                self.0.points.normal(slots[lane]).to_array();
            radii[lane] = self.radius(slots[lane]);
        }
        let normal = Vec3Lanes::load_wide(&normals);
        let is_away = L::Wide::splat(0.0).less(normal.dot(direction));
        let sign = L::Wide::select(is_away, L::Wide::splat(-1.0), L::Wide::splat(1.0));
        let hits = WideHits {
            position: origin.plus(direction.scaled(distances)),
            normal: normal.scaled(sign),
            direction,
            radius: L::Wide::load(&radii),
        };
        enclosed::<L>(&self.0.points, lanes, &hits)
    }
}

#[inline(always)]
fn sphere_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    let mut nearest = vec![Hit::MISS; rays.len()];
    closest_hits::<L>(cloud, rays, &mut nearest);
    for ((ray, nearest), hit) in rays.iter().zip(nearest).zip(hits) {
        *hit = SurfaceHit::MISS;
        if nearest.is_miss() {
            continue;
        }
        let sphere = cloud.points.gathered(nearest.slot);
        let outward = (ray.at(nearest.distance) - sphere.center) / sphere.radius;
        let normal = if outward.dot(ray.direction) < 0.0 { outward } else { -outward };
        *hit = SurfaceHit {
            distance: nearest.distance,
            id: cloud.points.id(nearest.slot),
            radius: sphere.radius,
            normal: normal.normalize_or(-ray.direction),
            color: sphere.color,
            is_inner: 0.0 < outward.dot(ray.direction),
        };
    }
}

/// All rays search on together until each has a hit within the boundary, or nothing is left on it.
#[inline(always)]
fn splat_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    hits.fill(SurfaceHit::MISS);
    if cloud.boundary == Boundary::Off {
        let mut splats = vec![Splat::MISS; rays.len()];
        Finder::new(cloud, cloud.surface, Boundary::Off).find::<L>(rays, &mut splats);
        for ((hit, ray), splat) in hits.iter_mut().zip(rays).zip(&splats) {
            *hit = surface_hit(cloud, ray, splat);
        }
        return;
    }
    let mut searching: Vec<u32> = (0..rays.len() as u32).collect();
    let mut rays = rays.to_vec();
    let mut splats = vec![Splat::MISS; rays.len()];
    let mut finder = Finder::new(cloud, cloud.surface, Boundary::Gap);
    for _ in 0..MAX_REFUSALS {
        let splats = &mut splats[..rays.len()];
        finder.find::<L>(&rays, splats);
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
            let behind = splat.hit.distance + RESUME * found.radius;
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
        is_inner: 0.0 < cloud.points.normal(splat.hit.slot).dot(ray.direction),
    }
}
