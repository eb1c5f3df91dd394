//! The points around hits, shown to the angular-gap test.

use super::region::{RegionVisitor, within};
use super::sightings::Sighting;
use crate::flat::{FlatPoints, PointBlock};
use crate::math::{Aabb, Floats, LANES, LaneMask, Lanes, Task, Vec3, Vec3Lanes, WIDE, Wide};
use crate::surface::{Candidate, Candidates, NEIGHBOR_REACH, Surroundings, Vicinities};
use std::marker::PhantomData;

/// A neighbourhood with too few points to judge by is looked at once more this many times as wide.
const WIDER: f32 = 2.0;
/// Hits at most this many radii from the first of them, along any axis, are judged together.
const SPREAD: f32 = 2.0;
/// Fewer hits are judged one by one.
const FEWEST_TOGETHER: u32 = 3;
/// Of coordinates in single precision, with some to spare.
const ROUNDING: f32 = 1e-6;
/// Blocks near them that are kept in mind.
const MAX_BLOCKS: usize = 64;

/// Whether the points near it enclose a hit at `position`.
#[inline(always)]
pub fn is_enclosed<L: Lanes>(points: &FlatPoints, position: Vec3, hit: Candidate) -> bool {
    match judge_one::<L>(points, position, hit) {
        Verdict::Enclosed => true,
        Verdict::Outside => false,
        Verdict::Sparse { .. } => {
            let hit = Candidate { radius: WIDER * hit.radius, ..hit };
            judge_one::<L>(points, position, hit).is_final_yes()
        }
    }
}

#[inline(always)]
fn judge_one<L: Lanes>(points: &FlatPoints, position: Vec3, hit: Candidate) -> Verdict {
    L::call(JudgeOne { points, position, hit, lanes: PhantomData::<L> })
}

/// What the points around a hit say.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Enclosed,
    Outside,
    /// One should look farther around; if that has been done, it is or is not enclosed.
    Sparse {
        is_enclosed: bool,
    },
}

impl Verdict {
    fn new<L: Lanes>(surroundings: &Surroundings<L>) -> Self {
        let is_enclosed = surroundings.enclose();
        match (surroundings.is_sparse(), is_enclosed) {
            (true, is_enclosed) => Self::Sparse { is_enclosed },
            (false, true) => Self::Enclosed,
            (false, false) => Self::Outside,
        }
    }

    /// Once one has looked as far around as one will.
    fn is_final_yes(self) -> bool {
        matches!(self, Self::Enclosed | Self::Sparse { is_enclosed: true })
    }
}

struct JudgeOne<'p, L> {
    points: &'p FlatPoints,
    position: Vec3,
    hit: Candidate,
    lanes: PhantomData<L>,
}

impl<L: Lanes> Task for JudgeOne<'_, L> {
    type Output = Verdict;

    #[inline(always)]
    fn run(self) -> Verdict {
        let Self { points, position, hit, .. } = self;
        let mut found = Neighborhood { position, surroundings: Surroundings::<L>::new(hit) };
        let reach = Vec3::splat(NEIGHBOR_REACH * hit.radius);
        let region = Aabb { min: position - reach, max: position + reach };
        within::<L>(points, &region, &mut found);
        Verdict::new(&found.surroundings)
    }
}

struct Neighborhood<L: Lanes> {
    position: Vec3,
    surroundings: Surroundings<L>,
}

impl<L: Lanes> RegionVisitor for Neighborhood<L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
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

/// The `lanes` in which hits are enclosed. Hits close to each other share the way through the tree.
///
/// A hit that is enclosed by the points in the blocks of the discs that its ray pierces is not looked at any
/// further. `sightings` are these, sorted by slot; there need not be any.
#[inline(always)]
pub fn enclosed<L: Lanes>(
    points: &FlatPoints,
    sightings: &[Sighting],
    lanes: u32,
    hits: &WideHits<L::Wide>,
) -> u32 {
    L::call(JudgeWide::<L> { points, sightings, lanes, hits })
}

struct JudgeWide<'p, L: Lanes> {
    points: &'p FlatPoints,
    sightings: &'p [Sighting],
    lanes: u32,
    hits: &'p WideHits<L::Wide>,
}

impl<L: Lanes> Task for JudgeWide<'_, L> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        let Self { points, sightings, mut lanes, hits } = self;
        let mut enclosed = 0;
        if !sightings.is_empty() {
            enclosed = lanes & enclosed_by_blocks::<L>(points, sightings, hits);
            lanes &= !enclosed;
        }
        let mut hits = *hits;
        for is_last in [false, true] {
            let verdicts = judge_by_groups::<L>(points, lanes, &hits, is_last);
            enclosed |= verdicts.enclosed;
            lanes = verdicts.sparse;
            if lanes == 0 {
                break;
            }
            hits.radius = L::Wide::splat(WIDER) * hits.radius;
        }
        enclosed
    }
}

/// The lanes of which this is known.
#[derive(Clone, Copy, Default)]
struct LaneVerdicts {
    enclosed: u32,
    /// One should look farther around; there are none once this has been done.
    sparse: u32,
}

impl LaneVerdicts {
    #[inline(always)]
    fn set(&mut self, lane: usize, verdict: Verdict, is_last: bool) {
        if is_last {
            self.enclosed |= u32::from(verdict.is_final_yes()) << lane;
        } else {
            self.enclosed |= u32::from(verdict == Verdict::Enclosed) << lane;
            self.sparse |= u32::from(matches!(verdict, Verdict::Sparse { .. })) << lane;
        }
    }
}

#[inline(always)]
fn judge_by_groups<L: Lanes>(
    points: &FlatPoints,
    mut lanes: u32,
    hits: &WideHits<L::Wide>,
    is_last: bool,
) -> LaneVerdicts {
    let [x, y, z] = hits.position.store_wide();
    let radii = hits.radius.store();
    let mut verdicts = LaneVerdicts::default();
    while lanes != 0 {
        let first = lanes.trailing_zeros() as usize % WIDE;
        let center = Vec3::new(x[first], y[first], z[first]);
        let mut group = 1 << first | lanes & hits.near(center, SPREAD * radii[first]);
        lanes &= !group;
        if FEWEST_TOGETHER <= group.count_ones() {
            judge_group::<L>(points, group, hits, is_last, &mut verdicts);
            continue;
        }
        while group != 0 {
            let lane = group.trailing_zeros() as usize % WIDE;
            group &= group - 1;
            let (position, hit) = hits.in_lane(lane);
            verdicts.set(lane, judge_one::<L>(points, position, hit), is_last);
        }
    }
    verdicts
}

/// The hits that are enclosed by the points in the blocks that their rays sight.
#[inline(always)]
fn enclosed_by_blocks<L: Lanes>(
    points: &FlatPoints,
    sightings: &[Sighting],
    hits: &WideHits<L::Wide>,
) -> u32 {
    let mut vicinities = Vicinities::new(Candidates::new(hits.normal, hits.direction, hits.radius));
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
        show_block::<L>(block, all, &hits.position, lanes, &mut vicinities);
    }
    vicinities.judge().enclosed
}

/// Shows these points of a block to the hits in `lanes`.
#[inline(always)]
fn show_block<L: Lanes>(
    block: &PointBlock,
    mut points: u32,
    position: &Vec3Lanes<L::Wide>,
    lanes: <L::Wide as Floats>::Mask,
    vicinities: &mut Vicinities<L::Wide>,
) {
    let corner = Vec3Lanes::splat(block.corner()).minus(*position);
    let (offsets, normals) = (block.offsets::<L>().store(), block.normals::<L>().store());
    while points != 0 {
        let lane = points.trailing_zeros() as usize % LANES;
        points &= points - 1;
        let offset = Vec3Lanes {
            x: corner.x + L::Wide::splat(offsets[0][lane]),
            y: corner.y + L::Wide::splat(offsets[1][lane]),
            z: corner.z + L::Wide::splat(offsets[2][lane]),
        };
        let normal = Vec3Lanes {
            x: L::Wide::splat(normals[0][lane]),
            y: L::Wide::splat(normals[1][lane]),
            z: L::Wide::splat(normals[2][lane]),
        };
        vicinities.add(offset, normal, lanes);
    }
}

#[inline(always)]
fn judge_group<L: Lanes>(
    points: &FlatPoints,
    group: u32,
    hits: &WideHits<L::Wide>,
    is_last: bool,
    verdicts: &mut LaneVerdicts,
) {
    let candidates = Candidates::new(hits.normal, hits.direction, hits.radius);
    let region = hits.region(group);
    let mut found = Neighborhoods::<L> {
        position: hits.position,
        region,
        vicinities: Vicinities::new(candidates),
        blocks: [0; MAX_BLOCKS],
        n_blocks: 0,
    };
    within::<L>(points, &region, &mut found);
    let known = found.vicinities.judge();
    verdicts.enclosed |= group & known.enclosed;
    let mut doubtful = group & !(known.enclosed | known.outside);
    if !is_last {
        verdicts.sparse |= doubtful & known.sparse;
        doubtful &= !known.sparse;
    }
    while doubtful != 0 {
        let lane = doubtful.trailing_zeros() as usize % WIDE;
        doubtful &= doubtful - 1;
        verdicts.set(lane, found.judge_exactly(points, hits.in_lane(lane)), is_last);
    }
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
        let Vec3Lanes { x, y, z } = self.position;
        for (axis, position) in [x, y, z].into_iter().enumerate() {
            let (low, high) = ((position - reach).store(), (position + reach).store());
            let mut left = lanes;
            while left != 0 {
                let lane = left.trailing_zeros() as usize % WIDE;
                left &= left - 1;
                region.min[axis] = region.min[axis].min(low[lane]);
                region.max[axis] = region.max[axis].max(high[lane]);
            }
        }
        let rounding = Vec3::splat(ROUNDING * region.min.abs().max(region.max.abs()).max_element());
        Aabb { min: region.min - rounding, max: region.max + rounding }
    }

    /// Place and candidate.
    #[inline(always)]
    fn in_lane(&self, lane: usize) -> (Vec3, Candidate) {
        let vector =
            |rows: [[f32; WIDE]; 3]| Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
        let candidate = Candidate {
            normal: vector(self.normal.store_wide()),
            direction: vector(self.direction.store_wide()),
            radius: self.radius.store()[lane],
        };
        (vector(self.position.store_wide()), candidate)
    }
}

struct Neighborhoods<L: Lanes> {
    position: Vec3Lanes<L::Wide>,
    region: Aabb,
    vicinities: Vicinities<L::Wide>,
    /// Those seen, if there is room.
    blocks: [u32; MAX_BLOCKS],
    n_blocks: usize,
}

impl<L: Lanes> Neighborhoods<L> {
    /// By angles instead of sectors.
    #[inline(always)]
    fn judge_exactly(&self, points: &FlatPoints, (position, hit): (Vec3, Candidate)) -> Verdict {
        let Some(blocks) = self.blocks.get(..self.n_blocks) else {
            return judge_one::<L>(points, position, hit);
        };
        let mut surroundings = Surroundings::<L>::new(hit);
        for block_idx in blocks {
            surroundings.add(&points.blocks[*block_idx as usize].points(position));
        }
        Verdict::new(&surroundings)
    }
}

impl<L: Lanes> RegionVisitor for Neighborhoods<L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = &points.blocks[block_idx as usize];
        let inside = block.lanes_within::<L>(&self.region);
        if inside == 0 {
            return;
        }
        if let Some(place) = self.blocks.get_mut(self.n_blocks) {
            *place = block_idx;
        }
        self.n_blocks += 1;
        let all = L::Wide::splat(0.0).less_equal(L::Wide::splat(0.0));
        show_block::<L>(block, inside, &self.position, all, &mut self.vicinities);
    }
}
