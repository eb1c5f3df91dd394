//! The nearest shape on each ray, each point on its own.

use super::batch::{Query, ask};
use super::block::{BeforePacket, Leaf, Worth};
use super::flight::RayVisitor;
use super::hit::Hit;
use super::packet::{Packet, PacketVisitor};
use crate::flat::{FlatCloud, FlatTriangles};
use crate::math::{Floats, LANES, Lanes, Ray, WIDE, Wide};
use crate::surface::{Disc, Sphere, Triangle};
use std::marker::PhantomData;
use std::ops::ControlFlow;

#[inline(always)]
pub(super) fn closest_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [Hit]) {
    if cloud.surface.is_oriented() {
        ask::<L, _>(Closest::<Disc>(PhantomData), &cloud.points, rays, hits);
    } else {
        ask::<L, _>(Closest::<Sphere>(PhantomData), &cloud.points, rays, hits);
    }
}

/// The nearest triangle on each ray.
#[inline(always)]
pub(super) fn closest_triangles<L: Lanes>(
    triangles: &FlatTriangles,
    rays: &[Ray],
    hits: &mut [Hit],
) {
    ask::<L, _>(Closest::<Triangle>(PhantomData), triangles, rays, hits);
}

/// Asks for the nearest shape.
struct Closest<S>(PhantomData<S>);

impl<L: Lanes, S: Leaf> Query<L> for Closest<S> {
    type Tree = S::Tree;
    type Answer = Hit;
    type Alone<'r> = ClosestAlone<'r, S>;
    type InPacket<'p> = ClosestInPacket<'p, L, S>;
    const ENDS_MEET: bool = false;

    #[inline(always)]
    fn alone<'r>(&self, ray: &'r Ray) -> ClosestAlone<'r, S> {
        let hit = Hit { distance: ray.t_max + 0.0, ..Hit::MISS };
        ClosestAlone { ray, shape: PhantomData, hit }
    }

    #[inline(always)]
    fn in_packet<'p>(&self, packet: &'p Packet<'p, L::Wide>) -> ClosestInPacket<'p, L, S> {
        ClosestInPacket {
            packet,
            lines: S::lines(&packet.wide),
            distances: packet.limits(),
            slots: [f32::from_bits(Hit::MISS.slot); WIDE],
        }
    }

    #[inline(always)]
    fn answer(found: &ClosestAlone<S>) -> Hit {
        if found.hit.is_miss() { Hit::MISS } else { found.hit }
    }

    /// All sixteen at once where there are so many: one by one they took a twentieth of the time of camera
    /// rays.
    #[inline(always)]
    fn answer_all(found: &ClosestInPacket<L, S>, hits: &mut [Hit]) {
        let ClosestInPacket { distances, slots, .. } = found;
        let is_hit = L::Wide::load(slots).less_bits(L::Wide::splat(f32::from_bits(Hit::MISS.slot)));
        // Of the two zeros the positive one.
        let distances = L::Wide::load(distances) + L::Wide::splat(0.0);
        let miss = L::Wide::splat(Hit::MISS.distance);
        let distances = L::Wide::select(is_hit, distances, miss).store();
        if let Some(hits) = hits.first_chunk_mut::<WIDE>() {
            for lane in 0..WIDE {
                hits[lane] = Hit { distance: distances[lane], slot: slots[lane].to_bits() };
            }
            return;
        }
        for (lane, hit) in hits.iter_mut().enumerate() {
            *hit = Hit { distance: distances[lane], slot: slots[lane].to_bits() };
        }
    }
}

struct ClosestAlone<'r, S> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    hit: Hit,
}

impl<S: Leaf> RayVisitor for ClosestAlone<'_, S> {
    type Tree = S::Tree;
    const IS_ORDERED: bool = true;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.hit.distance
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, tree: &S::Tree, block_idx: u32) -> ControlFlow<()> {
        let seen = S::seen_from::<L>(tree, block_idx, self.ray.origin);
        let hit = S::hits(&seen, block_idx, self.ray).nearest();
        self.hit = hit.nearer(self.hit);
        ControlFlow::Continue(())
    }
}

#[inline(always)]
fn try_lane<L: Lanes, S: Leaf>(
    block: &S::BeforePacket<L>,
    lines: &S::Lines<L::Wide>,
    lane: usize,
    slot: u32,
    distances: &mut L::Wide,
    slots: &mut L::Wide,
) {
    let slot = L::Wide::splat(f32::from_bits(slot));
    let (distance, mask) = block.intersect(lines, lane);
    let is_first = distance.less(*distances) | slot.less_bits(*slots);
    let closer = mask & distance.less_equal(*distances) & is_first;
    *slots = L::Wide::select(closer, slot, *slots);
    *distances = L::Wide::select(closer, distance, *distances);
}

struct ClosestInPacket<'p, L: Lanes, S: Leaf> {
    packet: &'p Packet<'p, L::Wide>,
    lines: S::Lines<L::Wide>,
    distances: [f32; WIDE],
    /// As the bits of floats, which is how lanes hold them.
    slots: [f32; WIDE],
}

impl<L: Lanes, S: Leaf> ClosestInPacket<'_, L, S> {
    /// Keeps what the ray in `lane` meets of a block, if it is nearer.
    #[inline(always)]
    fn meet(&mut self, seen: &S::Seen<L>, block_idx: u32, lane: usize) {
        let hit = Hit { distance: self.distances[lane] + 0.0, slot: self.slots[lane].to_bits() };
        let hit = S::hits(seen, block_idx, &self.packet.rays[lane]).nearest().nearer(hit);
        self.distances[lane] = hit.distance;
        self.slots[lane] = f32::from_bits(hit.slot);
    }
}

impl<L: Lanes, S: Leaf> PacketVisitor<L> for ClosestInPacket<'_, L, S> {
    type Tree = S::Tree;
    const IS_ORDERED: bool = true;
    const MAY_BE_SPARSE: bool = true;

    #[inline(always)]
    fn limits(&self) -> &[f32; WIDE] {
        &self.distances
    }

    #[inline(always)]
    fn visit(&mut self, tree: &S::Tree, block_idx: u32) {
        let block = S::before_packet::<L>(tree, block_idx, self.packet);
        let mut distances = L::Wide::load(&self.distances);
        let mut slots = L::Wide::load(&self.slots);
        match block.worth_trying() {
            // No branch: whether a disc is hit cannot be foretold, and on a plane all are equally near.
            Worth::All => {
                for lane in 0..LANES {
                    let slot = block_idx * LANES as u32 + lane as u32;
                    try_lane::<L, S>(&block, &self.lines, lane, slot, &mut distances, &mut slots);
                }
            }
            Worth::These(mut lanes) => {
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES;
                    lanes &= lanes - 1;
                    let slot = block_idx * LANES as u32 + lane as u32;
                    try_lane::<L, S>(&block, &self.lines, lane, slot, &mut distances, &mut slots);
                }
            }
        }
        self.slots = slots.store();
        self.distances = distances.store();
    }

    #[inline(always)]
    fn visit_alone(&mut self, tree: &S::Tree, block_idx: u32, lane: usize) {
        let seen = S::seen_from::<L>(tree, block_idx, self.packet.rays[lane].origin);
        self.meet(&seen, block_idx, lane);
    }

    #[inline(always)]
    fn visit_each(&mut self, tree: &S::Tree, block_idx: u32, mut lanes: u32) {
        // Decoded once if all rays start in one place.
        let seen = match self.packet.common_origin {
            Some(origin) => Some(S::seen_from::<L>(tree, block_idx, origin)),
            None => None,
        };
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDE;
            lanes &= lanes - 1;
            match &seen {
                Some(seen) => self.meet(seen, block_idx, lane),
                None => self.visit_alone(tree, block_idx, lane),
            }
        }
    }
}
