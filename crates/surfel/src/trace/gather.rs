//! The nearest shapes on each ray, all within a radius of each other.

use super::block::{BlockForPacket, BlockHits};
use super::flight::fly;
use super::hit::Gather;
use super::lists::Lists;
use super::packet::{Packet, PacketStack, PacketVisitor, along_packet};
use super::traverse::{RayStack, RayVisitor, along_ray};
use crate::flat::{FlatPoints, FlatScene};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, WIDE, Wide};
use crate::surface::{Disc, gather_limit};
use std::ops::ControlFlow;

/// Discs only: spheres do not blend.
#[inline(always)]
pub(super) fn gathers<L: Lanes>(scene: &FlatScene, rays: &[Ray], gathers: &mut [Gather]) {
    let points = &scene.points;
    let mut stack = PacketStack::new();
    let mut sightings = Vec::new();
    let (mut loose, mut indices) = (Vec::new(), Vec::new());
    for (first, rays) in rays.chunks(WIDE).enumerate() {
        if let Some(packet) = Packet::new(&points.nodes[0], rays, false) {
            let gathers = &mut gathers[first * WIDE..][..rays.len()];
            gather_in_packet::<L>(points, &packet, &mut stack, &mut sightings, gathers);
            continue;
        }
        for (lane, ray) in rays.iter().enumerate() {
            loose.push(Gathering { ray, gather: Gather::up_to(ray.t_max) });
            indices.push(first * WIDE + lane);
        }
    }
    fly::<L, _>(points, &mut loose);
    for (ray_idx, Gathering { gather, .. }) in indices.into_iter().zip(loose) {
        gathers[ray_idx] = gather;
    }
}

struct Gathering<'r> {
    ray: &'r Ray,
    gather: Gather,
}

impl RayVisitor for Gathering<'_> {
    const IS_ORDERED: bool = true;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.gather.reach()
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let reach = self.gather.reach();
        let mut hits = BlockHits::<L>::find::<Disc>(points, block_idx, self.ray).up_to(reach);
        while let Some((hit, radius)) = hits.next() {
            self.gather.insert(hit, radius);
        }
        ControlFlow::Continue(())
    }
}

/// A disc that rays of a packet hit. Which of them keep it is known only when the nearest is.
#[derive(Clone, Copy)]
struct Sighting {
    distances: [f32; WIDE],
    lanes: u32,
    slot: u32,
}

#[inline(always)]
fn gather_in_packet<L: Lanes>(
    points: &FlatPoints,
    packet: &Packet<L::Wide>,
    stack: &mut PacketStack,
    sightings: &mut Vec<Sighting>,
    gathers: &mut [Gather],
) {
    sightings.clear();
    let mut gathering = GatherInPacket::<L> { packet, limits: packet.limits(), sightings };
    along_packet::<L, true>(points, packet, stack, &mut gathering);
    let limits = gathering.limits;
    let mut lists = Lists::new();
    for sighting in sightings {
        let kept = L::Wide::load(&sighting.distances).less_equal(L::Wide::load(&limits));
        lists.add(kept.bits() & sighting.lanes, &sighting.distances, sighting.slot);
    }
    lists.sort::<L::Wide>();
    for (lane, gather) in gathers.iter_mut().enumerate() {
        lists.copy_to(lane, gather);
    }
}

struct GatherInPacket<'p, L: Lanes> {
    packet: &'p Packet<'p, L::Wide>,
    limits: [f32; WIDE],
    sightings: &'p mut Vec<Sighting>,
}

impl<L: Lanes> PacketVisitor<L> for GatherInPacket<'_, L> {
    #[inline(always)]
    fn limits(&self) -> &[f32; WIDE] {
        &self.limits
    }

    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = BlockForPacket::<L>::new(&points.blocks[block_idx as usize], self.packet);
        let mut limits = L::Wide::load(&self.limits);
        for lane in 0..LANES {
            let (distance, mask) = block.intersect::<Disc>(lane);
            let hits = mask & distance.less_equal(limits);
            let lanes = hits.bits();
            if lanes == 0 {
                continue;
            }
            let limit = distance + L::Wide::splat(block.radius(lane));
            limits = L::Wide::select(hits, limit.min(limits), limits);
            let slot = block_idx * LANES as u32 + lane as u32;
            self.sightings.push(Sighting { distances: distance.store(), lanes, slot });
        }
        self.limits = limits.store();
    }

    #[inline(always)]
    fn visit_alone(&mut self, points: &FlatPoints, block_idx: u32, lane: usize) {
        let ray = &self.packet.rays[lane];
        let hits = BlockHits::<L>::find::<Disc>(points, block_idx, ray);
        let mut hits = hits.up_to(self.limits[lane]);
        while let Some((hit, radius)) = hits.next() {
            self.limits[lane] = self.limits[lane].min(gather_limit(hit.distance, radius));
            let mut distances = [0.0; WIDE];
            distances[lane] = hit.distance;
            self.sightings.push(Sighting { distances, lanes: 1 << lane, slot: hit.slot });
        }
    }
}

/// One ray that is not part of a packet.
#[inline(always)]
pub(super) fn gather<L: Lanes>(points: &FlatPoints, ray: &Ray, stack: &mut RayStack) -> Gather {
    let mut gathering = Gathering { ray, gather: Gather::up_to(ray.t_max) };
    along_ray::<L>(points, ray, stack, &mut gathering);
    gathering.gather
}
