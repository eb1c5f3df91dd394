//! The nearest shape on each ray, each point on its own.

use super::batch::{Query, ask};
use super::block::{BeforePacket, BlockHits, Leaf, Worth};
use super::flight::RayVisitor;
use super::hit::{Hit, NearestHits};
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
            slots: [NO_SLOT; WIDE],
            apart: None,
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
        let NearestHits { distances, slots } = found.nearest();
        let is_hit = slots.less_bits(L::Wide::splat(NO_SLOT));
        let slots = slots.store();
        // Of the two zeros the positive one.
        let distances = distances + L::Wide::splat(0.0);
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

/// The slot of `Hit::MISS`, as lanes hold it.
const NO_SLOT: f32 = f32::from_bits(Hit::MISS.slot);

struct ClosestInPacket<'p, L: Lanes, S: Leaf> {
    packet: &'p Packet<'p, L::Wide>,
    lines: S::Lines<L::Wide>,
    distances: [f32; WIDE],
    /// As bits; none for a ray whose nearest is in `apart`.
    slots: [f32; WIDE],
    apart: Option<HitsApart>,
}

/// The nearest hits of rays that are shown blocks alone, in each lane of their blocks. Which of its eight is a
/// ray's nearest is asked of all rays at once, after each node: asked of each ray after each block, that took
/// a fifth of the time of dense clouds.
struct HitsApart {
    distances: [[f32; LANES]; WIDE],
    slots: [[f32; LANES]; WIDE],
}

impl HitsApart {
    const NONE: Self =
        Self { distances: [[f32::INFINITY; LANES]; WIDE], slots: [[NO_SLOT; LANES]; WIDE] };

    #[inline(always)]
    fn add<L: Lanes>(&mut self, hits: &BlockHits<L>, ray: usize) {
        let (distances, slots) = (&mut self.distances[ray], &mut self.slots[ray]);
        let mut nearest = NearestHits { distances: L::load(distances), slots: L::load(slots) };
        hits.add_to(&mut nearest);
        *distances = nearest.distances.store();
        *slots = nearest.slots.store();
    }

    /// The distance of each ray's nearest.
    #[inline(always)]
    fn least<W: Wide>(&self) -> W {
        let [a, b, c, d, e, f, g, h] = W::columns(&self.distances);
        a.min(b).min(c.min(d)).min(e.min(f).min(g.min(h)))
    }

    #[inline(always)]
    fn add_to<W: Wide>(&self, nearest: &mut NearestHits<W>) {
        let (distances, slots) = (W::columns(&self.distances), W::columns(&self.slots));
        for lane in 0..LANES {
            let is_hit = slots[lane].less_bits(W::splat(NO_SLOT));
            nearest.take(is_hit, distances[lane], slots[lane]);
        }
    }
}

impl<L: Lanes, S: Leaf> ClosestInPacket<'_, L, S> {
    #[inline(always)]
    fn nearest(&self) -> NearestHits<L::Wide> {
        let (distances, slots) = (L::Wide::load(&self.distances), L::Wide::load(&self.slots));
        let mut nearest = NearestHits { distances, slots };
        if let Some(apart) = &self.apart {
            apart.add_to(&mut nearest);
        }
        nearest
    }
}

impl<L: Lanes, S: Leaf> PacketVisitor<L> for ClosestInPacket<'_, L, S> {
    type Tree = S::Tree;
    const IS_ORDERED: bool = true;
    const FEW_RAYS: f32 = S::FEW_RAYS;

    #[inline(always)]
    fn limits(&self) -> &[f32; WIDE] {
        &self.distances
    }

    #[inline(always)]
    fn visit(&mut self, tree: &S::Tree, block_idx: u32) {
        let block = S::before_packet::<L>(tree, block_idx, self.packet);
        let (distances, slots) = (L::Wide::load(&self.distances), L::Wide::load(&self.slots));
        let mut nearest = NearestHits { distances, slots };
        let first_slot = block_idx * LANES as u32;
        match block.worth_trying() {
            // No branch: whether a disc is hit cannot be foretold, and on a plane all are equally near.
            Worth::All => {
                for lane in 0..LANES {
                    try_lane::<L, S>(&block, &self.lines, lane, first_slot, &mut nearest);
                }
            }
            Worth::These(mut lanes) => {
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES;
                    lanes &= lanes - 1;
                    try_lane::<L, S>(&block, &self.lines, lane, first_slot, &mut nearest);
                }
            }
        }
        self.slots = nearest.slots.store();
        self.distances = nearest.distances.store();
    }

    #[inline(always)]
    fn visit_alone(&mut self, tree: &S::Tree, block_idx: u32, lane: usize) {
        let ray = &self.packet.rays[lane];
        let seen = S::seen_from::<L>(tree, block_idx, ray.origin);
        let hit = Hit { distance: self.distances[lane] + 0.0, slot: self.slots[lane].to_bits() };
        let hit = S::hits(&seen, block_idx, ray).nearest().nearer(hit);
        self.distances[lane] = hit.distance;
        self.slots[lane] = f32::from_bits(hit.slot);
    }

    #[inline(always)]
    fn visit_each(&mut self, tree: &S::Tree, blocks: &[(u32, u32)]) {
        let apart = self.apart.get_or_insert(HitsApart::NONE);
        for &(block_idx, mut lanes) in blocks {
            // Decoded once if all rays start in one place.
            let seen = match self.packet.common_origin {
                Some(origin) => Some(S::seen_from::<L>(tree, block_idx, origin)),
                None => None,
            };
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % WIDE;
                lanes &= lanes - 1;
                let ray = &self.packet.rays[lane];
                let hits = match &seen {
                    Some(seen) => S::hits(seen, block_idx, ray),
                    None => S::hits(&S::seen_from(tree, block_idx, ray.origin), block_idx, ray),
                };
                apart.add(&hits, lane);
            }
        }
        let least: L::Wide = apart.least();
        let (distances, slots) = (L::Wide::load(&self.distances), L::Wide::load(&self.slots));
        let slots = L::Wide::select(least.less(distances), L::Wide::splat(NO_SLOT), slots);
        self.slots = slots.store();
        self.distances = least.min(distances).store();
    }
}

#[inline(always)]
fn try_lane<L: Lanes, S: Leaf>(
    block: &S::BeforePacket<L>,
    lines: &S::Lines<L::Wide>,
    lane: usize,
    first_slot: u32,
    nearest: &mut NearestHits<L::Wide>,
) {
    let slot = L::Wide::splat(f32::from_bits(first_slot + lane as u32));
    let (distance, mask) = block.intersect(lines, lane);
    nearest.take(mask, distance, slot);
}
