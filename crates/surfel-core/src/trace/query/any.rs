//! Any hit of each ray.

use crate::flat::{FlatCloud, FlatTriangles, Slot};
use crate::math::{Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Ray, set_bits};
use crate::surface::{Disc, Sphere, Triangle};
use crate::trace::query::hit::Hit;
use crate::trace::query::leaf::{BlockHits, LaneSelection, LeafGeometry, PacketBlock};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::simd::{Simd, dispatch_simd};
use crate::trace::traversal::batch::{RayQuery, run_query};
use crate::trace::traversal::interleaved::RayVisitor;
use crate::trace::traversal::packet::{Packet, PacketVisitor};
use std::marker::PhantomData;
use std::ops::ControlFlow;

/// Decides which hits count.
pub trait HitFilter: Copy {
    /// Memory that is reused from packet to packet.
    type Scratch: Default;

    /// True if all hits count.
    const ACCEPTS_ALL: bool;

    /// True if the hit of a ray counts.
    #[inline(always)]
    fn accepts<L: Lanes>(&self, _ray: &Ray, _hit: &Hit) -> bool {
        true
    }

    /// Returns the mask of those rays in `lanes` whose hits, given by distance and slot, count.
    #[inline(always)]
    fn accepts_packet<L: Lanes>(
        &self,
        _scratch: &mut Self::Scratch,
        _rays: &PacketRays<L::PacketLanes>,
        lanes: u32,
        _distances: L::PacketLanes,
        _slots: &[Slot; PACKET_WIDTH],
    ) -> u32 {
        lanes
    }
}

/// A filter by which every hit counts.
#[derive(Clone, Copy)]
pub struct AcceptAll;

impl HitFilter for AcceptAll {
    type Scratch = ();
    const ACCEPTS_ALL: bool = true;
}

/// Finds out for each ray whether a point lies in its range. Each point is a disc or a sphere of its own.
pub fn any_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.points.nodes.is_empty() {
        return occluded.fill(false);
    }
    dispatch_simd!(simd, any_hits_kernel(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]));
}

/// Runs `any_hits` at the SIMD level of the kernel around it.
#[inline(always)]
pub fn any_hits_kernel<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], occluded: &mut [bool]) {
    if cloud.surface.uses_discs() {
        any_accepted_hit::<L, Disc, _>(&cloud.points, rays, AcceptAll, occluded);
    } else {
        any_accepted_hit::<L, Sphere, _>(&cloud.points, rays, AcceptAll, occluded);
    }
}

/// Finds out for each ray whether a triangle lies in its range.
pub fn any_triangles(triangles: &FlatTriangles, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    if triangles.nodes.is_empty() {
        return occluded.fill(false);
    }
    dispatch_simd!(
        simd,
        any_triangles_kernel(triangles: &FlatTriangles, rays: &[Ray], occluded: &mut [bool])
    );
}

#[inline(always)]
fn any_triangles_kernel<L: Lanes>(triangles: &FlatTriangles, rays: &[Ray], occluded: &mut [bool]) {
    any_accepted_hit::<L, Triangle, _>(triangles, rays, AcceptAll, occluded);
}

/// Finds out for each ray whether it has a hit that `filter` accepts.
#[inline(always)]
pub fn any_accepted_hit<L: Lanes, S: LeafGeometry, F: HitFilter>(
    tree: &S::Tree,
    rays: &[Ray],
    filter: F,
    occluded: &mut [bool],
) {
    let query = Any { filter, scratch: F::Scratch::default(), shape: PhantomData::<S> };
    run_query::<L, _>(query, tree, rays, occluded);
}

/// The query for any accepted hit.
struct Any<S, F: HitFilter> {
    filter: F,
    /// The memory of the filter, which the visitor of a packet has while it is alive.
    scratch: F::Scratch,
    shape: PhantomData<S>,
}

impl<L: Lanes, S: LeafGeometry, F: HitFilter> RayQuery<L> for Any<S, F> {
    type Tree = S::Tree;
    type Result = bool;
    type RayVisitor<'r> = AnyRayVisitor<'r, S, F>;
    type PacketVisitor<'p> = AnyPacketVisitor<'p, L, S, F>;
    const CONVERGES_AT_END: bool = true;
    const IS_PACKETWISE: bool = false;

    #[inline(always)]
    fn ray_visitor<'r>(&mut self, ray: &'r Ray) -> AnyRayVisitor<'r, S, F> {
        AnyRayVisitor { ray, filter: self.filter, shape: PhantomData, is_hit: false }
    }

    #[inline(always)]
    fn packet_visitor<'p>(
        &mut self,
        packet: &'p Packet<'p, L::PacketLanes>,
    ) -> AnyPacketVisitor<'p, L, S, F> {
        let (rays, limits) = (S::prepare_rays(&packet.lanes), packet.initial_limits());
        let scratch = std::mem::take(&mut self.scratch);
        AnyPacketVisitor { packet, filter: self.filter, scratch, rays, limits, is_hit: 0 }
    }

    #[inline(always)]
    fn ray_results(&mut self, visitors: &mut [AnyRayVisitor<S, F>], occluded: &mut [bool]) {
        for (visitor, occluded) in visitors.iter().zip(occluded) {
            *occluded = visitor.is_hit;
        }
    }

    #[inline(always)]
    fn packet_results(&mut self, visitor: &mut AnyPacketVisitor<L, S, F>, occluded: &mut [bool]) {
        self.scratch = std::mem::take(&mut visitor.scratch);
        for (lane, occluded) in occluded.iter_mut().enumerate() {
            *occluded = visitor.is_hit >> lane & 1 == 1;
        }
    }
}

struct AnyRayVisitor<'r, S, F> {
    ray: &'r Ray,
    filter: F,
    shape: PhantomData<S>,
    is_hit: bool,
}

impl<S: LeafGeometry, F: HitFilter> RayVisitor for AnyRayVisitor<'_, S, F> {
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
        let block = S::decode_relative_to::<L>(tree, block_idx, self.ray.origin);
        let hits = S::block_hits(&block, block_idx, self.ray);
        if F::ACCEPTS_ALL {
            self.is_hit = hits.lanes(self.ray.t_max) != 0;
        } else {
            self.is_hit = has_accepted_hit::<L, F>(&hits, self.ray, self.ray.t_max, self.filter);
        }
        if self.is_hit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[inline(always)]
fn has_accepted_hit<L: Lanes, F: HitFilter>(
    hits: &BlockHits<L>,
    ray: &Ray,
    limit: f32,
    filter: F,
) -> bool {
    for (hit, _) in hits.up_to(limit) {
        if filter.accepts::<L>(ray, &hit) {
            return true;
        }
    }
    false
}

struct AnyPacketVisitor<'p, L: Lanes, S: LeafGeometry, F: HitFilter> {
    packet: &'p Packet<'p, L::PacketLanes>,
    filter: F,
    scratch: F::Scratch,
    rays: S::PreparedRays<L::PacketLanes>,
    /// Distances beyond which rays ignore boxes, negative infinity for rays that have hit something.
    limits: [f32; PACKET_WIDTH],
    is_hit: u32,
}

impl<L: Lanes, S: LeafGeometry, F: HitFilter> AnyPacketVisitor<'_, L, S, F> {
    /// Ends the search of the rays in `lanes`.
    #[inline(always)]
    fn finish(&mut self, lanes: u32) {
        self.is_hit |= lanes;
        for lane in set_bits::<PACKET_WIDTH>(lanes) {
            self.limits[lane] = f32::NEG_INFINITY;
        }
    }

    /// Filters one hit of each ray at a time: to filter many at once costs little more than one.
    #[inline(always)]
    fn visit_with_filter(&mut self, block: &S::PacketBlock<L>, block_idx: u32) {
        let limits = L::PacketLanes::load(&self.limits);
        let mut found = [([0.0; PACKET_WIDTH], 0); LANES];
        let mut open = 0;
        for (lane, found) in found.iter_mut().enumerate() {
            let (distance, mask) = block.intersect(&self.rays, lane);
            let lanes = (mask & distance.le(limits)).bits();
            *found = (distance.store(), lanes);
            open |= lanes;
        }
        while open != 0 {
            let (mut distances, mut slots, mut filtered) =
                ([0.0; PACKET_WIDTH], [0; PACKET_WIDTH], 0);
            for (shape, (found, lanes)) in found.iter_mut().enumerate() {
                let now = *lanes & open & !filtered;
                filtered |= now;
                *lanes &= !now;
                for lane in set_bits::<PACKET_WIDTH>(now) {
                    distances[lane] = found[lane];
                    slots[lane] = block_idx * LANES as u32 + shape as u32;
                }
            }
            if filtered == 0 {
                return;
            }
            let distances = L::PacketLanes::load(&distances);
            let Self { filter, scratch, packet, .. } = self;
            let accepted =
                filter.accepts_packet::<L>(scratch, &packet.lanes, filtered, distances, &slots);
            self.finish(accepted);
            open = filtered & !accepted;
        }
    }
}

impl<L: Lanes, S: LeafGeometry, F: HitFilter> PacketVisitor<L> for AnyPacketVisitor<'_, L, S, F> {
    type Tree = S::Tree;
    const IS_ORDERED: bool = false;
    const SPARSE_THRESHOLD: f32 = 0.0;

    #[inline(always)]
    fn limits(&self) -> &[f32; PACKET_WIDTH] {
        &self.limits
    }

    #[inline(always)]
    fn visit(&mut self, tree: &S::Tree, block_idx: u32) {
        let block = S::packet_block::<L>(tree, block_idx, self.packet);
        if !F::ACCEPTS_ALL {
            self.visit_with_filter(&block, block_idx);
            return;
        }
        let mut limits = L::PacketLanes::load(&self.limits);
        let done = L::PacketLanes::splat(f32::NEG_INFINITY);
        let lanes = match block.candidate_lanes() {
            LaneSelection::All => (1 << LANES) - 1,
            LaneSelection::Mask(lanes) => lanes,
        };
        for lane in set_bits::<LANES>(lanes) {
            let (distance, mask) = block.intersect(&self.rays, lane);
            let hits = mask & distance.le(limits);
            self.is_hit |= hits.bits();
            limits = L::PacketLanes::select(hits, done, limits);
        }
        self.limits = limits.store();
    }

    #[inline(always)]
    fn visit_single(&mut self, tree: &S::Tree, block_idx: u32, lane: usize) {
        let (ray, limit) = (&self.packet.rays[lane], self.limits[lane]);
        let block = S::decode_relative_to::<L>(tree, block_idx, ray.origin);
        let hits = S::block_hits(&block, block_idx, ray);
        if has_accepted_hit::<L, F>(&hits, ray, limit, self.filter) {
            self.finish(1 << lane);
        }
    }
}
