//! The points around hits, shown to the angular-gap test.

use super::region::{RegionVisitor, within};
use super::sightings::Sighting;
use crate::flat::{FlatPoints, PointBlock};
use crate::math::{Aabb, Floats, LANES, LaneMask, Lanes, Task, Vec3, Vec3Lanes, WIDE, Wide};
use crate::surface::{Candidate, Candidates, NEIGHBOR_REACH, Surroundings, Verdicts};
use std::marker::PhantomData;

/// A neighbourhood with too few points to judge by is looked at once more this many times as wide.
const WIDER: f32 = 2.0;
/// Hits at most this many radii from the first of them, along any axis, are judged together.
const SPREAD: f32 = 2.0;
/// Fewer hits are judged one by one.
const FEWEST_TOGETHER: u32 = 3;
/// Of coordinates in single precision, with some to spare.
const ROUNDING: f32 = 1e-6;

/// Whether the points near it enclose a hit at `position`.
#[inline(always)]
pub fn is_enclosed<L: Lanes>(points: &FlatPoints, position: Vec3, hit: Candidate) -> bool {
    let mut verdict = judge_one::<L>(points, position, hit);
    if verdict.sparse != 0 {
        let hit = Candidate { radius: WIDER * hit.radius, ..hit };
        verdict = judge_one::<L>(points, position, hit);
    }
    verdict.enclosed != 0
}

#[inline(always)]
fn judge_one<L: Lanes>(points: &FlatPoints, position: Vec3, hit: Candidate) -> Verdicts {
    L::call(JudgeOne { points, position, hit, lanes: PhantomData::<L> })
}

struct JudgeOne<'p, L> {
    points: &'p FlatPoints,
    position: Vec3,
    hit: Candidate,
    lanes: PhantomData<L>,
}

impl<L: Lanes> Task for JudgeOne<'_, L> {
    type Output = Verdicts;

    #[inline(always)]
    fn run(self) -> Verdicts {
        let Self { points, position, hit, .. } = self;
        let mut found = Neighborhood::<L> {
            position,
            surroundings: Surroundings::new(Candidates::of_one(&hit)),
        };
        let reach = Vec3::splat(NEIGHBOR_REACH * hit.radius);
        let region = Aabb { min: position - reach, max: position + reach };
        within::<L>(points, &region, &mut found);
        let Verdicts { enclosed, sparse } = found.surroundings.together().judge();
        Verdicts { enclosed: enclosed & 1, sparse: sparse & 1 }
    }
}

/// Eight points before one hit: each lane takes in its own.
struct Neighborhood<L: Lanes> {
    position: Vec3,
    surroundings: Surroundings<L>,
}

impl<L: Lanes> RegionVisitor for Neighborhood<L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let points = points.blocks[block_idx as usize].points::<L>(self.position);
        let is_near = self.surroundings.near(points.center) & L::splat(0.0).less(points.radius);
        if is_near.bits() != 0 {
            self.surroundings.add(points.center, points.normal, is_near);
        }
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

/// The `lanes` in which hits are enclosed by these alone: the points in the blocks of the discs that their
/// rays pierce. They are most of those on even surfaces. `sightings` are these discs, sorted by slot.
#[inline(always)]
pub fn enclosed_by_blocks<L: Lanes>(
    points: &FlatPoints,
    sightings: &[Sighting],
    lanes: u32,
    hits: &WideHits<L::Wide>,
) -> u32 {
    lanes & L::call(JudgeByBlocks::<L> { points, sightings, hits })
}

struct JudgeByBlocks<'p, L: Lanes> {
    points: &'p FlatPoints,
    sightings: &'p [Sighting],
    hits: &'p WideHits<L::Wide>,
}

impl<L: Lanes> Task for JudgeByBlocks<'_, L> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        let Self { points, sightings, hits } = self;
        let mut found = Surroundings::new(hits.candidates());
        let block_of = |place: usize| sightings[place].slot / LANES as u32;
        let mut first = 0;
        while first < sightings.len() {
            let block_idx = block_of(first);
            let mut lanes = sightings[first].is_seen::<L::Wide>();
            first += 1;
            while first < sightings.len() && block_of(first) == block_idx {
                lanes = lanes | sightings[first].is_seen::<L::Wide>();
                first += 1;
            }
            let block = &points.blocks[block_idx as usize];
            let all = L::splat(0.0).less(block.radii()).bits();
            show_block::<L>(block, all, &hits.position, lanes, &mut found);
        }
        let Verdicts { enclosed, sparse } = found.judge();
        enclosed & !sparse
    }
}

/// The `lanes` in which hits are enclosed. Hits close to each other share the way through the tree.
#[inline(always)]
pub fn enclosed<L: Lanes>(points: &FlatPoints, lanes: u32, hits: &WideHits<L::Wide>) -> u32 {
    L::call(JudgeWide::<L> { points, lanes, hits })
}

struct JudgeWide<'p, L: Lanes> {
    points: &'p FlatPoints,
    lanes: u32,
    hits: &'p WideHits<L::Wide>,
}

impl<L: Lanes> Task for JudgeWide<'_, L> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        let Self { points, lanes, hits } = self;
        let Verdicts { mut enclosed, sparse } = judge_by_groups::<L>(points, lanes, hits);
        if sparse != 0 {
            let hits = WideHits { radius: L::Wide::splat(WIDER) * hits.radius, ..*hits };
            let wider = judge_by_groups::<L>(points, sparse, &hits);
            enclosed = enclosed & !sparse | wider.enclosed;
        }
        enclosed
    }
}

#[inline(always)]
fn judge_by_groups<L: Lanes>(
    points: &FlatPoints,
    mut lanes: u32,
    hits: &WideHits<L::Wide>,
) -> Verdicts {
    let stored = hits.store();
    let mut verdicts = Verdicts { enclosed: 0, sparse: 0 };
    while lanes != 0 {
        let first = lanes.trailing_zeros() as usize % WIDE;
        let (center, Candidate { radius, .. }) = stored.in_lane(first);
        let mut group = 1 << first | lanes & hits.near(center, SPREAD * radius);
        lanes &= !group;
        if FEWEST_TOGETHER <= group.count_ones() {
            let Verdicts { enclosed, sparse } = judge_group::<L>(points, group, hits);
            verdicts.enclosed |= group & enclosed;
            verdicts.sparse |= group & sparse;
            continue;
        }
        while group != 0 {
            let lane = group.trailing_zeros() as usize % WIDE;
            group &= group - 1;
            let (position, hit) = stored.in_lane(lane);
            let Verdicts { enclosed, sparse } = judge_one::<L>(points, position, hit);
            verdicts.enclosed |= enclosed << lane;
            verdicts.sparse |= sparse << lane;
        }
    }
    verdicts
}

/// Shows these points of a block to the hits in `lanes`.
#[inline(always)]
fn show_block<L: Lanes>(
    block: &PointBlock,
    mut points: u32,
    position: &Vec3Lanes<L::Wide>,
    lanes: <L::Wide as Floats>::Mask,
    found: &mut Surroundings<L::Wide>,
) {
    let corner = Vec3Lanes::splat(block.corner()).minus(*position);
    let (offsets, normals) = (block.offsets::<L>().store(), block.normals::<L>().store());
    while points != 0 {
        let lane = points.trailing_zeros() as usize % LANES;
        points &= points - 1;
        let offset = corner.plus(Vec3Lanes::splat_lane(&offsets, lane));
        let is_near = lanes & found.near(offset);
        if is_near.bits() != 0 {
            found.add(offset, Vec3Lanes::splat_lane(&normals, lane), is_near);
        }
    }
}

#[inline(always)]
fn judge_group<L: Lanes>(points: &FlatPoints, group: u32, hits: &WideHits<L::Wide>) -> Verdicts {
    let region = hits.region(group);
    let mut found = Neighborhoods::<L> {
        position: hits.position,
        region,
        surroundings: Surroundings::new(hits.candidates()),
    };
    within::<L>(points, &region, &mut found);
    found.surroundings.judge()
}

impl<W: Wide> WideHits<W> {
    /// Of one to sixteen; the last one fills the lanes that are left.
    #[inline(always)]
    pub fn new(hits: &[(Vec3, Candidate)]) -> Self {
        let rows = [[0.0; WIDE]; 3];
        let mut stored =
            StoredHits { position: rows, normal: rows, direction: rows, radius: [0.0; WIDE] };
        for lane in 0..WIDE {
            let (position, hit) = &hits[lane.min(hits.len() - 1)];
            stored.radius[lane] = hit.radius;
            for axis in 0..3 {
                stored.position[axis][lane] = position[axis];
                stored.normal[axis][lane] = hit.normal[axis];
                stored.direction[axis][lane] = hit.direction[axis];
            }
        }
        Self {
            position: Vec3Lanes::load_wide(&stored.position),
            normal: Vec3Lanes::load_wide(&stored.normal),
            direction: Vec3Lanes::load_wide(&stored.direction),
            radius: W::load(&stored.radius),
        }
    }

    #[inline(always)]
    fn candidates(&self) -> Candidates<W> {
        Candidates::new(self.normal, self.direction, self.radius)
    }

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
        let mut is_member = [0.0; WIDE];
        for (lane, is_member) in is_member.iter_mut().enumerate() {
            *is_member = (lanes >> lane & 1) as f32;
        }
        let lanes = W::splat(0.0).less(W::load(&is_member));
        let reach = W::splat(NEIGHBOR_REACH) * self.radius;
        let (none_low, none_high) = (W::splat(f32::INFINITY), W::splat(f32::NEG_INFINITY));
        let Vec3Lanes { x, y, z } = self.position;
        let mut region = Aabb::EMPTY;
        for (axis, position) in [x, y, z].into_iter().enumerate() {
            region.min[axis] = W::select(lanes, position - reach, none_low).min_lane();
            region.max[axis] = W::select(lanes, position + reach, none_high).max_lane();
        }
        let rounding = Vec3::splat(ROUNDING * region.min.abs().max(region.max.abs()).max_element());
        Aabb { min: region.min - rounding, max: region.max + rounding }
    }

    #[inline(always)]
    fn store(&self) -> StoredHits {
        StoredHits {
            position: self.position.store_wide(),
            normal: self.normal.store_wide(),
            direction: self.direction.store_wide(),
            radius: self.radius.store(),
        }
    }
}

/// Hits from which single ones are taken, or put together.
struct StoredHits {
    position: [[f32; WIDE]; 3],
    normal: [[f32; WIDE]; 3],
    direction: [[f32; WIDE]; 3],
    radius: [f32; WIDE],
}

impl StoredHits {
    /// Place and candidate.
    #[inline(always)]
    fn in_lane(&self, lane: usize) -> (Vec3, Candidate) {
        let vector =
            |rows: &[[f32; WIDE]; 3]| Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
        let candidate = Candidate {
            normal: vector(&self.normal),
            direction: vector(&self.direction),
            radius: self.radius[lane],
        };
        (vector(&self.position), candidate)
    }
}

struct Neighborhoods<L: Lanes> {
    position: Vec3Lanes<L::Wide>,
    region: Aabb,
    surroundings: Surroundings<L::Wide>,
}

impl<L: Lanes> RegionVisitor for Neighborhoods<L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = &points.blocks[block_idx as usize];
        let inside = block.lanes_within::<L>(&self.region);
        if inside != 0 {
            let all = L::Wide::splat(0.0).less_equal(L::Wide::splat(0.0));
            show_block::<L>(block, inside, &self.position, all, &mut self.surroundings);
        }
    }
}
