//! The three searches on single rays, each point taken on its own.

use super::traverse::{RayVisitor, along_ray};
use crate::flat::{FlatPoints, FlatScene, Slot};
use crate::math::{LANES, LaneMask, Lanes, Ray};
use crate::surface::{Disc, MAX_GATHERED, RayLanes, Shape, Sphere, gather_limit};
use std::marker::PhantomData;
use std::ops::ControlFlow;

/// The nearest shape on a ray: the one with the lower point id where two are equally near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Infinite if nothing was hit.
    pub distance: f32,
    pub slot: Slot,
}

impl Hit {
    pub const MISS: Self = Self { distance: f32::INFINITY, slot: Slot::MAX };

    pub fn is_miss(&self) -> bool {
        self.slot == Slot::MAX
    }

    #[inline(always)]
    fn is_before(&self, other: &Self, points: &FlatPoints) -> bool {
        let first_id = |hit: &Self| points.ids.get(hit.slot as usize).copied();
        self.distance < other.distance
            || self.distance == other.distance
                && (other.is_miss() || first_id(self) < first_id(other))
    }
}

/// The nearest shapes on a ray, nearest first, none farther than the least `gather_limit` of them.
#[derive(Clone, Copy, Debug)]
pub struct Gather {
    hits: [Hit; MAX_GATHERED],
    len: usize,
    limit: f32,
}

impl Gather {
    pub const EMPTY: Self = Self { hits: [Hit::MISS; MAX_GATHERED], len: 0, limit: f32::INFINITY };

    pub fn hits(&self) -> &[Hit] {
        &self.hits[..self.len]
    }

    /// Takes `hit` in if it is near enough, and drops what is no longer.
    #[inline(always)]
    fn insert(&mut self, points: &FlatPoints, hit: Hit, radius: f32) {
        self.limit = self.limit.min(gather_limit(hit.distance, radius));
        let mut place = self.len.min(MAX_GATHERED - 1);
        if self.len == MAX_GATHERED && !hit.is_before(&self.hits[place], points) {
            return;
        }
        while 0 < place && hit.is_before(&self.hits[place - 1], points) {
            self.hits[place] = self.hits[place - 1];
            place -= 1;
        }
        self.hits[place] = hit;
        self.len = (self.len + 1).min(MAX_GATHERED);
        while 0 < self.len && self.limit < self.hits[self.len - 1].distance {
            self.len -= 1;
        }
    }

    /// Once full, nothing beyond the last is taken in any more.
    #[inline(always)]
    fn reach(&self) -> f32 {
        if self.len == MAX_GATHERED { self.hits[MAX_GATHERED - 1].distance } else { self.limit }
    }
}

#[inline(always)]
pub(super) fn closest_hits<L: Lanes>(scene: &FlatScene, rays: &[Ray], hits: &mut [Hit]) {
    for (ray, hit) in rays.iter().zip(hits) {
        *hit = closest_hit::<L>(scene, ray);
    }
}

#[inline(always)]
pub(super) fn any_hits<L: Lanes>(scene: &FlatScene, rays: &[Ray], occluded: &mut [bool]) {
    for (ray, occluded) in rays.iter().zip(occluded) {
        *occluded = if scene.surface.is_oriented() {
            any_hit::<L, Disc>(scene, ray)
        } else {
            any_hit::<L, Sphere>(scene, ray)
        };
    }
}

#[inline(always)]
pub(super) fn gathers<L: Lanes>(scene: &FlatScene, rays: &[Ray], gathers: &mut [Gather]) {
    for (ray, result) in rays.iter().zip(gathers) {
        *result = gather::<L>(scene, ray);
    }
}

#[inline(always)]
pub(super) fn closest_hit<L: Lanes>(scene: &FlatScene, ray: &Ray) -> Hit {
    if scene.surface.is_oriented() {
        closest_of::<L, Disc>(scene, ray)
    } else {
        closest_of::<L, Sphere>(scene, ray)
    }
}

/// Discs only: spheres do not blend.
#[inline(always)]
pub(super) fn gather<L: Lanes>(scene: &FlatScene, ray: &Ray) -> Gather {
    let gather = Gather { limit: ray.t_max, ..Gather::EMPTY };
    let mut gathering = Gathering { ray, gather };
    along_ray::<L>(&scene.points, ray, &mut gathering);
    gathering.gather
}

#[inline(always)]
fn closest_of<L: Lanes, S: Shape>(scene: &FlatScene, ray: &Ray) -> Hit {
    let hit = Hit { distance: ray.t_max, ..Hit::MISS };
    let mut closest = Closest { ray, shape: PhantomData::<S>, hit };
    along_ray::<L>(&scene.points, ray, &mut closest);
    if closest.hit.is_miss() { Hit::MISS } else { closest.hit }
}

#[inline(always)]
pub(super) fn any_hit<L: Lanes, S: Shape>(scene: &FlatScene, ray: &Ray) -> bool {
    let mut any = Any { ray, shape: PhantomData::<S>, is_hit: false };
    along_ray::<L>(&scene.points, ray, &mut any);
    any.is_hit
}

/// The hits in one block.
pub(super) struct BlockHits {
    block_idx: u32,
    lanes: u8,
    distances: [f32; LANES],
    radii: [f32; LANES],
}

impl BlockHits {
    /// Up to `t_max`. Loops over these rather than closures: a closure would not be compiled for the
    /// SIMD level of the kernel around it.
    #[inline(always)]
    pub(super) fn find<L: Lanes, S: Shape>(
        points: &FlatPoints,
        block_idx: u32,
        ray: &Ray,
        t_max: f32,
    ) -> Self {
        let block = &points.blocks[block_idx as usize];
        let lanes = block.points::<L>(ray.origin);
        let (distances, mask) = S::intersect(&lanes, &RayLanes::<L>::new(ray));
        let hit_lanes = (mask & distances.less_equal(L::splat(t_max))).bits();
        Self {
            block_idx,
            lanes: hit_lanes,
            distances: distances.store(),
            radii: lanes.radius.store(),
        }
    }

    /// The next hit and the radius of what was hit.
    #[inline(always)]
    pub(super) fn next(&mut self) -> Option<(Hit, f32)> {
        if self.lanes == 0 {
            return None;
        }
        let lane = self.lanes.trailing_zeros() as usize;
        self.lanes &= self.lanes - 1;
        let slot = self.block_idx * LANES as u32 + lane as u32;
        Some((Hit { distance: self.distances[lane], slot }, self.radii[lane]))
    }
}

struct Closest<'r, S> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    hit: Hit,
}

impl<S: Shape> RayVisitor for Closest<'_, S> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.hit.distance
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let mut hits = BlockHits::find::<L, S>(points, block_idx, self.ray, self.hit.distance);
        while let Some((hit, _)) = hits.next() {
            if hit.is_before(&self.hit, points) {
                self.hit = hit;
            }
        }
        ControlFlow::Continue(())
    }
}

struct Any<'r, S> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    is_hit: bool,
}

impl<S: Shape> RayVisitor for Any<'_, S> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.t_max
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let hits = BlockHits::find::<L, S>(points, block_idx, self.ray, self.ray.t_max);
        self.is_hit = hits.lanes != 0;
        if self.is_hit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

struct Gathering<'r> {
    ray: &'r Ray,
    gather: Gather,
}

impl RayVisitor for Gathering<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.gather.reach()
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let reach = self.gather.reach();
        let mut hits = BlockHits::find::<L, Disc>(points, block_idx, self.ray, reach);
        while let Some((hit, radius)) = hits.next() {
            if hit.distance <= self.gather.limit {
                self.gather.insert(points, hit, radius);
            }
        }
        ControlFlow::Continue(())
    }
}
