//! The gathered discs of each ray: the nearest ones, all within a radius of each other.

use crate::flat::{FlatCloud, FlatPoints};
use crate::math::{Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Ray};
use crate::surface::{Disc, MAX_GATHERED, Shape, gather_limit};
use crate::trace::query::hit::{Gather, Hit};
use crate::trace::query::leaf::{LeafGeometry, PacketBlock};
use crate::trace::query::packet_disc_hits::{PacketDiscHit, cull_and_sort};
use crate::trace::simd::{Simd, dispatch_simd};
use crate::trace::traversal::batch::{RayQuery, trace_batch};
use crate::trace::traversal::interleaved::{RayPool, RayVisitor};
use crate::trace::traversal::packet::{Packet, PacketVisitor};
use crate::trace::traversal::stack::PacketStack;
use std::marker::PhantomData;
use std::ops::ControlFlow;

/// Gathers the nearest discs on each ray, all within a radius of each other. Points count as discs, whatever
/// the cloud's surface kind is.
pub fn gathers(cloud: &FlatCloud, simd: Simd, rays: &[Ray], gathers: &mut [Gather]) {
    if cloud.points.nodes.is_empty() {
        return gathers.fill(Gather::EMPTY);
    }
    dispatch_simd!(simd, gathers_kernel(cloud: &FlatCloud, rays: &[Ray], gathers: &mut [Gather]));
}

#[inline(always)]
fn gathers_kernel<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], gathers: &mut [Gather]) {
    let (mut stack, mut pool) = (PacketStack::new(), RayPool::default());
    let mut discs = PacketDiscs::new();
    let mut collect = CollectGathers;
    let mut query = GatherQuery::<_, Disc>::new(&mut discs, &mut collect);
    trace_batch::<L, _>(&mut stack, &mut pool, &mut query, &cloud.points, rays, gathers);
}

/// Receives the discs of one to sixteen rays.
pub trait DiscConsumer {
    /// The result for one ray.
    type Result;

    /// Returns the maximum number of discs of a ray. If there are more, the nearest are kept.
    fn max_discs(&self) -> usize {
        MAX_GATHERED
    }

    /// Returns the distance behind each disc up to which others are wanted; `None` if it is the disc's radius.
    fn length(&self) -> Option<f32> {
        None
    }

    /// Turns discs to results. Each ray's discs count up to its limit.
    fn consume<L: Lanes>(
        &mut self,
        discs: &mut PacketDiscs,
        rays: &[Ray],
        results: &mut [Self::Result],
    );
}

/// The discs that one to sixteen rays hit, within the rays' limits and some beyond.
pub struct PacketDiscs {
    /// The discs.
    pub hits: Vec<PacketDiscHit>,
    /// The distance on each ray up to which hits count.
    limits: [f32; PACKET_WIDTH],
    /// Memory for all hits of single rays, while no ray uses it.
    spare: Vec<Vec<Hit>>,
}

impl PacketDiscs {
    /// Returns no discs.
    pub fn new() -> Self {
        Self { hits: Vec::new(), limits: [f32::MAX; PACKET_WIDTH], spare: Vec::new() }
    }

    /// Adds the hits of rays, one per lane.
    #[inline(always)]
    pub fn add_closest(&mut self, hits: &[Hit]) {
        for (lane, hit) in hits.iter().enumerate() {
            if !hit.is_miss() {
                self.hits.push(PacketDiscHit::single(lane, *hit));
            }
        }
        self.limits = [f32::MAX; PACKET_WIDTH];
    }

    /// Drops what lies beyond the limits and what is not among the nearest `max_discs` of a ray, and sorts by slot.
    #[inline(always)]
    pub fn cull_and_sort<W: PacketLanes>(&mut self, max_discs: usize) {
        cull_and_sort::<W>(&mut self.hits, &self.limits, max_discs);
    }
}

/// Collects the discs of each ray.
struct CollectGathers;

impl DiscConsumer for CollectGathers {
    type Result = Gather;

    #[inline(always)]
    fn consume<L: Lanes>(
        &mut self,
        discs: &mut PacketDiscs,
        _rays: &[Ray],
        gathers: &mut [Gather],
    ) {
        discs.cull_and_sort::<L::PacketLanes>(MAX_GATHERED);
        for (lane, gather) in gathers.iter_mut().enumerate() {
            *gather = gather_of_lane(&discs.hits, lane);
        }
    }
}

fn gather_of_lane(hits: &[PacketDiscHit], lane: usize) -> Gather {
    let mut gather = Gather::EMPTY;
    for PacketDiscHit { slot, distances } in hits {
        if !distances[lane].is_nan() {
            gather.insert(Hit { distance: distances[lane], slot: *slot });
        }
    }
    gather
}

/// The query for the discs, or other shapes of points, of each ray. A consumer receives them packet by packet.
pub struct GatherQuery<'q, C, S> {
    /// The discs of the current packet.
    discs: &'q mut PacketDiscs,
    consumer: &'q mut C,
    shape: PhantomData<S>,
}

impl<'q, C, S> GatherQuery<'q, C, S> {
    /// Returns a query that reuses the memory of `discs`.
    pub fn new(discs: &'q mut PacketDiscs, consumer: &'q mut C) -> Self {
        Self { discs, consumer, shape: PhantomData }
    }
}

impl<L: Lanes, C: DiscConsumer, S: Shape> RayQuery<L> for GatherQuery<'_, C, S> {
    type Tree = FlatPoints;
    type Result = C::Result;
    type RayVisitor<'r> = GatherRayVisitor<'r, S>;
    type PacketVisitor<'p> = GatherPacketVisitor<'p, L, S>;
    const CONVERGES_AT_END: bool = false;
    const IS_PACKETWISE: bool = true;

    #[inline(always)]
    fn ray_visitor<'r>(&mut self, ray: &'r Ray) -> GatherRayVisitor<'r, S> {
        let keeps_all = MAX_GATHERED < self.consumer.max_discs();
        let all = keeps_all.then(|| self.discs.spare.pop().unwrap_or_default());
        let length = self.consumer.length();
        let (gather, shape) = (Gather::EMPTY, PhantomData);
        let capacity = HitCapacity::of(self.consumer.max_discs());
        GatherRayVisitor { ray, gather, all, capacity, length, limit: ray.t_max, shape }
    }

    #[inline(always)]
    fn packet_visitor<'p>(
        &mut self,
        packet: &'p Packet<'p, L::PacketLanes>,
    ) -> GatherPacketVisitor<'p, L, S> {
        let hits = std::mem::take(&mut self.discs.hits);
        let length = self.consumer.length();
        let limits = packet.initial_limits();
        let capacity = HitCapacity::of(self.consumer.max_discs());
        GatherPacketVisitor { packet, length, limits, hits, capacity, shape: PhantomData }
    }

    #[inline(always)]
    fn ray_results(&mut self, visitors: &mut [GatherRayVisitor<S>], _results: &mut [C::Result]) {
        for (lane, visitor) in visitors.iter_mut().enumerate() {
            let all = visitor.all.as_deref();
            let hits = all.unwrap_or(visitor.gather.hits()).iter();
            for hit in hits.filter(|hit| hit.distance <= visitor.limit) {
                self.discs.hits.push(PacketDiscHit::single(lane, *hit));
            }
            if let Some(mut all) = visitor.all.take() {
                all.clear();
                self.discs.spare.push(all);
            }
        }
        self.discs.limits = [f32::MAX; PACKET_WIDTH];
    }

    #[inline(always)]
    fn packet_results(
        &mut self,
        visitor: &mut GatherPacketVisitor<L, S>,
        _results: &mut [C::Result],
    ) {
        self.discs.hits = std::mem::take(&mut visitor.hits);
        self.discs.limits = visitor.limits;
    }

    #[inline(always)]
    fn finish_packet(&mut self, rays: &[Ray], results: &mut [C::Result]) {
        self.consumer.consume::<L>(self.discs, rays, results);
        self.discs.hits.clear();
    }
}

/// The number of hits from which on those that cannot be among the result are dropped, so that discs over each other in
/// any number take little memory.
#[derive(Clone, Copy)]
struct HitCapacity {
    /// Maximum number of discs of a ray in the result.
    max_discs: usize,
    n_hits: usize,
}

impl HitCapacity {
    /// Number of hits that are kept without a look at them.
    const MIN_HITS: usize = 1 << 14;

    fn of(max_discs: usize) -> Self {
        Self { max_discs, n_hits: Self::MIN_HITS }
    }

    /// Drops hits of a ray that lie beyond a limit or are not among the nearest.
    #[cold]
    fn shrink_ray(&mut self, hits: &mut Vec<Hit>, limit: f32) {
        hits.retain(|hit| hit.distance <= limit);
        if self.max_discs < hits.len() {
            hits.select_nth_unstable_by_key(self.max_discs, Hit::key);
            hits.truncate(self.max_discs);
        }
        self.n_hits = Self::MIN_HITS.max(2 * hits.len());
    }

    /// Drops hits of a packet as [`HitCapacity::shrink_ray`] does.
    #[cold]
    fn shrink_packet<W: PacketLanes>(
        &mut self,
        hits: &mut Vec<PacketDiscHit>,
        limits: &[f32; PACKET_WIDTH],
    ) {
        cull_and_sort::<W>(hits, limits, self.max_discs);
        self.n_hits = Self::MIN_HITS.max(2 * hits.len());
    }
}

/// The search for the discs that a ray hits.
pub struct GatherRayVisitor<'r, S> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    gather: Gather,
    /// All discs, if more than a `Gather` holds are wanted; `gather` is then empty.
    all: Option<Vec<Hit>>,
    /// Maximum number of hits in `all`.
    capacity: HitCapacity,
    length: Option<f32>,
    limit: f32,
}

impl<S: Shape> RayVisitor for GatherRayVisitor<'_, S> {
    type Tree = FlatPoints;
    const IS_ORDERED: bool = true;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.gather.bound().min(self.limit)
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let block = S::decode_relative_to::<L>(points, block_idx, self.ray.origin);
        for (hit, radius) in S::block_hits(&block, block_idx, self.ray).up_to(self.limit()) {
            if hit.distance <= self.limit {
                let length = self.length.unwrap_or(radius);
                self.limit = self.limit.min(gather_limit(hit.distance, length));
                if let Some(all) = &mut self.all {
                    all.push(hit);
                    if self.capacity.n_hits < all.len() {
                        self.capacity.shrink_ray(all, self.limit);
                    }
                    continue;
                }
                self.gather.insert(hit);
                self.gather.drop_beyond(self.limit);
            }
        }
        ControlFlow::Continue(())
    }
}

/// The search for the discs that the rays of a packet hit. Which of them each ray keeps is known only at the
/// end.
pub struct GatherPacketVisitor<'p, L: Lanes, S> {
    packet: &'p Packet<'p, L::PacketLanes>,
    length: Option<f32>,
    limits: [f32; PACKET_WIDTH],
    hits: Vec<PacketDiscHit>,
    capacity: HitCapacity,
    shape: PhantomData<S>,
}

impl<L: Lanes, S: Shape> PacketVisitor<L> for GatherPacketVisitor<'_, L, S> {
    type Tree = FlatPoints;
    const IS_ORDERED: bool = true;
    const SPARSE_THRESHOLD: f32 = 0.0;

    #[inline(always)]
    fn limits(&self) -> &[f32; PACKET_WIDTH] {
        &self.limits
    }

    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = S::packet_block::<L>(points, block_idx, self.packet);
        let rays = self.packet.lanes.lanes();
        let mut limits = L::PacketLanes::load(&self.limits);
        let mut end = self.hits.len();
        self.hits.resize(end + LANES, PacketDiscHit::NONE);
        // There is no branch: a disc's hit is unpredictable.
        for lane in 0..LANES {
            let (distance, mask) = block.intersect(&rays, lane);
            let is_hit = mask & distance.le(limits);
            let length = self.length.unwrap_or(block.radius(lane));
            let limit = gather_limit(distance, L::PacketLanes::splat(length));
            limits = L::PacketLanes::select(is_hit, limit.min(limits), limits);
            let slot = block_idx * LANES as u32 + lane as u32;
            // The sum turns a negative zero into a positive one.
            let distance = distance + L::PacketLanes::splat(0.0);
            let missed = L::PacketLanes::splat(f32::NAN);
            let distances = L::PacketLanes::select(is_hit, distance, missed).store();
            self.hits[end] = PacketDiscHit { slot, distances };
            end += usize::from(is_hit.bits() != 0);
        }
        self.hits.truncate(end);
        self.limits = limits.store();
        if self.capacity.n_hits < end {
            self.capacity.shrink_packet::<L::PacketLanes>(&mut self.hits, &self.limits);
        }
    }

    #[inline(always)]
    fn visit_single(&mut self, points: &FlatPoints, block_idx: u32, lane: usize) {
        let ray = &self.packet.rays[lane];
        let block = S::decode_relative_to::<L>(points, block_idx, ray.origin);
        for (hit, radius) in S::block_hits(&block, block_idx, ray).up_to(self.limits[lane]) {
            let length = self.length.unwrap_or(radius);
            self.limits[lane] = self.limits[lane].min(gather_limit(hit.distance, length));
            self.hits.push(PacketDiscHit::single(lane, hit));
        }
        if self.capacity.n_hits < self.hits.len() {
            self.capacity.shrink_packet::<L::PacketLanes>(&mut self.hits, &self.limits);
        }
    }
}
