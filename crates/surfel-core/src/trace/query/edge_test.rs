//! The angular-gap test of hits against the points around them.

use crate::flat::{FlatPoints, PointBlock};
use crate::math::{
    Aabb, Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, SimdTask, Vec3, Vec3Lanes,
    set_bits,
};
use crate::surface::{
    CandidateHit, CandidateHitLanes, EdgeTestResult, NEIGHBORHOOD_RADIUS_FACTOR, NeighborhoodStats,
};
use crate::trace::counts::{Counted, count};
use crate::trace::query::packet_disc_hits::PacketDiscHit;
use crate::trace::traversal::region::{BoxVisitor, query_box};
use std::marker::PhantomData;

/// Factor on the radius of a neighbourhood for the second try, if the first one holds too few points.
pub const RETRY_RADIUS_FACTOR: f32 = 2.0;
/// Maximum distance of positions that share a traversal of the tree from the first one along any axis, in radii.
const MAX_GROUP_SPREAD: f32 = 2.0;
/// Minimum number of hits that are tested as a group; fewer are tested one by one.
const MIN_GROUP_SIZE: u32 = 3;
/// Allowance for the rounding of coordinates, relative to them.
const ROUNDING: f32 = 1e-6;

/// True if the points around a hit at `position` enclose it.
#[inline(always)]
pub fn is_enclosed<L: Lanes, const BACKFACES: bool>(
    points: &FlatPoints,
    position: Vec3,
    hit: CandidateHit,
) -> bool {
    let mut result = evaluate_one::<L, BACKFACES>(points, position, hit);
    if result.sparse != 0 {
        let hit = CandidateHit { radius: RETRY_RADIUS_FACTOR * hit.radius, ..hit };
        result = evaluate_one::<L, BACKFACES>(points, position, hit);
    }
    result.enclosed != 0
}

/// Evaluates the points around a single hit. Its results are bit 0.
#[inline(always)]
pub fn evaluate_one<L: Lanes, const BACKFACES: bool>(
    points: &FlatPoints,
    position: Vec3,
    hit: CandidateHit,
) -> EdgeTestResult {
    L::dispatch(EvaluateOne::<L, BACKFACES> { points, position, hit, lanes: PhantomData })
}

struct EvaluateOne<'p, L, const BACKFACES: bool> {
    points: &'p FlatPoints,
    position: Vec3,
    hit: CandidateHit,
    lanes: PhantomData<L>,
}

impl<L: Lanes, const BACKFACES: bool> SimdTask for EvaluateOne<'_, L, BACKFACES> {
    type Output = EdgeTestResult;

    #[inline(always)]
    fn run(self) -> EdgeTestResult {
        let Self { points, position, hit, .. } = self;
        let mut found = SingleHitVisitor::<L, BACKFACES> {
            position,
            stats: NeighborhoodStats::new(CandidateHitLanes::splat(&hit)),
        };
        let reach = Vec3::splat(NEIGHBORHOOD_RADIUS_FACTOR * hit.radius);
        let region = Aabb { min: position - reach, max: position + reach };
        query_box::<L>(points, &region, &mut found);
        let EdgeTestResult { enclosed, sparse } = found.stats.reduce_lanes().evaluate();
        EdgeTestResult { enclosed: enclosed & 1, sparse: sparse & 1 }
    }
}

/// Adds points to the statistics of one hit, eight at a time, one per lane.
struct SingleHitVisitor<L: Lanes, const BACKFACES: bool> {
    position: Vec3,
    stats: NeighborhoodStats<L, BACKFACES>,
}

impl<L: Lanes, const BACKFACES: bool> BoxVisitor for SingleHitVisitor<L, BACKFACES> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let points = points.blocks[block_idx as usize].points::<L>(self.position);
        let is_near = self.stats.is_neighbor(points.center) & L::splat(0.0).lt(points.radius);
        if is_near.bits() != 0 {
            count(Counted::EdgePoints, LANES);
            self.stats.add(points.center, points.normal, is_near);
        }
    }
}

/// The hits of up to sixteen rays, which are tested at once.
#[derive(Clone, Copy)]
pub struct PacketCandidates<W> {
    /// Positions of the hits.
    pub position: Vec3Lanes<W>,
    /// Unit normals, facing the rays' origins.
    pub normal: Vec3Lanes<W>,
    /// Unit directions of the rays.
    pub direction: Vec3Lanes<W>,
    /// Radii of the discs that were hit.
    pub radius: W,
}

/// Returns those `lanes` whose hits are enclosed already by the points in the blocks of the discs that their
/// rays hit. On even surfaces they are most. `discs` are sorted by slot.
#[inline(always)]
pub fn enclosed_by_blocks<L: Lanes, const BACKFACES: bool>(
    points: &FlatPoints,
    discs: &[PacketDiscHit],
    lanes: u32,
    hits: &PacketCandidates<L::PacketLanes>,
) -> u32 {
    lanes & L::dispatch(EvaluateByBlocks::<L, BACKFACES> { points, discs, hits })
}

struct EvaluateByBlocks<'p, L: Lanes, const BACKFACES: bool> {
    points: &'p FlatPoints,
    discs: &'p [PacketDiscHit],
    hits: &'p PacketCandidates<L::PacketLanes>,
}

impl<L: Lanes, const BACKFACES: bool> SimdTask for EvaluateByBlocks<'_, L, BACKFACES> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        let Self { points, discs, hits } = self;
        let mut found = NeighborhoodStats::<_, BACKFACES>::new(hits.candidates());
        let block_of = |i: usize| discs[i].slot / LANES as u32;
        let mut first = 0;
        while first < discs.len() {
            let block_idx = block_of(first);
            let mut lanes = discs[first].hit_mask::<L::PacketLanes>();
            first += 1;
            while first < discs.len() && block_of(first) == block_idx {
                lanes = lanes | discs[first].hit_mask::<L::PacketLanes>();
                first += 1;
            }
            let block = &points.blocks[block_idx as usize];
            let all = L::splat(0.0).lt(block.radii()).bits();
            add_block::<L, BACKFACES>(block, all, &hits.position, lanes, &mut found);
        }
        let EdgeTestResult { enclosed, sparse } = found.evaluate();
        enclosed & !sparse
    }
}

/// Returns those `lanes` whose hits are enclosed. Hits close to each other share a traversal of the tree.
#[inline(always)]
pub fn enclosed_lanes<L: Lanes, const BACKFACES: bool>(
    points: &FlatPoints,
    lanes: u32,
    hits: &PacketCandidates<L::PacketLanes>,
) -> u32 {
    L::dispatch(EvaluatePacket::<L, BACKFACES> { points, lanes, hits })
}

struct EvaluatePacket<'p, L: Lanes, const BACKFACES: bool> {
    points: &'p FlatPoints,
    lanes: u32,
    hits: &'p PacketCandidates<L::PacketLanes>,
}

impl<L: Lanes, const BACKFACES: bool> SimdTask for EvaluatePacket<'_, L, BACKFACES> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        let Self { points, lanes, hits } = self;
        let EdgeTestResult { mut enclosed, sparse } =
            evaluate_in_groups::<L, BACKFACES>(points, lanes, hits);
        if sparse != 0 {
            let hits = PacketCandidates {
                radius: L::PacketLanes::splat(RETRY_RADIUS_FACTOR) * hits.radius,
                ..*hits
            };
            let wider = evaluate_in_groups::<L, BACKFACES>(points, sparse, &hits);
            enclosed = enclosed & !sparse | wider.enclosed;
        }
        enclosed
    }
}

#[inline(always)]
fn evaluate_in_groups<L: Lanes, const BACKFACES: bool>(
    points: &FlatPoints,
    mut lanes: u32,
    hits: &PacketCandidates<L::PacketLanes>,
) -> EdgeTestResult {
    let stored = hits.store();
    let mut result = EdgeTestResult { enclosed: 0, sparse: 0 };
    while lanes != 0 {
        let group = hits.group_of_first(lanes);
        lanes &= !group;
        if MIN_GROUP_SIZE <= group.count_ones() {
            let EdgeTestResult { enclosed, sparse } =
                evaluate_group::<L, BACKFACES>(points, group, hits);
            result.enclosed |= group & enclosed;
            result.sparse |= group & sparse;
            continue;
        }
        for lane in set_bits::<PACKET_WIDTH>(group) {
            let (position, hit) = stored.in_lane(lane);
            let EdgeTestResult { enclosed, sparse } =
                evaluate_one::<L, BACKFACES>(points, position, hit);
            result.enclosed |= enclosed << lane;
            result.sparse |= sparse << lane;
        }
    }
    result
}

/// Adds the points of a block, given by a mask, to the statistics of the hits in `lanes`.
#[inline(always)]
fn add_block<L: Lanes, const BACKFACES: bool>(
    block: &PointBlock,
    points: u32,
    position: &Vec3Lanes<L::PacketLanes>,
    lanes: <L::PacketLanes as Floats>::Mask,
    found: &mut NeighborhoodStats<L::PacketLanes, BACKFACES>,
) {
    let corner = Vec3Lanes::splat(block.corner()).minus(*position);
    let (offsets, normals) = (block.offsets::<L>().store(), block.normals::<L>().store());
    for lane in set_bits::<LANES>(points) {
        let offset = corner.plus(Vec3Lanes::splat_lane(&offsets, lane));
        let is_near = lanes & found.is_neighbor(offset);
        if is_near.bits() != 0 {
            count(Counted::EdgePoints, PACKET_WIDTH);
            found.add(offset, Vec3Lanes::splat_lane(&normals, lane), is_near);
        }
    }
}

#[inline(always)]
fn evaluate_group<L: Lanes, const BACKFACES: bool>(
    points: &FlatPoints,
    group: u32,
    hits: &PacketCandidates<L::PacketLanes>,
) -> EdgeTestResult {
    let region = hits.region(group, NEIGHBORHOOD_RADIUS_FACTOR);
    let mut found = GroupVisitor::<L, BACKFACES> {
        position: hits.position,
        region,
        stats: NeighborhoodStats::new(hits.candidates()),
    };
    query_box::<L>(points, &region, &mut found);
    found.stats.evaluate()
}

impl<W: PacketLanes> PacketCandidates<W> {
    /// Loads one to sixteen hits. The last one also fills the lanes that are left.
    #[inline(always)]
    pub fn new(hits: &[(Vec3, CandidateHit)]) -> Self {
        let rows = [[0.0; PACKET_WIDTH]; 3];
        let mut stored = StoredCandidates {
            position: rows,
            normal: rows,
            direction: rows,
            radius: [0.0; PACKET_WIDTH],
        };
        for lane in 0..PACKET_WIDTH {
            let (position, hit) = &hits[lane.min(hits.len() - 1)];
            stored.radius[lane] = hit.radius;
            for axis in 0..3 {
                stored.position[axis][lane] = position[axis];
                stored.normal[axis][lane] = hit.normal[axis];
                stored.direction[axis][lane] = hit.direction[axis];
            }
        }
        Self {
            position: Vec3Lanes::load_packet(&stored.position),
            normal: Vec3Lanes::load_packet(&stored.normal),
            direction: Vec3Lanes::load_packet(&stored.direction),
            radius: W::load(&stored.radius),
        }
    }

    #[inline(always)]
    fn candidates(&self) -> CandidateHitLanes<W> {
        CandidateHitLanes::new(self.normal, self.direction, self.radius)
    }

    /// Returns the lanes within a distance of `center` along each axis.
    #[inline(always)]
    fn near(&self, center: Vec3, distance: f32) -> u32 {
        let offset = self.position.minus(Vec3Lanes::splat(center));
        let offset = offset.x.abs().max(offset.y.abs()).max(offset.z.abs());
        offset.le(W::splat(distance)).bits()
    }

    /// Returns the lanes of the first hit of `lanes` and of those near it, which share a traversal of the tree.
    #[inline(always)]
    pub fn group_of_first(&self, lanes: u32) -> u32 {
        let first = lanes.trailing_zeros() as usize % PACKET_WIDTH;
        let [x, y, z] = self.position.store_packet();
        let center = Vec3::new(x[first], y[first], z[first]);
        1 << first | lanes & self.near(center, MAX_GROUP_SPREAD * self.radius.store()[first])
    }

    /// Returns the box around the neighbourhoods of the hits in `lanes`, which reach `reach` radii far.
    #[inline(always)]
    pub fn region(&self, lanes: u32, reach: f32) -> Aabb {
        self.region_along_rays(lanes, reach, 0.0)
    }

    /// Returns the box around all neighbourhoods of `reach` radii about positions on the rays in `lanes`, up to
    /// `distance` radii before and behind the hits.
    #[inline(always)]
    pub fn region_along_rays(&self, lanes: u32, reach: f32, distance: f32) -> Aabb {
        let lanes = lane_mask::<W>(lanes);
        let (none_low, none_high) = (W::splat(f32::INFINITY), W::splat(f32::NEG_INFINITY));
        let Vec3Lanes { x, y, z } = self.position;
        let Vec3Lanes { x: to_x, y: to_y, z: to_z } = self.direction;
        let mut region = Aabb::EMPTY;
        for (axis, (position, direction)) in
            [(x, to_x), (y, to_y), (z, to_z)].into_iter().enumerate()
        {
            let reach = (W::splat(reach) + W::splat(distance) * direction.abs()) * self.radius;
            region.min[axis] = W::select(lanes, position - reach, none_low).reduce_min();
            region.max[axis] = W::select(lanes, position + reach, none_high).reduce_max();
        }
        let rounding = Vec3::splat(ROUNDING * region.min.abs().max(region.max.abs()).max_element());
        Aabb { min: region.min - rounding, max: region.max + rounding }
    }

    #[inline(always)]
    fn store(&self) -> StoredCandidates {
        StoredCandidates {
            position: self.position.store_packet(),
            normal: self.normal.store_packet(),
            direction: self.direction.store_packet(),
            radius: self.radius.store(),
        }
    }
}

/// Returns the mask of these lanes.
#[inline(always)]
pub fn lane_mask<W: PacketLanes>(lanes: u32) -> W::Mask {
    let mut is_set = [0.0; PACKET_WIDTH];
    for (lane, is_set) in is_set.iter_mut().enumerate() {
        *is_set = (lanes >> lane & 1) as f32;
    }
    W::splat(0.0).lt(W::load(&is_set))
}

/// The hits of up to sixteen rays, from which single ones can be read.
struct StoredCandidates {
    position: [[f32; PACKET_WIDTH]; 3],
    normal: [[f32; PACKET_WIDTH]; 3],
    direction: [[f32; PACKET_WIDTH]; 3],
    radius: [f32; PACKET_WIDTH],
}

impl StoredCandidates {
    /// Returns the position and the properties of one hit.
    #[inline(always)]
    fn in_lane(&self, lane: usize) -> (Vec3, CandidateHit) {
        let vector = |rows: &[[f32; PACKET_WIDTH]; 3]| {
            Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane])
        };
        let candidate = CandidateHit {
            normal: vector(&self.normal),
            direction: vector(&self.direction),
            radius: self.radius[lane],
        };
        (vector(&self.position), candidate)
    }
}

/// Adds points to the statistics of up to sixteen hits, one point at a time.
struct GroupVisitor<L: Lanes, const BACKFACES: bool> {
    position: Vec3Lanes<L::PacketLanes>,
    region: Aabb,
    stats: NeighborhoodStats<L::PacketLanes, BACKFACES>,
}

impl<L: Lanes, const BACKFACES: bool> BoxVisitor for GroupVisitor<L, BACKFACES> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = &points.blocks[block_idx as usize];
        let inside = block.lanes_within::<L>(&self.region);
        if inside != 0 {
            let all = L::PacketLanes::splat(0.0).le(L::PacketLanes::splat(0.0));
            add_block::<L, _>(block, inside, &self.position, all, &mut self.stats);
        }
    }
}
