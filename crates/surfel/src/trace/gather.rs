//! The nearest shapes on each ray, all within a radius of each other.

use super::block::{BeforePacket, Leaf};
use super::flight::{Flight, RayVisitor, fly};
use super::group::{GROUP, Group};
use super::hit::{Gather, Hit};
use super::packet::{Packet, PacketStack, PacketVisitor, along_packet};
use super::sightings::{Sighting, settle};
use crate::flat::{FlatCloud, FlatPoints};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, WIDE, Wide};
use crate::surface::{Disc, gather_limit};
use std::ops::ControlFlow;

/// Discs only: spheres do not blend.
#[inline(always)]
pub(super) fn gathers<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], gathers: &mut [Gather]) {
    let (mut stack, mut flight) = (PacketStack::new(), Flight::default());
    let mut sightings = Vec::new();
    let (points, mut group) = (&cloud.points, Group::new(false));
    for (rays, gathers) in rays.chunks(GROUP).zip(gathers.chunks_mut(GROUP)) {
        group.take::<L, _>(points, rays);
        let packets = rays.chunks(WIDE).zip(gathers.chunks_mut(WIDE));
        for (place, (rays, gathers)) in packets.enumerate() {
            sightings.clear();
            let (stack, flight) = (&mut stack, &mut flight);
            let limits = gather::<L>(points, &group, place, rays, stack, flight, &mut sightings);
            settle::<L::Wide>(&mut sightings, &limits);
            for (lane, gather) in gathers.iter_mut().enumerate() {
                *gather = gather_of_lane(&sightings, lane);
            }
        }
    }
}

/// Adds to `sightings` all discs of one to sixteen rays, which stand at `place` in a group, within limits
/// that it returns, and some beyond.
#[inline(always)]
pub(super) fn gather<L: Lanes>(
    points: &FlatPoints,
    group: &Group<L::Wide>,
    place: usize,
    rays: &[Ray],
    stack: &mut PacketStack,
    flight: &mut Flight,
    sightings: &mut Vec<Sighting>,
) -> [f32; WIDE] {
    if let Some(packet) = group.packet(points, place, rays) {
        let mut gathering =
            GatherInPacket::<L> { packet: &packet, limits: packet.limits(), sightings };
        along_packet::<L, _>(points, &packet, stack, &mut gathering);
        return gathering.limits;
    }
    let mut gatherings = [Gathering::new(&rays[0]); WIDE];
    for lane in 0..rays.len() {
        gatherings[lane] = Gathering::new(&rays[lane]);
    }
    fly::<L, _>(flight, points, &mut gatherings[..rays.len()]);
    for (lane, Gathering { gather, .. }) in gatherings[..rays.len()].iter().enumerate() {
        for hit in gather.hits() {
            sightings.push(Sighting::by_one(lane, *hit));
        }
    }
    [f32::MAX; WIDE]
}

fn gather_of_lane(sightings: &[Sighting], lane: usize) -> Gather {
    let mut gather = Gather::EMPTY;
    for Sighting { slot, distances } in sightings {
        if !distances[lane].is_nan() {
            gather.insert(Hit { distance: distances[lane], slot: *slot });
        }
    }
    gather
}

/// The discs that a ray pierces.
#[derive(Clone, Copy)]
struct Gathering<'r> {
    ray: &'r Ray,
    gather: Gather,
    limit: f32,
}

impl<'r> Gathering<'r> {
    #[inline(always)]
    fn new(ray: &'r Ray) -> Self {
        Self { ray, gather: Gather::EMPTY, limit: ray.t_max }
    }
}

impl RayVisitor for Gathering<'_> {
    type Tree = FlatPoints;
    const IS_ORDERED: bool = true;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.gather.reach().min(self.limit)
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let seen = Disc::seen_from::<L>(points, block_idx, self.ray.origin);
        let hits = Disc::hits(&seen, block_idx, self.ray);
        let mut hits = hits.up_to(self.limit());
        while let Some((hit, radius)) = hits.next() {
            if hit.distance <= self.limit {
                self.limit = self.limit.min(gather_limit(hit.distance, radius));
                self.gather.insert(hit);
                self.gather.drop_beyond(self.limit);
            }
        }
        ControlFlow::Continue(())
    }
}

/// The discs that the rays of a packet pierce. Which of them a ray keeps is known only at the end.
struct GatherInPacket<'p, L: Lanes> {
    packet: &'p Packet<'p, L::Wide>,
    limits: [f32; WIDE],
    sightings: &'p mut Vec<Sighting>,
}

impl<L: Lanes> PacketVisitor<L> for GatherInPacket<'_, L> {
    type Tree = FlatPoints;
    const IS_ORDERED: bool = true;
    const FEW_RAYS: f32 = 0.0;

    #[inline(always)]
    fn limits(&self) -> &[f32; WIDE] {
        &self.limits
    }

    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = Disc::before_packet::<L>(points, block_idx, self.packet);
        let lines = self.packet.wide.lanes();
        let mut limits = L::Wide::load(&self.limits);
        let mut end = self.sightings.len();
        self.sightings.resize(end + LANES, Sighting::NONE);
        // No branch: whether a disc is hit cannot be foretold.
        for lane in 0..LANES {
            let (distance, mask) = block.intersect(&lines, lane);
            let is_hit = mask & distance.less_equal(limits);
            let limit = gather_limit(distance, L::Wide::splat(block.radius(lane)));
            limits = L::Wide::select(is_hit, limit.min(limits), limits);
            let slot = block_idx * LANES as u32 + lane as u32;
            // Of the two zeros the positive one.
            let distance = distance + L::Wide::splat(0.0);
            let distances = L::Wide::select(is_hit, distance, L::Wide::splat(f32::NAN)).store();
            self.sightings[end] = Sighting { slot, distances };
            end += usize::from(is_hit.bits() != 0);
        }
        self.sightings.truncate(end);
        self.limits = limits.store();
    }

    #[inline(always)]
    fn visit_alone(&mut self, points: &FlatPoints, block_idx: u32, lane: usize) {
        let ray = &self.packet.rays[lane];
        let seen = Disc::seen_from::<L>(points, block_idx, ray.origin);
        let mut hits = Disc::hits(&seen, block_idx, ray).up_to(self.limits[lane]);
        while let Some((hit, radius)) = hits.next() {
            self.limits[lane] = self.limits[lane].min(gather_limit(hit.distance, radius));
            self.sightings.push(Sighting::by_one(lane, hit));
        }
    }
}
