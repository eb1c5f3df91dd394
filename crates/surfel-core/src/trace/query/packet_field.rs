//! The field of weighted planes along the rays of a packet in a leaf. It finds what `RayField` finds for each ray, bit by
//! bit: sums have the order of the leaf's points.

use crate::flat::{FieldLeaf, FlatCloud};
use crate::math::{LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Vec3, Vec3Lanes, set_bits};
use crate::surface::{FIELD_SUPPORT, FieldSums, support_weight};
use crate::trace::counts::{Counted, count};
use crate::trace::query::edge_test::lane_mask;
use crate::trace::query::ray_field::{
    BRACKET_MARGIN, LINEAR_STEP, N_SAMPLES, ShadedPoint, ShadingSums, signs,
};
use crate::trace::query::smooth_query::unit;
use crate::trace::simd::packet_rays::PacketRays;

/// The points of a leaf near the rays of a packet. The memory is reused from leaf to leaf.
pub struct PacketField<W> {
    points: Vec<PacketPoint<W>>,
}

struct PacketPoint<W> {
    /// Square of the distance from the segments' starts, infinite where the point has no weight.
    squared: W,
    twice_along: W,
    height: W,
    slope: W,
    point: ShadedPoint,
}

/// Zeros of the field on the rays of a packet.
pub struct PacketZeros<W> {
    /// Lanes in which a zero was found.
    pub found: u32,
    /// Lanes that have to be searched one by one.
    pub open: u32,
    /// Distances along the rays.
    pub distances: [f32; PACKET_WIDTH],
    /// Sums over the points at the zeros.
    pub sums: ShadingSums<W>,
}

/// The interval of each ray in which the field may be zero.
struct Brackets<W: PacketLanes> {
    from: W,
    step: W,
    support: W,
    lanes: W::Mask,
}

/// The first change of the field's sign on each ray.
struct Crossings<W> {
    lanes: u32,
    roots: W,
    slopes: W,
}

impl<W: PacketLanes> PacketField<W> {
    /// Returns the field of no leaf.
    pub fn new() -> Self {
        Self { points: Vec::new() }
    }

    /// Finds the first zeros in the segments of rays from `start` on.
    #[inline(always)]
    pub fn first_zeros<L: Lanes<PacketLanes = W>, const HAS_COLORS: bool>(
        &mut self,
        cloud: &FlatCloud,
        leaf: &FieldLeaf,
        rays: &PacketRays<W>,
        lanes: u32,
        segment: (W, W),
    ) -> PacketZeros<W> {
        let brackets = self.collect::<L>(cloud, leaf, rays, lanes, segment);
        let is_coarse = (W::splat(LINEAR_STEP) * brackets.support).lt(brackets.step);
        let crossings = self.first_crossings(&brackets, rays, segment.0, is_coarse);
        let distance = segment.0 + crossings.roots;
        let ready = crossings.lanes & !is_coarse.bits();
        let mut sums = ShadingSums::new();
        let mut found = 0;
        if ready != 0 {
            let position = rays.origin().plus(rays.direction().scaled(distance));
            for point in &self.points {
                let near = point.squared.lt(W::splat(f32::INFINITY));
                sums.add::<HAS_COLORS>(cloud, &point.point, &position, near);
            }
            let rises = sums.normal.dot(rays.direction()) * crossings.slopes;
            found = ready & !rises.lt(W::splat(0.0)).bits();
        }
        let open = crossings.lanes & !found;
        PacketZeros { found, open, distances: distance.store(), sums }
    }

    #[inline(always)]
    fn collect<L: Lanes<PacketLanes = W>>(
        &mut self,
        cloud: &FlatCloud,
        leaf: &FieldLeaf,
        rays: &PacketRays<W>,
        lanes: u32,
        (start, length): (W, W),
    ) -> Brackets<W> {
        self.points.clear();
        let lanes = lane_mask::<W>(lanes);
        let (zero, one, infinite) = (W::splat(0.0), W::splat(1.0), W::splat(f32::INFINITY));
        let minus_infinite = W::splat(f32::NEG_INFINITY);
        let direction = rays.direction();
        let origin = rays.origin().plus(direction.scaled(start));
        let (mut min, mut max) = ([infinite; 2], [minus_infinite; 2]);
        let (mut first, mut last, mut first_inverse) = (infinite, minus_infinite, zero);
        for (entry, block_idx) in leaf.blocks.iter().enumerate() {
            let block = &cloud.points.blocks[*block_idx as usize];
            let support = L::splat(FIELD_SUPPORT) * block.radii::<L>();
            let inverses = (L::splat(1.0) / (support * support)).store();
            let normals = unit(block.normals::<L>()).scaled(signs::<L>(leaf.flips[entry])).store();
            let offsets = block.offsets::<L>().store();
            let corner = Vec3Lanes::splat(block.corner()).minus(origin);
            for lane in set_bits::<LANES>(leaf.lanes[entry].into()) {
                let center = corner.plus(Vec3Lanes::splat_lane(&offsets, lane));
                let normal = Vec3Lanes::splat_lane(&normals, lane);
                let inverse = W::splat(inverses[lane]);
                let (along, squared) = (center.dot(direction), center.dot(center));
                let nearest = along.max(zero).min(length);
                let least = squared - nearest * (along + along - nearest);
                let near = lanes & (least * inverse).lt(one);
                if near.bits() == 0 {
                    continue;
                }
                let (height, slope) = (zero - normal.dot(center), normal.dot(direction));
                let end = height + length * slope;
                min = [
                    W::select(near, height, infinite).min(min[0]),
                    W::select(near, end, infinite).min(min[1]),
                ];
                max = [
                    W::select(near, height, minus_infinite).max(max[0]),
                    W::select(near, end, minus_infinite).max(max[1]),
                ];
                let crossing = (zero - height) / slope;
                let (is_ahead, is_before_end) = (zero.le(crossing), crossing.le(length));
                first = W::select(near & is_ahead, crossing, infinite).min(first);
                last = W::select(near & is_before_end, crossing, minus_infinite).max(last);
                let is_first = near & first_inverse.le(zero);
                first_inverse = W::select(is_first, inverse, first_inverse);
                self.points.push(PacketPoint {
                    squared: W::select(near, squared, infinite),
                    twice_along: along + along,
                    height,
                    slope,
                    point: ShadedPoint {
                        corner: block.corner(),
                        offset: column(&offsets, lane),
                        normal: column(&normals, lane),
                        inverse_support_squared: inverses[lane],
                        slot: block_idx * LANES as u32 + lane as u32,
                    },
                });
            }
        }
        let has_both_signs = [min[0].le(zero) & zero.le(max[0]), min[1].le(zero) & zero.le(max[1])];
        let from = W::select(has_both_signs[0], zero, first);
        let to = W::select(has_both_signs[1], length, last);
        let support = one / first_inverse.sqrt();
        let margin = W::splat(BRACKET_MARGIN) * support;
        let lanes = lanes & zero.lt(first_inverse) & from.le(to);
        let (from, to) = (from - margin, to + margin);
        let step = (to - from) / W::splat((N_SAMPLES - 1) as f32);
        Brackets { from, step, support, lanes }
    }

    /// Finds the first changes of sign in the rays' ranges, or anywhere on rays whose samples are coarse.
    #[inline(always)]
    fn first_crossings(
        &self,
        brackets: &Brackets<W>,
        rays: &PacketRays<W>,
        start: W,
        is_coarse: W::Mask,
    ) -> Crossings<W> {
        let Brackets { from, step, lanes, .. } = *brackets;
        let zero = W::splat(0.0);
        let (mut roots, mut slopes, mut found) = (zero, zero, 0);
        let mut low = from;
        let (mut before, mut was_valid) = self.value(low);
        for i in 1..N_SAMPLES {
            if found == lanes.bits() {
                break;
            }
            let high = from + step * W::splat(i as f32);
            let (after, is_valid) = self.value(high);
            let changes = zero.lt(before) & after.le(zero) | before.le(zero) & zero.lt(after);
            let root = low + (high - low) * (before / (before - after));
            let distance = start + root;
            let in_range = rays.t_min.le(distance) & distance.le(rays.t_max);
            let counts = lanes & (is_coarse | in_range) & lane_mask::<W>(!found);
            let is_new = counts & was_valid & is_valid & changes;
            roots = W::select(is_new, root, roots);
            slopes = W::select(is_new, after - before, slopes);
            found |= is_new.bits();
            (low, before, was_valid) = (high, after, is_valid);
        }
        Crossings { lanes: found, roots, slopes }
    }

    /// Returns the field at the distance `t` of each ray.
    #[inline(always)]
    fn value(&self, t: W) -> (W, W::Mask) {
        count(Counted::Terms, PACKET_WIDTH * self.points.len());
        let mut sums = FieldSums::new();
        for point in &self.points {
            let distance = point.squared - t * (point.twice_along - t);
            let inverse = W::splat(point.point.inverse_support_squared);
            sums.add(support_weight(distance, inverse), point.height + t * point.slope);
        }
        sums.value()
    }
}

fn column(rows: &[[f32; LANES]; 3], lane: usize) -> Vec3 {
    Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane])
}
