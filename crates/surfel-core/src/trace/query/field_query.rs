//! The closest hits of rays on the field of weighted planes, found in its kd-tree.

use crate::flat::FlatCloud;
use crate::math::{Lanes, PACKET_WIDTH, PacketLanes, Ray, SimdTask, Vec3, set_bits};
use crate::surface::{CandidateHit, EdgeTest};
use crate::trace::query::edge_test::{PacketCandidates, enclosed_lanes};
use crate::trace::query::hit::{Hit, MAX_REJECTED_HITS, RESTART_OFFSET};
use crate::trace::query::packet_field::{PacketField, PacketZeros};
use crate::trace::query::ray_field::{FieldHit, RayField, RaySegment};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::traversal::kd_walk::{KdWalk, LeafInterval};
use std::marker::PhantomData;

/// Widening of a ray's interval in a leaf, in distances: neighbouring leaves find the zeros between them.
pub const OVERLAP: f32 = 4.0 * f32::EPSILON;

impl LeafInterval {
    /// Returns the segment of the ray in the leaf, widened a little.
    #[inline(always)]
    fn segment(&self) -> RaySegment {
        let margin = OVERLAP * self.leave;
        RaySegment { start: self.enter - margin, length: self.leave - self.enter + 2.0 * margin }
    }
}

/// Finds the closest hit of each ray that the edge test accepts.
#[inline(always)]
pub fn field_hits<L: Lanes, const HAS_COLORS: bool>(
    cloud: &FlatCloud,
    rays: &[Ray],
    hits: &mut [FieldHit],
) {
    hits.fill(FieldHit::MISS);
    let mut search = KdSearch::default();
    let mut open: Vec<u32> = (0..rays.len() as u32).collect();
    let mut rays = rays.to_vec();
    let mut found = vec![FieldHit::MISS; rays.len()];
    for _ in 0..MAX_REJECTED_HITS {
        let found = &mut found[..rays.len()];
        let task = FirstHits::<L, HAS_COLORS> {
            search: &mut search,
            cloud,
            rays: &rays,
            hits: found,
            lanes: PhantomData,
        };
        L::dispatch(task);
        let mut n_left = 0;
        for first in (0..rays.len()).step_by(PACKET_WIDTH) {
            let packet = first..rays.len().min(first + PACKET_WIDTH);
            let accepted =
                accepted_lanes::<L>(cloud, &rays[packet.clone()], &found[packet.clone()]);
            for (lane, i) in packet.enumerate() {
                let FieldHit { hit, .. } = found[i];
                if hit.is_miss() {
                    continue;
                }
                if accepted >> lane & 1 == 1 {
                    hits[open[i] as usize] = found[i];
                    continue;
                }
                let behind = hit.distance + RESTART_OFFSET * cloud.points.radius(hit.slot);
                let t_min = behind.max(hit.distance * (1.0 + 2.0 * f32::EPSILON));
                (rays[n_left], open[n_left]) = (Ray { t_min, ..rays[i] }, open[i]);
                n_left += 1;
            }
        }
        rays.truncate(n_left);
        if rays.is_empty() {
            return;
        }
    }
}

/// Returns the lanes of up to sixteen hits that the edge test accepts.
#[inline(always)]
fn accepted_lanes<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &[FieldHit]) -> u32 {
    if cloud.edge_test == EdgeTest::Off {
        return u32::MAX;
    }
    let mut lanes = 0;
    let mut candidates =
        [(Vec3::ZERO, CandidateHit { normal: Vec3::Z, direction: Vec3::Z, radius: 1.0 });
            PACKET_WIDTH];
    for (lane, (ray, FieldHit { hit, normal, .. })) in rays.iter().zip(hits).enumerate() {
        if !hit.is_miss() {
            let radius = cloud.points.radius(hit.slot);
            let candidate = CandidateHit { normal: *normal, direction: ray.direction, radius };
            candidates[lane] = (ray.at(hit.distance), candidate);
            lanes |= 1 << lane;
        }
    }
    if lanes == 0 {
        return 0;
    }
    enclosed_lanes::<L, false>(&cloud.points, lanes, &PacketCandidates::new(&candidates))
}

struct FirstHits<'a, L, const HAS_COLORS: bool> {
    search: &'a mut KdSearch,
    cloud: &'a FlatCloud,
    rays: &'a [Ray],
    hits: &'a mut [FieldHit],
    lanes: PhantomData<L>,
}

impl<L: Lanes, const HAS_COLORS: bool> SimdTask for FirstHits<'_, L, HAS_COLORS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { search, cloud, rays, hits, .. } = self;
        search.first_hits::<L, HAS_COLORS>(cloud, rays, hits);
    }
}

/// The search in the field's kd-tree, leaf by leaf. Rays of a packet that are in the same leaf are searched together.
#[derive(Default)]
struct KdSearch {
    field: RayField,
}

/// Minimum number of rays in a leaf that are searched together.
const MIN_PACKET_RAYS: u32 = 3;

impl KdSearch {
    /// Finds the first zero on each ray.
    #[inline(always)]
    fn first_hits<L: Lanes, const HAS_COLORS: bool>(
        &mut self,
        cloud: &FlatCloud,
        rays: &[Ray],
        hits: &mut [FieldHit],
    ) {
        hits.fill(FieldHit::MISS);
        let mut walks: Vec<KdWalk> = (0..PACKET_WIDTH).map(|_| KdWalk::new(&cloud.field)).collect();
        let mut packet_field = PacketField::<L::PacketLanes>::new();
        for (rays, hits) in rays.chunks(PACKET_WIDTH).zip(hits.chunks_mut(PACKET_WIDTH)) {
            let packet = PacketRays::<L::PacketLanes>::new(rays);
            let mut intervals = [LeafInterval::NONE; PACKET_WIDTH];
            let mut searching = 0;
            for (lane, ray) in rays.iter().enumerate() {
                walks[lane].start(ray);
                if let Some(interval) = walks[lane].next_leaf() {
                    intervals[lane] = interval;
                    searching |= 1 << lane;
                }
            }
            while searching != 0 {
                let group = nearest_group(&intervals, searching);
                let leaf_idx = intervals[group.trailing_zeros() as usize % PACKET_WIDTH].leaf_idx;
                let leaf = cloud.field.leaf(leaf_idx);
                let mut singles = group;
                if MIN_PACKET_RAYS <= group.count_ones() {
                    let (start, length) = segments::<L::PacketLanes>(&intervals);
                    let zeros = packet_field.first_zeros::<L, HAS_COLORS>(
                        cloud,
                        &leaf,
                        &packet,
                        group,
                        (start, length),
                    );
                    take_zeros::<L::PacketLanes, HAS_COLORS>(cloud, rays, &zeros, hits);
                    singles = zeros.open;
                }
                for lane in set_bits::<PACKET_WIDTH>(singles) {
                    let segment = intervals[lane].segment();
                    let ray = &rays[lane];
                    let first = self.field.first_hit::<L, HAS_COLORS>(cloud, &leaf, ray, segment);
                    hits[lane] = first.unwrap_or(FieldHit::MISS);
                }
                for lane in set_bits::<PACKET_WIDTH>(group) {
                    let next =
                        if hits[lane].hit.is_miss() { walks[lane].next_leaf() } else { None };
                    match next {
                        Some(interval) => intervals[lane] = interval,
                        None => searching &= !(1 << lane),
                    }
                }
            }
        }
    }
}

/// Returns the lanes of the rays in the leaf that one of them enters first.
#[inline(always)]
fn nearest_group(intervals: &[LeafInterval; PACKET_WIDTH], searching: u32) -> u32 {
    let mut first = searching.trailing_zeros() as usize % PACKET_WIDTH;
    for lane in set_bits::<PACKET_WIDTH>(searching) {
        if intervals[lane].enter < intervals[first].enter {
            first = lane;
        }
    }
    let mut group = 0;
    for lane in set_bits::<PACKET_WIDTH>(searching) {
        group |= u32::from(intervals[lane].leaf_idx == intervals[first].leaf_idx) << lane;
    }
    group
}

/// Returns starts and lengths of the segments of rays in their leaves.
#[inline(always)]
fn segments<W: PacketLanes>(intervals: &[LeafInterval; PACKET_WIDTH]) -> (W, W) {
    let (mut starts, mut lengths) = ([0.0; PACKET_WIDTH], [0.0; PACKET_WIDTH]);
    for (lane, interval) in intervals.iter().enumerate() {
        let segment = interval.segment();
        (starts[lane], lengths[lane]) = (segment.start, segment.length);
    }
    (W::load(&starts), W::load(&lengths))
}

/// Takes the zeros that were found as hits.
#[inline(always)]
fn take_zeros<W: PacketLanes, const HAS_COLORS: bool>(
    cloud: &FlatCloud,
    rays: &[Ray],
    zeros: &PacketZeros<W>,
    hits: &mut [FieldHit],
) {
    if zeros.found == 0 {
        return;
    }
    let [x, y, z] = zeros.sums.normal.store_packet();
    let [r, g, b] = zeros.sums.color.store_packet();
    let weights = zeros.sums.color_weight.store();
    let slots = zeros.sums.nearest.slots.store();
    for lane in set_bits::<PACKET_WIDTH>(zeros.found) {
        let hit = Hit { distance: zeros.distances[lane], slot: slots[lane].to_bits() };
        let normal = Vec3::new(x[lane], y[lane], z[lane]);
        let color = (Vec3::new(r[lane], g[lane], b[lane]), weights[lane]);
        hits[lane] = FieldHit::new::<HAS_COLORS>(cloud, &rays[lane], hit, normal, color);
    }
}
