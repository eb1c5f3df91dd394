//! Whether any shape lies in each ray's range, each point on its own.

use super::batch::{Query, ask};
use super::block::{BeforePacket, BlockHits, Leaf, Worth};
use super::flight::RayVisitor;
use super::hit::Hit;
use super::packet::{Packet, PacketVisitor, WideRays};
use crate::flat::{FlatCloud, FlatTriangles, Slot};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, WIDE, Wide};
use crate::surface::{Disc, Sphere, Triangle};
use std::marker::PhantomData;
use std::ops::ControlFlow;

/// Says which hits count.
pub trait Judge: Copy {
    /// Whether all do.
    const IS_LENIENT: bool;

    #[inline(always)]
    fn counts<L: Lanes>(&self, _ray: &Ray, _hit: &Hit) -> bool {
        true
    }

    /// Of rays in `lanes`, each of which hits the shape at its slot, those for which that counts.
    #[inline(always)]
    fn counting<L: Lanes>(
        &self,
        _rays: &WideRays<L::Wide>,
        lanes: u32,
        _distances: L::Wide,
        _slots: &[Slot; WIDE],
    ) -> u32 {
        lanes
    }
}

/// Every hit counts.
#[derive(Clone, Copy)]
pub struct Lenient;

impl Judge for Lenient {
    const IS_LENIENT: bool = true;
}

#[inline(always)]
pub(super) fn any_hits<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.surface.is_oriented() {
        any_that_counts::<L, Disc, _>(&cloud.points, rays, Lenient, occluded);
    } else {
        any_that_counts::<L, Sphere, _>(&cloud.points, rays, Lenient, occluded);
    }
}

/// Whether any triangle lies in each ray's range.
#[inline(always)]
pub(super) fn any_triangles<L: Lanes>(
    triangles: &FlatTriangles,
    rays: &[Ray],
    occluded: &mut [bool],
) {
    any_that_counts::<L, Triangle, _>(triangles, rays, Lenient, occluded);
}

#[inline(always)]
pub(super) fn any_that_counts<L: Lanes, S: Leaf, J: Judge>(
    tree: &S::Tree,
    rays: &[Ray],
    judge: J,
    occluded: &mut [bool],
) {
    ask::<L, _>(Any { judge, shape: PhantomData::<S> }, tree, rays, occluded);
}

/// Asks whether anything that counts is hit.
struct Any<S, J> {
    judge: J,
    shape: PhantomData<S>,
}

impl<L: Lanes, S: Leaf, J: Judge> Query<L> for Any<S, J> {
    type Tree = S::Tree;
    type Answer = bool;
    type Alone<'r> = AnyAlone<'r, S, J>;
    type InPacket<'p> = AnyInPacket<'p, L, S, J>;
    const ENDS_MEET: bool = true;

    #[inline(always)]
    fn alone<'r>(&self, ray: &'r Ray) -> AnyAlone<'r, S, J> {
        AnyAlone { ray, judge: self.judge, shape: PhantomData, is_hit: false }
    }

    #[inline(always)]
    fn in_packet<'p>(&self, packet: &'p Packet<'p, L::Wide>) -> AnyInPacket<'p, L, S, J> {
        let (lines, limits) = (S::lines(&packet.wide), packet.limits());
        AnyInPacket { packet, judge: self.judge, lines, limits, is_hit: 0 }
    }

    #[inline(always)]
    fn answer(found: &AnyAlone<S, J>) -> bool {
        found.is_hit
    }

    #[inline(always)]
    fn answer_all(found: &AnyInPacket<L, S, J>, occluded: &mut [bool]) {
        for (lane, occluded) in occluded.iter_mut().enumerate() {
            *occluded = found.is_hit >> lane & 1 == 1;
        }
    }
}

struct AnyAlone<'r, S, J> {
    ray: &'r Ray,
    judge: J,
    shape: PhantomData<S>,
    is_hit: bool,
}

impl<S: Leaf, J: Judge> RayVisitor for AnyAlone<'_, S, J> {
    type Tree = S::Tree;
    const IS_ORDERED: bool = false;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.t_max
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, tree: &S::Tree, block_idx: u32) -> ControlFlow<()> {
        let seen = S::seen_from::<L>(tree, block_idx, self.ray.origin);
        let hits = S::hits(&seen, block_idx, self.ray);
        if J::IS_LENIENT {
            self.is_hit = hits.lanes(self.ray.t_max) != 0;
        } else {
            self.is_hit = has_counting::<L, J>(&hits, self.ray, self.ray.t_max, self.judge);
        }
        if self.is_hit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[inline(always)]
fn has_counting<L: Lanes, J: Judge>(hits: &BlockHits<L>, ray: &Ray, limit: f32, judge: J) -> bool {
    let mut hits = hits.up_to(limit);
    while let Some((hit, _)) = hits.next() {
        if judge.counts::<L>(ray, &hit) {
            return true;
        }
    }
    false
}

struct AnyInPacket<'p, L: Lanes, S: Leaf, J> {
    packet: &'p Packet<'p, L::Wide>,
    judge: J,
    lines: S::Lines<L::Wide>,
    /// Below all distances for rays that have hit something.
    limits: [f32; WIDE],
    is_hit: u32,
}

impl<L: Lanes, S: Leaf, J: Judge> AnyInPacket<'_, L, S, J> {
    /// The rays in these lanes need nothing more.
    #[inline(always)]
    fn finish(&mut self, mut lanes: u32) {
        self.is_hit |= lanes;
        while lanes != 0 {
            self.limits[lanes.trailing_zeros() as usize % WIDE] = f32::NEG_INFINITY;
            lanes &= lanes - 1;
        }
    }

    /// Judges one hit of each ray at a time: to judge many at once costs little more than one.
    #[inline(always)]
    fn visit_with_judge(&mut self, block: &S::BeforePacket<L>, block_idx: u32) {
        let limits = L::Wide::load(&self.limits);
        let mut found = [([0.0; WIDE], 0); LANES];
        let mut open = 0;
        for (lane, found) in found.iter_mut().enumerate() {
            let (distance, mask) = block.intersect(&self.lines, lane);
            let lanes = (mask & distance.less_equal(limits)).bits();
            *found = (distance.store(), lanes);
            open |= lanes;
        }
        while open != 0 {
            let (mut distances, mut slots, mut judged) = ([0.0; WIDE], [0; WIDE], 0);
            for (place, (found, lanes)) in found.iter_mut().enumerate() {
                let mut now = *lanes & open & !judged;
                judged |= now;
                *lanes &= !now;
                while now != 0 {
                    let lane = now.trailing_zeros() as usize % WIDE;
                    now &= now - 1;
                    distances[lane] = found[lane];
                    slots[lane] = block_idx * LANES as u32 + place as u32;
                }
            }
            if judged == 0 {
                return;
            }
            let distances = L::Wide::load(&distances);
            let counting = self.judge.counting::<L>(&self.packet.wide, judged, distances, &slots);
            self.finish(counting);
            open = judged & !counting;
        }
    }
}

impl<L: Lanes, S: Leaf, J: Judge> PacketVisitor<L> for AnyInPacket<'_, L, S, J> {
    type Tree = S::Tree;
    const IS_ORDERED: bool = false;
    const FEW_RAYS: f32 = 0.0;

    #[inline(always)]
    fn limits(&self) -> &[f32; WIDE] {
        &self.limits
    }

    #[inline(always)]
    fn visit(&mut self, tree: &S::Tree, block_idx: u32) {
        let block = S::before_packet::<L>(tree, block_idx, self.packet);
        if !J::IS_LENIENT {
            self.visit_with_judge(&block, block_idx);
            return;
        }
        let mut limits = L::Wide::load(&self.limits);
        let blocked = L::Wide::splat(f32::NEG_INFINITY);
        let mut lanes = match block.worth_trying() {
            Worth::All => (1 << LANES) - 1,
            Worth::These(lanes) => lanes,
        };
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            lanes &= lanes - 1;
            let (distance, mask) = block.intersect(&self.lines, lane);
            let hits = mask & distance.less_equal(limits);
            self.is_hit |= hits.bits();
            limits = L::Wide::select(hits, blocked, limits);
        }
        self.limits = limits.store();
    }

    #[inline(always)]
    fn visit_alone(&mut self, tree: &S::Tree, block_idx: u32, lane: usize) {
        let (ray, limit) = (&self.packet.rays[lane], self.limits[lane]);
        let seen = S::seen_from::<L>(tree, block_idx, ray.origin);
        let hits = S::hits(&seen, block_idx, ray);
        if has_counting::<L, J>(&hits, ray, limit, self.judge) {
            self.finish(1 << lane);
        }
    }
}
