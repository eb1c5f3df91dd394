//! The smooth surface along rays: from the disc that a ray hits to the sphere fitted to the points around.

use crate::flat::{FlatCloud, FlatPoints, PointBlock, Slot};
use crate::math::{
    Aabb, Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, SimdTask, Vec3, Vec3Lanes,
    set_bits,
};
use crate::surface::{
    CandidateHitLanes, ColorSums, EdgeTest, EdgeTestResult, FIT_REACH, FitPoint, LEAVING_DISTANCE,
    MAX_EXACT_TERMS, NeighborhoodStats, OverhangSums, PointSums, SUPPORT_FACTOR, SphereSums,
};
use crate::trace::counts::{Counted, count};
use crate::trace::query::edge_test::{PacketCandidates, enclosed_lanes, lane_mask};
use crate::trace::query::hit::NearestHits;
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::traversal::region::{BoxVisitor, query_box};
use std::marker::PhantomData;

/// Maximum number of fits along a ray, each at the intersection with the sphere before.
pub const MAX_FITS: usize = 5;
/// Distance between a fit's position and its intersection, in radii, at which the intersection is the surface.
pub const TOLERANCE: f32 = 0.01;
/// Maximum distance of the last fit from its intersection, in radii: a ray with a longer one has found no surface.
pub const MAX_LAST_STEP: f32 = 0.2;
/// Maximum distance along the ray between the disc that was hit and the surface, in radii.
pub const MAX_DISTANCE_FROM_DISC: f32 = 1.0;

/// Surface points of up to sixteen rays.
#[derive(Clone, Copy)]
pub struct SmoothHits<W> {
    /// Lanes of the rays that hit the surface.
    pub lanes: u32,
    /// Distances along the rays.
    pub distances: W,
    /// Unit normals, facing the rays' origins.
    pub normals: Vec3Lanes<W>,
    /// Linear colours.
    pub colors: Vec3Lanes<W>,
    /// Slots of the points nearest to the hits, each in its radii, as bits.
    pub slots: W,
}

/// Finds where rays hit the surface near the discs that they hit. The memory is reused from packet to packet.
pub struct SmoothTracer<'s> {
    cloud: &'s FlatCloud,
    blocks: Vec<StoredBlock>,
}

impl<'s> SmoothTracer<'s> {
    /// Returns a tracer of the cloud's smooth surface.
    pub fn new(cloud: &'s FlatCloud) -> Self {
        Self { cloud, blocks: Vec::new() }
    }

    /// Finds for those `lanes` whose rays hit the discs in `slots` at `distances` where they hit the surface, with
    /// the colours there.
    #[inline(always)]
    pub fn trace<L: Lanes>(
        &mut self,
        rays: &PacketRays<L::PacketLanes>,
        lanes: u32,
        distances: L::PacketLanes,
        slots: &[Slot; PACKET_WIDTH],
    ) -> SmoothHits<L::PacketLanes> {
        let Self { cloud, blocks } = self;
        let may_leave = false;
        L::dispatch(FindSurface::<L, true> {
            cloud,
            blocks,
            rays,
            lanes,
            distances,
            slots,
            may_leave,
        })
    }
}

/// The search for the surface along the rays of a packet, with colours or without.
pub(super) struct FindSurface<'a, L: Lanes, const HAS_COLORS: bool> {
    pub(super) cloud: &'a FlatCloud,
    pub(super) blocks: &'a mut Vec<StoredBlock>,
    pub(super) rays: &'a PacketRays<L::PacketLanes>,
    pub(super) lanes: u32,
    pub(super) distances: L::PacketLanes,
    pub(super) slots: &'a [Slot; PACKET_WIDTH],
    /// True if discs count for nothing through which rays leave the surface at their origins.
    pub(super) may_leave: bool,
}

impl<L: Lanes, const HAS_COLORS: bool> SimdTask for FindSurface<'_, L, HAS_COLORS> {
    type Output = SmoothHits<L::PacketLanes>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { cloud, blocks, rays, lanes, distances, slots, may_leave } = self;
        let (candidates, is_from_behind) = candidates(&cloud.points, rays, lanes, distances, slots);
        let mut hits = SmoothHits {
            lanes: 0,
            distances,
            normals: candidates.normal,
            colors: Vec3Lanes::splat(Vec3::ZERO),
            slots: L::PacketLanes::load(&slots.map(f32::from_bits)),
        };
        let is_near = distances.lt(L::PacketLanes::splat(LEAVING_DISTANCE) * candidates.radius);
        let leaving = if may_leave { (is_near & is_from_behind).bits() } else { 0 };
        let mut left = lanes & !leaving;
        while left != 0 {
            let group = candidates.group_of_first(left);
            left &= !group;
            let region = candidates.region_along_rays(group, FIT_REACH, MAX_DISTANCE_FROM_DISC);
            collect_blocks::<L>(&cloud.points, &region, blocks);
            let (found, inside) = approach(blocks, rays, &candidates, group, &mut hits);
            finish::<L, HAS_COLORS>(cloud, blocks, rays, &candidates, &inside, found, &mut hits);
        }
        hits
    }
}

/// Returns the hits of rays on discs, and where rays reach them from behind.
#[inline(always)]
fn candidates<W: PacketLanes>(
    points: &FlatPoints,
    rays: &PacketRays<W>,
    lanes: u32,
    distances: W,
    slots: &[Slot; PACKET_WIDTH],
) -> (PacketCandidates<W>, W::Mask) {
    let (mut normals, mut radii) = ([[0.0; PACKET_WIDTH]; 3], [1.0; PACKET_WIDTH]);
    for lane in set_bits::<PACKET_WIDTH>(lanes) {
        let normal = points.normal(slots[lane]);
        [normals[0][lane], normals[1][lane], normals[2][lane]] = normal.to_array();
        radii[lane] = points.radius(slots[lane]);
    }
    let (normal, direction) = (Vec3Lanes::load_packet(&normals), rays.direction());
    let candidates = PacketCandidates {
        position: rays.origin().plus(direction.scaled(distances)),
        normal: facing(normal, direction),
        direction,
        radius: W::load(&radii),
    };
    (candidates, W::splat(0.0).lt(normal.dot(direction)))
}

/// Moves hits of a group along their rays to the surface, and returns the lanes that reach it and the means of the points
/// of their last fits.
#[inline(always)]
fn approach<W: PacketLanes>(
    blocks: &[StoredBlock],
    rays: &PacketRays<W>,
    candidates: &PacketCandidates<W>,
    group: u32,
    hits: &mut SmoothHits<W>,
) -> (u32, Vec3Lanes<W>) {
    let PacketCandidates { direction, radius, .. } = *candidates;
    let start = hits.distances;
    let (mut open, mut found) = (group, 0);
    let mut position = candidates.position;
    let mut last_step = W::splat(0.0);
    let mut inside = position;
    for fit in 1..=MAX_FITS {
        let lanes = lane_mask::<W>(open);
        let mut sums = SphereSums::new(hits.normals, radius);
        for block in blocks {
            let corner = block.corner_from(&position);
            for lane in set_bits::<LANES>(block.lanes) {
                let point = block.point(&corner, lane);
                let near = lanes & sums.is_near(&point);
                if near.bits() != 0 {
                    count(Counted::Terms, PACKET_WIDTH);
                    sums.add(&point, near);
                }
            }
        }
        let sphere = sums.intersect(direction);
        let step = damped(sphere.step, last_step);
        last_step = step;
        let distance = hits.distances + step;
        let is_near = (distance - start).abs().le(W::splat(MAX_DISTANCE_FROM_DISC) * radius);
        let moved = lanes & sphere.is_hit & is_near;
        inside = Vec3Lanes::select(moved, position.plus(sums.mean_offset()), inside);
        hits.distances = W::select(moved, distance, hits.distances);
        hits.normals = Vec3Lanes::select(moved, facing(sphere.normal, direction), hits.normals);
        position = rays.origin().plus(direction.scaled(hits.distances));
        let tolerance = if fit == MAX_FITS { MAX_LAST_STEP } else { TOLERANCE };
        let converged = moved & sphere.step.abs().le(W::splat(tolerance) * radius);
        found |= converged.bits();
        open &= moved.bits() & !converged.bits();
        if open == 0 {
            break;
        }
    }
    let in_range = rays.t_min.le(hits.distances) & hits.distances.le(rays.t_max);
    (found & in_range.bits(), inside)
}

/// Adds the hits in `lanes` that the points enclose, with their nearest points and colours.
#[inline(always)]
fn finish<L: Lanes, const HAS_COLORS: bool>(
    cloud: &FlatCloud,
    blocks: &[StoredBlock],
    rays: &PacketRays<L::PacketLanes>,
    candidates: &PacketCandidates<L::PacketLanes>,
    inside: &Vec3Lanes<L::PacketLanes>,
    lanes: u32,
    hits: &mut SmoothHits<L::PacketLanes>,
) {
    if lanes == 0 {
        return;
    }
    let PacketCandidates { direction, radius, .. } = *candidates;
    let position = rays.origin().plus(direction.scaled(hits.distances));
    let mask = lane_mask::<L::PacketLanes>(lanes);
    // A fitted sphere has no rim that sticks out beyond a bend and shows its back.
    let candidates = CandidateHitLanes::new(hits.normals, direction, radius);
    let mut neighborhood = NeighborhoodStats::<_, false>::new(candidates);
    let mut overhang = OverhangSums::new(hits.normals, inside.minus(position), radius);
    let mut colors = ColorSums::default();
    let mut nearest =
        NearestHits { distances: L::PacketLanes::splat(f32::INFINITY), slots: hits.slots };
    for block in blocks {
        let corner = block.corner_from(&position);
        for lane in set_bits::<LANES>(block.lanes) {
            let point = block.point(&corner, lane);
            let is_near = mask & overhang.is_near(&point);
            if is_near.bits() == 0 {
                continue;
            }
            let is_neighbor = is_near & neighborhood.is_neighbor(point.offset);
            if is_neighbor.bits() != 0 {
                let normal = Vec3Lanes::splat_lane(&block.normals, lane);
                neighborhood.add(point.offset, normal, is_neighbor);
            }
            overhang.add(&point, is_near);
            if HAS_COLORS {
                let slot = block.first_slot + lane as u32;
                if cloud.blends_colors {
                    let color = cloud.points.surfel(slot).color;
                    colors.add(&point, Vec3Lanes::splat(color), is_near);
                }
                let slot = L::PacketLanes::splat(f32::from_bits(slot));
                // A wide disc's neighbours reach less far than it does.
                let distance = point.offset.dot(point.offset) * point.inverse_support_squared;
                nearest.merge(is_near, distance, slot);
            }
        }
    }
    let mut accepted = lanes;
    if cloud.edge_test != EdgeTest::Off {
        let lanes = lanes & !overhang.sticks_out().bits();
        let EdgeTestResult { enclosed, sparse } = neighborhood.evaluate();
        accepted = lanes & enclosed & !sparse;
        let open = lanes & !accepted;
        if open != 0 {
            let radius = L::PacketLanes::splat(cloud.edge_retest_factor) * radius;
            let hits = PacketCandidates { position, normal: hits.normals, direction, radius };
            accepted |= enclosed_lanes::<L, false>(&cloud.points, open, &hits);
        }
    }
    hits.lanes |= accepted;
    if HAS_COLORS {
        hits.slots = L::PacketLanes::select(mask, nearest.slots, hits.slots);
        let slots = nearest.slots.store().map(f32::to_bits);
        let mean = colors.mean(colors_of(&cloud.points, &slots, accepted));
        hits.colors = Vec3Lanes::select(mask, mean, hits.colors);
    }
}

/// Returns the colours of the discs in these lanes, and zero in all others.
#[inline(always)]
fn colors_of<W: PacketLanes>(
    points: &FlatPoints,
    slots: &[Slot; PACKET_WIDTH],
    lanes: u32,
) -> Vec3Lanes<W> {
    let mut colors = [[0.0; PACKET_WIDTH]; 3];
    for lane in set_bits::<PACKET_WIDTH>(lanes) {
        let color = points.surfel(slots[lane]).color;
        [colors[0][lane], colors[1][lane], colors[2][lane]] = color.to_array();
    }
    Vec3Lanes::load_packet(&colors)
}

/// Returns a step along the ray after another one. Where it would turn back, steps could go to and fro around a bend:
/// then it ends at the root of the line through both (the secant method).
#[inline(always)]
pub(super) fn damped<F: Floats>(step: F, last_step: F) -> F {
    let turns_back = (step * last_step).lt(F::splat(0.0));
    F::select(turns_back, step * last_step / (last_step - step), step)
}

/// Returns the normals turned against the directions.
#[inline(always)]
fn facing<F: Floats>(normal: Vec3Lanes<F>, direction: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let is_away = F::splat(0.0).lt(normal.dot(direction));
    normal.scaled(F::select(is_away, F::splat(-1.0), F::splat(1.0)))
}

/// A decoded block, whose points are read one by one.
pub struct StoredBlock {
    /// Lanes of the points in the region.
    lanes: u32,
    first_slot: Slot,
    corner: Vec3,
    offsets: [[f32; LANES]; 3],
    /// Normals with integer components.
    normals: [[f32; LANES]; 3],
    unit_normals: [[f32; LANES]; 3],
    inverse_supports_squared: [f32; LANES],
}

impl StoredBlock {
    #[inline(always)]
    fn new<L: Lanes>(block: &PointBlock, block_idx: u32, lanes: u32) -> Self {
        let normals = block.normals::<L>();
        Self {
            lanes,
            first_slot: block_idx * LANES as u32,
            corner: block.corner(),
            offsets: block.offsets::<L>().store(),
            normals: normals.store(),
            unit_normals: unit(normals).store(),
            inverse_supports_squared: inverse_support_squared(block.radii::<L>()).store(),
        }
    }

    #[inline(always)]
    fn corner_from<F: Floats>(&self, position: &Vec3Lanes<F>) -> Vec3Lanes<F> {
        Vec3Lanes::splat(self.corner).minus(*position)
    }

    #[inline(always)]
    fn point<F: Floats>(&self, corner: &Vec3Lanes<F>, lane: usize) -> FitPoint<F> {
        FitPoint {
            offset: corner.plus(Vec3Lanes::splat_lane(&self.offsets, lane)),
            normal: Vec3Lanes::splat_lane(&self.unit_normals, lane),
            inverse_support_squared: F::splat(self.inverse_supports_squared[lane]),
        }
    }
}

/// Returns normals of unit length. Those of unused lanes are zero and stay so.
#[inline(always)]
pub(super) fn unit<F: Floats>(normal: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let squared = normal.dot(normal).max(F::splat(1.0));
    normal.scaled(F::splat(1.0) / squared.sqrt())
}

#[inline(always)]
pub(super) fn inverse_support_squared<F: Floats>(radius: F) -> F {
    let support = F::splat(SUPPORT_FACTOR) * radius;
    F::splat(1.0) / (support * support)
}

/// Replaces `blocks` by those with points in a region.
#[inline(always)]
fn collect_blocks<L: Lanes>(points: &FlatPoints, region: &Aabb, blocks: &mut Vec<StoredBlock>) {
    blocks.clear();
    query_box::<L>(points, region, &mut BlockCollector::<L> { region, blocks, lanes: PhantomData });
    if MAX_EXACT_TERMS < LANES * blocks.len() {
        sort_by_slot(blocks);
    }
}

/// Sorts blocks into an order that does not depend on the region in which they were found, for sums that are not exact.
#[cold]
fn sort_by_slot(blocks: &mut [StoredBlock]) {
    blocks.sort_unstable_by_key(|block| block.first_slot);
}

struct BlockCollector<'a, L> {
    region: &'a Aabb,
    blocks: &'a mut Vec<StoredBlock>,
    lanes: PhantomData<L>,
}

impl<L: Lanes> BoxVisitor for BlockCollector<'_, L> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = &points.blocks[block_idx as usize];
        let inside = block.lanes_within::<L>(self.region);
        if inside != 0 {
            self.blocks.push(StoredBlock::new::<L>(block, block_idx, inside));
        }
    }
}
