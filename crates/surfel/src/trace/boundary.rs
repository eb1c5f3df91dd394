//! The points around hits, shown to the angular-gap test.

use super::region::{RegionVisitor, within};
use crate::flat::FlatPoints;
use crate::math::{Aabb, LANES, LaneMask, Lanes, Task, Vec3, Vec3Lanes, WIDE, Wide};
use crate::surface::{Candidate, Judgement, NEIGHBOR_REACH, Surroundings};
use std::marker::PhantomData;

/// A neighbourhood with too few points to judge by is looked at once more this many times as wide.
const WIDER: f32 = 2.0;
/// Hits at most this many radii from the first of them, along any axis, are judged together.
const SPREAD: f32 = 3.0;
/// Blocks near them that are kept in mind; where there are more, each hit looks for its own.
const MAX_BLOCKS: usize = 64;

/// Judges a hit at `position` by all points near it.
#[inline(always)]
pub fn judge<L: Lanes>(points: &FlatPoints, position: Vec3, hit: Candidate) -> Judgement {
    L::call(JudgeOne { points, position, hit, lanes: PhantomData::<L> })
}

struct JudgeOne<'p, L> {
    points: &'p FlatPoints,
    position: Vec3,
    hit: Candidate,
    lanes: PhantomData<L>,
}

impl<L: Lanes> Task for JudgeOne<'_, L> {
    type Output = Judgement;

    #[inline(always)]
    fn run(self) -> Judgement {
        let Self { points, position, mut hit, .. } = self;
        loop {
            let mut found = Neighborhood { position, surroundings: Surroundings::<L>::new(hit) };
            let reach = Vec3::splat(NEIGHBOR_REACH * hit.radius);
            let region = Aabb { min: position - reach, max: position + reach };
            within::<L>(points, &region, &mut found);
            if !found.surroundings.is_sparse() || self.hit.radius < hit.radius {
                return found.surroundings.judge();
            }
            hit.radius *= WIDER;
        }
    }
}

struct Neighborhood<L: Lanes> {
    position: Vec3,
    surroundings: Surroundings<L>,
}

impl<L: Lanes> RegionVisitor for Neighborhood<L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32, _: [[f32; 2]; 3]) {
        self.surroundings.add(&points.blocks[block_idx as usize].points(self.position));
    }
}

/// Hits of up to sixteen rays that are judged at once.
#[derive(Clone, Copy)]
pub struct WideHits<W> {
    pub position: Vec3Lanes<W>,
    /// Unit, facing the rays' origins.
    pub normal: Vec3Lanes<W>,
    /// Of the rays, unit.
    pub direction: Vec3Lanes<W>,
    pub radius: W,
}

/// As `judge` does; hits close to each other share the way through the tree. Only what stands in `lanes`
/// counts.
#[inline(always)]
pub fn judge_wide<L: Lanes>(
    points: &FlatPoints,
    lanes: u32,
    hits: &WideHits<L::Wide>,
) -> [Judgement; WIDE] {
    L::call(JudgeWide::<L> { points, lanes, hits })
}

struct JudgeWide<'p, L: Lanes> {
    points: &'p FlatPoints,
    lanes: u32,
    hits: &'p WideHits<L::Wide>,
}

impl<L: Lanes> Task for JudgeWide<'_, L> {
    type Output = [Judgement; WIDE];

    #[inline(always)]
    fn run(self) -> [Judgement; WIDE] {
        let Self { points, mut lanes, hits } = self;
        let mut judgements = [Judgement::Outside; WIDE];
        let [x, y, z] = hits.position.store_wide();
        let radii = hits.radius.store();
        while lanes != 0 {
            let first = lanes.trailing_zeros() as usize % WIDE;
            let center = Vec3::new(x[first], y[first], z[first]);
            let group = 1 << first | lanes & hits.near(center, SPREAD * radii[first]);
            lanes &= !group;
            judge_group::<L>(points, group, hits, &mut judgements);
        }
        judgements
    }
}

#[inline(always)]
fn judge_group<L: Lanes>(
    points: &FlatPoints,
    mut group: u32,
    hits: &WideHits<L::Wide>,
    judgements: &mut [Judgement; WIDE],
) {
    let mut blocks =
        NearBlocks { indices: [0; MAX_BLOCKS], bounds: [[[0.0; MAX_BLOCKS]; 2]; 3], n: 0 };
    within::<L>(points, &hits.region(group), &mut blocks);
    let (position, normal) = (hits.position.store_wide(), hits.normal.store_wide());
    let (direction, radius) = (hits.direction.store_wide(), hits.radius.store());
    while group != 0 {
        let lane = group.trailing_zeros() as usize % WIDE;
        group &= group - 1;
        let candidate = Candidate {
            normal: in_lane(&normal, lane),
            direction: in_lane(&direction, lane),
            radius: radius[lane],
        };
        judgements[lane] = blocks.judge::<L>(points, in_lane(&position, lane), candidate);
    }
}

#[inline(always)]
fn in_lane([x, y, z]: &[[f32; WIDE]; 3], lane: usize) -> Vec3 {
    Vec3::new(x[lane], y[lane], z[lane])
}

impl<W: Wide> WideHits<W> {
    /// The lanes within this distance along each axis.
    #[inline(always)]
    fn near(&self, center: Vec3, distance: f32) -> u32 {
        let offset = self.position.minus(Vec3Lanes::splat(center));
        let offset = offset.x.abs().max(offset.y.abs()).max(offset.z.abs());
        offset.less_equal(W::splat(distance)).bits()
    }

    /// Around all points near the hits in these lanes.
    #[inline(always)]
    fn region(&self, lanes: u32) -> Aabb {
        let reach = W::splat(NEIGHBOR_REACH) * self.radius;
        let mut region = Aabb::EMPTY;
        let position = [self.position.x, self.position.y, self.position.z];
        for axis in 0..3 {
            let (low, high) = ((position[axis] - reach).store(), (position[axis] + reach).store());
            let mut left = lanes;
            while left != 0 {
                let lane = left.trailing_zeros() as usize % WIDE;
                left &= left - 1;
                region.min[axis] = region.min[axis].min(low[lane]);
                region.max[axis] = region.max[axis].max(high[lane]);
            }
        }
        region
    }
}

/// The blocks around a group of hits.
struct NearBlocks {
    indices: [u32; MAX_BLOCKS],
    /// Lower and upper, axis by axis.
    bounds: [[[f32; MAX_BLOCKS]; 2]; 3],
    /// More than there is room for if too many were found.
    n: usize,
}

impl RegionVisitor for NearBlocks {
    #[inline(always)]
    fn visit(&mut self, _: &FlatPoints, block_idx: u32, bounds: [[f32; 2]; 3]) {
        if self.n < MAX_BLOCKS {
            self.indices[self.n] = block_idx;
            for axis in 0..3 {
                for side in 0..2 {
                    self.bounds[axis][side][self.n] = bounds[axis][side];
                }
            }
        }
        self.n += 1;
    }
}

impl NearBlocks {
    #[inline(always)]
    fn judge<L: Lanes>(&self, points: &FlatPoints, position: Vec3, hit: Candidate) -> Judgement {
        if MAX_BLOCKS < self.n {
            return judge::<L>(points, position, hit);
        }
        let mut surroundings = Surroundings::<L>::new(hit);
        for first in (0..self.n).step_by(LANES) {
            let mut near = self.near::<L>(first, position, NEIGHBOR_REACH * hit.radius);
            if self.n < first + LANES {
                near &= (1 << (self.n - first)) - 1;
            }
            while near != 0 {
                let block_idx = self.indices[first + near.trailing_zeros() as usize % LANES];
                near &= near - 1;
                surroundings.add(&points.blocks[block_idx as usize].points(position));
            }
        }
        if surroundings.is_sparse() {
            return judge::<L>(points, position, hit);
        }
        surroundings.judge()
    }

    /// Those of eight blocks whose boxes are within `reach` of `position` along each axis.
    #[inline(always)]
    fn near<L: Lanes>(&self, first: usize, position: Vec3, reach: f32) -> u32 {
        let mut is_near = L::splat(0.0).less_equal(L::splat(0.0));
        for axis in 0..3 {
            let [low, high] = &self.bounds[axis];
            let (Some(low), Some(high)) = (low[first..].first_chunk(), high[first..].first_chunk())
            else {
                unreachable!("blocks come in eights")
            };
            let (min, max) = (L::splat(position[axis] - reach), L::splat(position[axis] + reach));
            is_near = is_near & L::load(low).less_equal(max) & min.less_equal(L::load(high));
        }
        is_near.bits()
    }
}
