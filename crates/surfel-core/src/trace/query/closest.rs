//! The closest hit of each ray.

use crate::flat::{FlatCloud, FlatTriangles};
use crate::math::{Floats, LANES, Lanes, PACKET_WIDTH, PacketLanes, Ray, set_bits};
use crate::surface::{Disc, Sphere, Triangle};
use crate::trace::query::hit::{Hit, NearestHits};
use crate::trace::query::leaf::{BlockHits, LaneSelection, LeafGeometry, PacketBlock};
use crate::trace::simd::{Simd, dispatch_simd};
use crate::trace::traversal::batch::{RayQuery, run_query};
use crate::trace::traversal::interleaved::RayVisitor;
use crate::trace::traversal::packet::{Packet, PacketVisitor};
use std::marker::PhantomData;
use std::ops::ControlFlow;

/// Finds the closest point on each ray. Each point is a disc or a sphere of its own.
pub fn closest_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], hits: &mut [Hit]) {
    if cloud.points.nodes.is_empty() {
        return hits.fill(Hit::MISS);
    }
    dispatch_simd!(simd, closest_hits_kernel(cloud: &FlatCloud, rays: &[Ray], hits: &mut [Hit]));
}

/// Runs `closest_hits` at the SIMD level of the kernel around it.
#[inline(always)]
pub fn closest_hits_kernel<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [Hit]) {
    if cloud.surface.uses_discs() {
        closest_shapes::<L, Disc>(&cloud.points, rays, hits);
    } else {
        closest_shapes::<L, Sphere>(&cloud.points, rays, hits);
    }
}

/// Finds the closest shape of one kind on each ray.
#[inline(always)]
pub fn closest_shapes<L: Lanes, S: LeafGeometry>(tree: &S::Tree, rays: &[Ray], hits: &mut [Hit]) {
    run_query::<L, _>(Closest::<S>(PhantomData), tree, rays, hits);
}

/// Finds the closest triangle on each ray.
pub fn closest_triangles(triangles: &FlatTriangles, simd: Simd, rays: &[Ray], hits: &mut [Hit]) {
    if triangles.nodes.is_empty() {
        return hits.fill(Hit::MISS);
    }
    dispatch_simd!(
        simd,
        closest_triangles_kernel(triangles: &FlatTriangles, rays: &[Ray], hits: &mut [Hit])
    );
}

#[inline(always)]
fn closest_triangles_kernel<L: Lanes>(triangles: &FlatTriangles, rays: &[Ray], hits: &mut [Hit]) {
    run_query::<L, _>(Closest::<Triangle>(PhantomData), triangles, rays, hits);
}

/// The query for the closest shape.
struct Closest<S>(PhantomData<S>);

impl<L: Lanes, S: LeafGeometry> RayQuery<L> for Closest<S> {
    type Tree = S::Tree;
    type Result = Hit;
    type RayVisitor<'r> = ClosestRayVisitor<'r, S>;
    type PacketVisitor<'p> = ClosestPacketVisitor<'p, L, S>;
    const CONVERGES_AT_END: bool = false;
    const IS_PACKETWISE: bool = false;

    #[inline(always)]
    fn ray_visitor<'r>(&mut self, ray: &'r Ray) -> ClosestRayVisitor<'r, S> {
        let hit = Hit { distance: ray.t_max + 0.0, ..Hit::MISS };
        ClosestRayVisitor { ray, shape: PhantomData, hit }
    }

    #[inline(always)]
    fn packet_visitor<'p>(
        &mut self,
        packet: &'p Packet<'p, L::PacketLanes>,
    ) -> ClosestPacketVisitor<'p, L, S> {
        ClosestPacketVisitor {
            packet,
            rays: S::prepare_rays(&packet.lanes),
            distances: packet.initial_limits(),
            slots: [NO_SLOT; PACKET_WIDTH],
            per_ray: None,
        }
    }

    #[inline(always)]
    fn ray_results(&mut self, visitors: &mut [ClosestRayVisitor<S>], hits: &mut [Hit]) {
        for (visitor, hit) in visitors.iter().zip(hits) {
            *hit = if visitor.hit.is_miss() { Hit::MISS } else { visitor.hit };
        }
    }

    /// Handles all sixteen rays at once where there are so many: one by one they took a twentieth of the time
    /// of camera rays.
    #[inline(always)]
    fn packet_results(&mut self, visitor: &mut ClosestPacketVisitor<L, S>, hits: &mut [Hit]) {
        let NearestHits { distances, slots } = visitor.nearest();
        let is_hit = slots.lt_u32(L::PacketLanes::splat(NO_SLOT));
        let slots = slots.store();
        // The sum turns a negative zero into a positive one.
        let distances = distances + L::PacketLanes::splat(0.0);
        let miss = L::PacketLanes::splat(Hit::MISS.distance);
        let distances = L::PacketLanes::select(is_hit, distances, miss).store();
        if let Some(hits) = hits.first_chunk_mut::<PACKET_WIDTH>() {
            for lane in 0..PACKET_WIDTH {
                hits[lane] = Hit { distance: distances[lane], slot: slots[lane].to_bits() };
            }
            return;
        }
        for (lane, hit) in hits.iter_mut().enumerate() {
            *hit = Hit { distance: distances[lane], slot: slots[lane].to_bits() };
        }
    }
}

struct ClosestRayVisitor<'r, S> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    hit: Hit,
}

impl<S: LeafGeometry> RayVisitor for ClosestRayVisitor<'_, S> {
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
        let block = S::decode_relative_to::<L>(tree, block_idx, self.ray.origin);
        let hit = S::block_hits(&block, block_idx, self.ray).nearest();
        self.hit = hit.nearer(self.hit);
        ControlFlow::Continue(())
    }
}

/// The slot of `Hit::MISS`, in the form in which lanes hold it.
const NO_SLOT: f32 = f32::from_bits(Hit::MISS.slot);

struct ClosestPacketVisitor<'p, L: Lanes, S: LeafGeometry> {
    packet: &'p Packet<'p, L::PacketLanes>,
    rays: S::PreparedRays<L::PacketLanes>,
    distances: [f32; PACKET_WIDTH],
    /// Slots as bits, `NO_SLOT` for a ray whose nearest hit is in `per_ray`.
    slots: [f32; PACKET_WIDTH],
    per_ray: Option<PerRayHits>,
}

/// The nearest hits of rays that are tested one by one, in each lane of their blocks.
///
/// The nearest of the eight lanes is found for all rays at once, after each node: to find it for each ray
/// after each block took a fifth of the time of dense clouds.
struct PerRayHits {
    distances: [[f32; LANES]; PACKET_WIDTH],
    slots: [[f32; LANES]; PACKET_WIDTH],
}

impl PerRayHits {
    const NONE: Self = Self {
        distances: [[f32::INFINITY; LANES]; PACKET_WIDTH],
        slots: [[NO_SLOT; LANES]; PACKET_WIDTH],
    };

    #[inline(always)]
    fn add<L: Lanes>(&mut self, hits: &BlockHits<L>, ray: usize) {
        let (distances, slots) = (&mut self.distances[ray], &mut self.slots[ray]);
        let mut nearest = NearestHits { distances: L::load(distances), slots: L::load(slots) };
        hits.merge_into(&mut nearest);
        *distances = nearest.distances.store();
        *slots = nearest.slots.store();
    }

    /// Returns the distance of each ray's nearest hit.
    #[inline(always)]
    fn nearest_distances<W: PacketLanes>(&self) -> W {
        let [a, b, c, d, e, f, g, h] = W::columns(&self.distances);
        a.min(b).min(c.min(d)).min(e.min(f).min(g.min(h)))
    }

    #[inline(always)]
    fn merge_into<W: PacketLanes>(&self, nearest: &mut NearestHits<W>) {
        let (distances, slots) = (W::columns(&self.distances), W::columns(&self.slots));
        for lane in 0..LANES {
            let is_hit = slots[lane].lt_u32(W::splat(NO_SLOT));
            nearest.merge(is_hit, distances[lane], slots[lane]);
        }
    }
}

impl<L: Lanes, S: LeafGeometry> ClosestPacketVisitor<'_, L, S> {
    #[inline(always)]
    fn nearest(&self) -> NearestHits<L::PacketLanes> {
        let mut nearest = self.shared_nearest();
        if let Some(per_ray) = &self.per_ray {
            per_ray.merge_into(&mut nearest);
        }
        nearest
    }

    /// Returns the nearest hits that are not in `per_ray`.
    #[inline(always)]
    fn shared_nearest(&self) -> NearestHits<L::PacketLanes> {
        NearestHits {
            distances: L::PacketLanes::load(&self.distances),
            slots: L::PacketLanes::load(&self.slots),
        }
    }
}

impl<L: Lanes, S: LeafGeometry> PacketVisitor<L> for ClosestPacketVisitor<'_, L, S> {
    type Tree = S::Tree;
    const IS_ORDERED: bool = true;
    const SPARSE_THRESHOLD: f32 = S::SPARSE_THRESHOLD;

    #[inline(always)]
    fn limits(&self) -> &[f32; PACKET_WIDTH] {
        &self.distances
    }

    #[inline(always)]
    fn visit(&mut self, tree: &S::Tree, block_idx: u32) {
        let block = S::packet_block::<L>(tree, block_idx, self.packet);
        let mut nearest = self.shared_nearest();
        let first_slot = block_idx * LANES as u32;
        match block.candidate_lanes() {
            // There is no branch: a disc's hit is unpredictable, and on a plane all discs are equally near.
            LaneSelection::All => {
                for lane in 0..LANES {
                    test_lane::<L, S>(&block, &self.rays, lane, first_slot, &mut nearest);
                }
            }
            LaneSelection::Mask(lanes) => {
                for lane in set_bits::<LANES>(lanes) {
                    test_lane::<L, S>(&block, &self.rays, lane, first_slot, &mut nearest);
                }
            }
        }
        self.slots = nearest.slots.store();
        self.distances = nearest.distances.store();
    }

    #[inline(always)]
    fn visit_single(&mut self, tree: &S::Tree, block_idx: u32, lane: usize) {
        let ray = &self.packet.rays[lane];
        let block = S::decode_relative_to::<L>(tree, block_idx, ray.origin);
        let hit = Hit { distance: self.distances[lane] + 0.0, slot: self.slots[lane].to_bits() };
        let hit = S::block_hits(&block, block_idx, ray).nearest().nearer(hit);
        self.distances[lane] = hit.distance;
        self.slots[lane] = f32::from_bits(hit.slot);
    }

    #[inline(always)]
    fn visit_sparse(&mut self, tree: &S::Tree, blocks: &[(u32, u32)]) {
        let per_ray = self.per_ray.get_or_insert(PerRayHits::NONE);
        for &(block_idx, lanes) in blocks {
            // A common origin of all rays lets each block be decoded once.
            let shared = match self.packet.common_origin {
                Some(origin) => Some(S::decode_relative_to::<L>(tree, block_idx, origin)),
                None => None,
            };
            for lane in set_bits::<PACKET_WIDTH>(lanes) {
                let ray = &self.packet.rays[lane];
                let hits = match &shared {
                    Some(block) => S::block_hits(block, block_idx, ray),
                    None => {
                        let block = S::decode_relative_to(tree, block_idx, ray.origin);
                        S::block_hits(&block, block_idx, ray)
                    }
                };
                per_ray.add(&hits, lane);
            }
        }
        let nearest: L::PacketLanes = per_ray.nearest_distances();
        let NearestHits { distances, slots } = self.shared_nearest();
        let no_slot = L::PacketLanes::splat(NO_SLOT);
        self.slots = L::PacketLanes::select(nearest.lt(distances), no_slot, slots).store();
        self.distances = nearest.min(distances).store();
    }
}

#[inline(always)]
fn test_lane<L: Lanes, S: LeafGeometry>(
    block: &S::PacketBlock<L>,
    rays: &S::PreparedRays<L::PacketLanes>,
    lane: usize,
    first_slot: u32,
    nearest: &mut NearestHits<L::PacketLanes>,
) {
    let slot = L::PacketLanes::splat(f32::from_bits(first_slot + lane as u32));
    let (distance, is_hit) = block.intersect(rays, lane);
    nearest.merge(is_hit, distance, slot);
}
