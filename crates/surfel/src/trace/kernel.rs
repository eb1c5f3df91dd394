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
    /// Index of the point in its cloud.
    pub id: u32,
}

impl Hit {
    pub const MISS: Self = Self { distance: f32::INFINITY, slot: 0, id: u32::MAX };

    #[inline(always)]
    fn is_before(&self, other: &Self) -> bool {
        self.distance < other.distance || (self.distance == other.distance && self.id < other.id)
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
    fn insert(&mut self, hit: Hit, radius: f32) {
        self.limit = self.limit.min(gather_limit(hit.distance, radius));
        let mut place = self.len.min(MAX_GATHERED - 1);
        if self.len == MAX_GATHERED && !hit.is_before(&self.hits[place]) {
            return;
        }
        while 0 < place && hit.is_before(&self.hits[place - 1]) {
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
        *occluded = false;
        each_hit::<L>(scene, ray, |_| {
            *occluded = true;
            ControlFlow::Break(())
        });
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
        let mut closest = Closest {
            ray,
            shape: PhantomData::<Disc>,
            hit: Hit { distance: ray.t_max, ..Hit::MISS },
        };
        along_ray::<L>(&scene.points, ray, &mut closest);
        closest.result()
    } else {
        let mut closest = Closest {
            ray,
            shape: PhantomData::<Sphere>,
            hit: Hit { distance: ray.t_max, ..Hit::MISS },
        };
        along_ray::<L>(&scene.points, ray, &mut closest);
        closest.result()
    }
}

/// Discs only: spheres do not blend.
#[inline(always)]
pub(super) fn gather<L: Lanes>(scene: &FlatScene, ray: &Ray) -> Gather {
    let mut gathering = Gathering { ray, gather: Gather::EMPTY };
    gathering.gather.limit = ray.t_max;
    along_ray::<L>(&scene.points, ray, &mut gathering);
    gathering.gather
}

/// Shows `found` hits in the ray's range, in any order, until it breaks off.
#[inline(always)]
pub(super) fn each_hit<L: Lanes>(
    scene: &FlatScene,
    ray: &Ray,
    found: impl FnMut(Hit) -> ControlFlow<()>,
) {
    if scene.surface.is_oriented() {
        along_ray::<L>(&scene.points, ray, &mut Each { ray, shape: PhantomData::<Disc>, found });
    } else {
        along_ray::<L>(&scene.points, ray, &mut Each { ray, shape: PhantomData::<Sphere>, found });
    }
}

/// Shows `found` the hits in one block, up to `t_max`, as lane, hit and all radii.
#[inline(always)]
fn block_hits<L: Lanes, S: Shape>(
    points: &FlatPoints,
    block_idx: u32,
    ray: &Ray,
    t_max: f32,
    mut found: impl FnMut(Hit, f32) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let block = &points.blocks[block_idx as usize];
    let lanes = block.points::<L>(ray.origin);
    let (distances, mask) = S::intersect(&lanes, &RayLanes::<L>::new(ray));
    let mut hit_lanes = (mask & distances.less_equal(L::splat(t_max))).bits();
    if hit_lanes == 0 {
        return ControlFlow::Continue(());
    }
    hit_lanes &= block.occupied();
    let (distances, radii) = (distances.store(), lanes.radius.store());
    while hit_lanes != 0 {
        let lane = hit_lanes.trailing_zeros() as usize;
        hit_lanes &= hit_lanes - 1;
        let slot = block_idx * LANES as u32 + lane as u32;
        found(Hit { distance: distances[lane], slot, id: block.id[lane] }, radii[lane])?;
    }
    ControlFlow::Continue(())
}

struct Closest<'r, S> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    hit: Hit,
}

impl<S> Closest<'_, S> {
    fn result(self) -> Hit {
        if self.hit.id == Hit::MISS.id { Hit::MISS } else { self.hit }
    }
}

impl<S: Shape> RayVisitor for Closest<'_, S> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.hit.distance
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let nearest = &mut self.hit;
        block_hits::<L, S>(points, block_idx, self.ray, nearest.distance, |hit, _| {
            if hit.is_before(nearest) {
                *nearest = hit;
            }
            ControlFlow::Continue(())
        })
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
        let gather = &mut self.gather;
        block_hits::<L, Disc>(points, block_idx, self.ray, gather.reach(), |hit, radius| {
            if hit.distance <= gather.limit {
                gather.insert(hit, radius);
            }
            ControlFlow::Continue(())
        })
    }
}

struct Each<'r, S, F> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    found: F,
}

impl<S: Shape, F: FnMut(Hit) -> ControlFlow<()>> RayVisitor for Each<'_, S, F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.t_max
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        block_hits::<L, S>(points, block_idx, self.ray, self.ray.t_max, |hit, _| (self.found)(hit))
    }
}
