//! The continuous surface: discs gathered and blended, hits beyond its boundary refused.

use super::any::any_hits;
use super::block::BlockHits;
use super::boundary::judge;
use super::closest::closest_hit;
use super::gather::gather;
use super::hit::Hit;
use super::traverse::{RayStack, RayVisitor, along_ray};
use crate::flat::{FlatPoints, FlatScene};
use crate::math::{Lanes, Ray, Vec3};
use crate::surface::{
    Boundary, Candidate, Disc, Gathered, Judgement, MAX_GATHERED, Surroundings, blend,
};
use std::ops::ControlFlow;

/// Where a ray meets the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Infinite if nothing was hit.
    pub distance: f32,
    /// Index in its cloud of the nearest point hit.
    pub id: u32,
    /// Of that point, in world units.
    pub radius: f32,
    /// Unit, facing the ray's origin.
    pub normal: Vec3,
    /// Linear.
    pub color: Vec3,
}

impl SurfaceHit {
    pub const MISS: Self = Self {
        distance: f32::INFINITY,
        id: u32::MAX,
        radius: 0.0,
        normal: Vec3::ZERO,
        color: Vec3::ZERO,
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
pub(super) fn surface_hits<L: Lanes>(scene: &FlatScene, rays: &[Ray], hits: &mut [SurfaceHit]) {
    let mut stack = RayStack::new();
    for (ray, hit) in rays.iter().zip(hits) {
        *hit = if scene.surface.is_oriented() {
            surface_hit::<L>(scene, ray, &mut stack)
        } else {
            sphere_hit::<L>(scene, ray, &mut stack)
        };
    }
}

/// A hit is in doubt only up to the wide gap: one that is merely at an edge is taken in the end,
/// whatever follows it, so the first such hit settles it.
#[inline(always)]
pub(super) fn occlusions<L: Lanes>(scene: &FlatScene, rays: &[Ray], occluded: &mut [bool]) {
    if !scene.surface.is_oriented() || scene.boundary == Boundary::Off {
        return any_hits::<L>(scene, rays, occluded);
    }
    let mut stack = RayStack::new();
    for (ray, occluded) in rays.iter().zip(occluded) {
        let mut search = OccluderSearch { scene, ray, n_refused: 0, is_occluded: false };
        along_ray::<L>(&scene.points, ray, &mut stack, &mut search);
        *occluded = search.is_occluded;
    }
}

struct OccluderSearch<'a> {
    scene: &'a FlatScene,
    ray: &'a Ray,
    n_refused: usize,
    is_occluded: bool,
}

impl RayVisitor for OccluderSearch<'_> {
    const IS_ORDERED: bool = true;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.t_max
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let hits = BlockHits::<L>::find::<Disc>(points, block_idx, self.ray);
        let mut hits = hits.up_to(self.ray.t_max);
        while let Some((hit, _)) = hits.next() {
            if single_disc::<L>(self.scene, self.ray, &hit) != Judgement::Outside {
                self.is_occluded = true;
                return ControlFlow::Break(());
            }
            self.n_refused += 1;
            if self.n_refused == MAX_REFUSALS {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }
}

#[inline(always)]
fn single_disc<L: Lanes>(scene: &FlatScene, ray: &Ray, hit: &Hit) -> Judgement {
    let disc = scene.points.gathered(hit.slot, ray.at(hit.distance));
    let radius = disc.radius / scene.surface.radius_factor();
    let normal = if 0.0 < disc.normal.dot(ray.direction) { -disc.normal } else { disc.normal };
    let candidate = Candidate { normal, direction: ray.direction, radius };
    judge::<L>(&scene.points, disc.position, &candidate)
}

#[inline(always)]
fn sphere_hit<L: Lanes>(scene: &FlatScene, ray: &Ray, stack: &mut RayStack) -> SurfaceHit {
    let hit = closest_hit::<L>(scene, ray, stack);
    if hit.is_miss() {
        return SurfaceHit::MISS;
    }
    let sphere = scene.points.gathered(hit.slot, ray.at(hit.distance));
    let outward = (sphere.position - sphere.center) / sphere.radius;
    let normal = if outward.dot(ray.direction) < 0.0 { outward } else { -outward };
    SurfaceHit {
        distance: hit.distance,
        id: scene.points.id(hit.slot),
        radius: sphere.radius,
        normal: normal.normalize_or(-ray.direction),
        color: sphere.color,
    }
}

#[inline(always)]
fn surface_hit<L: Lanes>(scene: &FlatScene, ray: &Ray, stack: &mut RayStack) -> SurfaceHit {
    let mut rest = *ray;
    let mut at_edge = SurfaceHit::MISS;
    for _ in 0..MAX_REFUSALS {
        let mut discs = [Gathered::NONE; MAX_GATHERED];
        let (first, n) = pierced_discs::<L>(scene, &rest, stack, &mut discs);
        if n == 0 {
            return at_edge;
        }
        let discs = &discs[..n];
        let (normal, color) = blend(scene.surface, discs, ray.direction);
        let radius = discs[0].radius / scene.surface.radius_factor();
        let hit = SurfaceHit {
            distance: first.distance,
            id: scene.points.id(first.slot),
            radius,
            normal,
            color,
        };
        if scene.boundary == Boundary::Off {
            return hit;
        }
        match judge_gathered::<L>(
            scene,
            discs,
            &Candidate { normal, direction: ray.direction, radius },
        ) {
            Judgement::Enclosed => return hit,
            Judgement::Edge if at_edge.is_miss() => at_edge = hit,
            _ => {}
        }
        rest.t_min =
            (first.distance + RESUME * radius).max(first.distance * (1.0 + 2.0 * f32::EPSILON));
    }
    at_edge
}

/// Fills `discs` with what makes up the surface at the first hit; returns that hit and their number.
#[inline(always)]
fn pierced_discs<L: Lanes>(
    scene: &FlatScene,
    ray: &Ray,
    stack: &mut RayStack,
    discs: &mut [Gathered; MAX_GATHERED],
) -> (Hit, usize) {
    let disc = |hit: &Hit| scene.points.gathered(hit.slot, ray.at(hit.distance));
    if !scene.surface.is_gathered() {
        let hit = closest_hit::<L>(scene, ray, stack);
        if hit.is_miss() {
            return (hit, 0);
        }
        discs[0] = disc(&hit);
        return (hit, 1);
    }
    let gather = gather::<L>(&scene.points, ray, stack);
    for (place, hit) in discs.iter_mut().zip(gather.hits()) {
        *place = disc(hit);
    }
    (gather.hits().first().copied().unwrap_or(Hit::MISS), gather.hits().len())
}

/// On an even patch the pierced discs' own centres mostly surround the hit already, and more points
/// only narrow gaps: then the search around the hit is saved.
#[inline(always)]
fn judge_gathered<L: Lanes>(scene: &FlatScene, discs: &[Gathered], hit: &Candidate) -> Judgement {
    const COS_EVEN: f32 = 0.8;
    let position = discs[0].position;
    if discs.iter().all(|disc| COS_EVEN < disc.normal.dot(hit.normal).abs()) {
        let mut surroundings = Surroundings::new(*hit);
        for disc in discs {
            surroundings.add(disc.center - position, disc.normal);
        }
        if surroundings.judge() == Judgement::Enclosed {
            return Judgement::Enclosed;
        }
    }
    judge::<L>(&scene.points, position, hit)
}
