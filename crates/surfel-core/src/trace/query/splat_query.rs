//! The splat of each ray: its gathered discs, blended.

use crate::flat::FlatCloud;
use crate::math::{
    Floats, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Ray, SimdTask, Vec3, Vec3Lanes,
};
use crate::surface::mls::Ball;
use crate::surface::{
    Blend, CandidateHit, Disc, EdgeTest, GatherLimit, MAX_CANDIDATES, MAX_GATHERED, NearestDisc,
    SplatAccumulator, SurfaceKind, Surfel, gather_limit,
};
use crate::trace::query::closest::closest_hits_kernel;
use crate::trace::query::edge_test::{PacketCandidates, enclosed_by_blocks, enclosed_lanes};
use crate::trace::query::gather::{DiscConsumer, GatherQuery, PacketDiscs};
use crate::trace::query::hit::{Hit, RESTART_OFFSET};
use crate::trace::query::packet_disc_hits::PacketDiscHit;
use crate::trace::query::plane_fit::{FittedDiscs, FittedPlanes};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::simd::{Simd, dispatch_simd};
use crate::trace::traversal::batch::trace_batch;
use crate::trace::traversal::group::GROUP_SIZE;
use crate::trace::traversal::interleaved::RayPool;
use crate::trace::traversal::stack::PacketStack;
use std::marker::PhantomData;

/// The blended discs of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// The nearest disc.
    pub hit: Hit,
    /// Distance along the ray: that of the nearest disc, or the mean of all discs of `Cylinder`.
    pub distance: f32,
    /// Number of discs.
    pub n_discs: u32,
    /// Radius of the nearest disc.
    pub radius: f32,
    /// Distance along the ray at which the search goes on if the discs are rejected.
    pub(in crate::trace) restart: f32,
    /// Unit normal, facing the ray's origin.
    pub normal: Vec3,
    /// Linear colour.
    pub color: Vec3,
    /// False where too few points are near the ray, or where it does not cross their plane: it goes on.
    pub(in crate::trace) is_dense: bool,
    /// True if the points around the hit are known to enclose it, which is found out only for the edge test.
    pub(in crate::trace) is_enclosed: bool,
}

impl Splat {
    /// The result of a ray that hits nothing.
    pub const MISS: Self = Self {
        hit: Hit::MISS,
        distance: f32::INFINITY,
        n_discs: 0,
        radius: 0.0,
        restart: f32::INFINITY,
        normal: Vec3::ZERO,
        color: Vec3::ZERO,
        is_dense: false,
        is_enclosed: false,
    };
}

/// Blends the discs that `gathers` finds by the cloud's surface kind, or by `SurfaceKind::Splat` if that kind
/// blends none. The edge test is not applied.
pub fn splats(cloud: &FlatCloud, simd: Simd, rays: &[Ray], splats: &mut [Splat]) {
    if cloud.points.nodes.is_empty() {
        return splats.fill(Splat::MISS);
    }
    dispatch_simd!(simd, splats_kernel(cloud: &FlatCloud, rays: &[Ray], splats: &mut [Splat]));
}

#[inline(always)]
fn splats_kernel<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], splats: &mut [Splat]) {
    let kind = cloud.surface;
    let kind = if kind.blends_discs() { kind } else { SurfaceKind::Splat };
    SplatTracer::new(cloud, kind, EdgeTest::Off).trace::<L>(rays, splats);
}

/// Traces splats, and reuses its memory from batch to batch.
pub struct SplatTracer<'s> {
    stack: PacketStack,
    pool: RayPool,
    discs: PacketDiscs,
    blender: DiscBlender<'s>,
    /// Splats whose edge test is open, and their hits.
    open: Vec<u32>,
    open_hits: Vec<(Vec3, CandidateHit)>,
}

impl<'s> SplatTracer<'s> {
    /// Returns a tracer that finds out whether hits are enclosed if `edge_test` asks for that.
    pub fn new(cloud: &'s FlatCloud, kind: SurfaceKind, edge_test: EdgeTest) -> Self {
        let tests_edge = edge_test == EdgeTest::AngularGap;
        Self {
            stack: PacketStack::new(),
            pool: RayPool::default(),
            discs: PacketDiscs::new(),
            blender: DiscBlender { cloud, kind, tests_edge, surfels: Vec::new() },
            open: Vec::new(),
            open_hits: Vec::new(),
        }
    }

    /// Traces the splats of `rays`, in a function of its own.
    #[inline(always)]
    pub fn trace<L: Lanes>(&mut self, rays: &[Ray], splats: &mut [Splat]) {
        L::dispatch(TraceSplats { tracer: self, rays, splats, lanes: PhantomData::<L> });
    }

    #[inline(always)]
    fn blend<L: Lanes>(&mut self, rays: &[Ray], splats: &mut [Splat]) {
        let Self { stack, pool, discs, blender, .. } = self;
        let cloud = blender.cloud;
        let points = &cloud.points;
        if cloud.fits_balls() {
            let mut query = GatherQuery::<_, Ball>::new(discs, blender);
            trace_batch::<L, _>(stack, pool, &mut query, points, rays, splats);
        } else {
            let mut query = GatherQuery::<_, Disc>::new(discs, blender);
            trace_batch::<L, _>(stack, pool, &mut query, points, rays, splats);
        }
    }

    /// Makes a splat of the closest disc alone, in a function of its own.
    #[inline(always)]
    fn take_closest<L: Lanes>(&mut self, rays: &[Ray], splats: &mut [Splat]) {
        L::dispatch(TakeClosest { tracer: self, rays, splats, lanes: PhantomData::<L> });
    }

    /// Tests the hits that are not known to be enclosed, those of many packets together.
    #[inline(always)]
    fn test_edges<L: Lanes>(&mut self, rays: &[Ray], splats: &mut [Splat]) {
        let Self { blender, open, open_hits, .. } = self;
        open.clear();
        open_hits.clear();
        for (splat_idx, (splat, ray)) in splats.iter().zip(rays).enumerate() {
            if !splat.is_dense || splat.is_enclosed {
                continue;
            }
            let radius = splat.radius / blender.cloud.radius_factor();
            let candidate = CandidateHit { normal: splat.normal, direction: ray.direction, radius };
            open.push(splat_idx as u32);
            open_hits.push((ray.at(splat.distance), candidate));
        }
        for (open, hits) in open.chunks(PACKET_WIDTH).zip(open_hits.chunks(PACKET_WIDTH)) {
            let lanes = (1 << open.len()) - 1;
            let candidates = PacketCandidates::new(hits);
            let points = &blender.cloud.points;
            let enclosed = match blender.cloud.fits_balls() {
                true => enclosed_lanes::<L, false>(points, lanes, &candidates),
                false => enclosed_lanes::<L, true>(points, lanes, &candidates),
            };
            for (lane, splat_idx) in open.iter().enumerate() {
                splats[*splat_idx as usize].is_enclosed = enclosed >> lane & 1 == 1;
            }
        }
    }
}

struct TraceSplats<'t, 's, L> {
    tracer: &'t mut SplatTracer<'s>,
    rays: &'t [Ray],
    splats: &'t mut [Splat],
    lanes: PhantomData<L>,
}

impl<L: Lanes> SimdTask for TraceSplats<'_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { tracer, rays, splats, .. } = self;
        if tracer.blender.kind.blends_discs() {
            tracer.blend::<L>(rays, splats);
        } else {
            tracer.take_closest::<L>(rays, splats);
        }
        if tracer.blender.tests_edge {
            tracer.test_edges::<L>(rays, splats);
        }
    }
}

struct TakeClosest<'t, 's, L> {
    tracer: &'t mut SplatTracer<'s>,
    rays: &'t [Ray],
    splats: &'t mut [Splat],
    lanes: PhantomData<L>,
}

impl<L: Lanes> SimdTask for TakeClosest<'_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let SplatTracer { discs, blender, .. } = self.tracer;
        let mut hits = [Hit::MISS; GROUP_SIZE];
        let groups = self.rays.chunks(GROUP_SIZE).zip(self.splats.chunks_mut(GROUP_SIZE));
        for (rays, splats) in groups {
            let hits = &mut hits[..rays.len()];
            closest_hits_kernel::<L>(blender.cloud, rays, hits);
            let packets = rays.chunks(PACKET_WIDTH).zip(splats.chunks_mut(PACKET_WIDTH));
            for ((rays, splats), hits) in packets.zip(hits.chunks(PACKET_WIDTH)) {
                discs.add_closest(hits);
                blender.consume::<L>(discs, rays, splats);
                discs.hits.clear();
            }
        }
    }
}

/// Blends the discs of packets to splats.
struct DiscBlender<'s> {
    cloud: &'s FlatCloud,
    kind: SurfaceKind,
    tests_edge: bool,
    /// The discs of the current packet.
    surfels: Vec<Surfel>,
}

/// The nearest disc of each ray.
struct NearestDiscs<W> {
    discs: NearestDisc<W>,
    /// Slots, as the bits of floats.
    slots: W,
    radii: W,
    n_discs: W,
}

impl<W: PacketLanes> NearestDiscs<W> {
    /// Drops the hits that lie farther behind the nearest disc of a ray than that disc's radius.
    #[inline(always)]
    fn drop_beyond_first(&mut self, hits: &mut [PacketDiscHit]) {
        let limits = gather_limit(self.discs.distance, self.radii);
        self.n_discs = W::splat(0.0);
        for hit in hits {
            let distances = W::load(&hit.distances);
            let is_near = distances.le(limits);
            hit.distances = W::select(is_near, distances, W::splat(f32::NAN)).store();
            self.n_discs = self.n_discs + W::select(is_near, W::splat(1.0), W::splat(0.0));
        }
    }
}

/// The blended discs of each ray.
struct BlendedDiscs<W> {
    blend: Blend<W>,
    /// Distances at which the search goes on if the discs are rejected.
    restart: W,
    /// Lanes of the rays that cross the plane of their discs; all if the planes are not asked.
    crossed: u32,
}

impl<W: PacketLanes> BlendedDiscs<W> {
    /// Moves the hits to where the rays cross planes, and restarts behind them. The planes are in radii.
    #[inline(always)]
    fn move_to_planes(&mut self, planes: &FittedPlanes<W>, rays: &PacketRays<W>, radii: W) {
        let crossing = planes.crossing(rays.direction());
        let distance = self.blend.distance;
        self.restart = distance + crossing.restart * radii;
        let moved = distance + crossing.step * radii;
        self.blend.distance = moved;
        let in_range = rays.t_min.le(moved) & moved.le(rays.t_max);
        self.crossed = crossing.lanes & in_range.bits();
    }
}

impl DiscConsumer for DiscBlender<'_> {
    type Result = Splat;

    #[inline(always)]
    fn max_discs(&self) -> usize {
        match self.kind {
            SurfaceKind::Cylinder | SurfaceKind::SplatFit => MAX_CANDIDATES,
            _ => MAX_GATHERED,
        }
    }

    #[inline(always)]
    fn length(&self) -> Option<f32> {
        let is_nearest = self.cloud.options.gather_limit == GatherLimit::Nearest;
        is_nearest.then_some(self.cloud.max_blend_distance)
    }

    /// Blends the discs of one to sixteen rays up to their limits.
    #[inline(always)]
    fn consume<L: Lanes>(&mut self, discs: &mut PacketDiscs, rays: &[Ray], splats: &mut [Splat]) {
        let rays = PacketRays::<L::PacketLanes>::new(rays);
        discs.cull_and_sort::<L::PacketLanes>(self.max_discs());
        if discs.hits.is_empty() {
            splats.fill(Splat::MISS);
            return;
        }
        let mut nearest = self.find_nearest::<L::PacketLanes>(&discs.hits);
        if self.length().is_some() {
            nearest.drop_beyond_first(&mut discs.hits);
        }
        if self.cloud.fits_balls() {
            nearest.discs.normal = Vec3Lanes::splat(Vec3::ZERO).minus(rays.direction());
        }
        let blended = self.blend(&rays, &mut discs.hits, &mut nearest);
        let lanes = (1 << splats.len()) - 1;
        let enclosed = self.enclosed::<L>(&rays, &discs.hits, &nearest, &blended, lanes);
        self.store(&nearest, &blended, enclosed, splats);
    }
}

impl DiscBlender<'_> {
    /// Fills `surfels` with the discs that were hit, and returns the nearest one of each ray.
    #[inline(always)]
    fn find_nearest<W: PacketLanes>(&mut self, hits: &[PacketDiscHit]) -> NearestDiscs<W> {
        let zero = W::splat(0.0);
        let mut nearest = NearestDiscs {
            discs: NearestDisc {
                distance: W::splat(f32::INFINITY),
                center: Vec3Lanes::splat(Vec3::ZERO),
                normal: Vec3Lanes::splat(Vec3::Z),
            },
            slots: W::splat(f32::from_bits(Hit::MISS.slot)),
            radii: zero,
            n_discs: zero,
        };
        self.surfels.clear();
        for hit in hits {
            let surfel = self.cloud.points.surfel(hit.slot);
            let distances = W::load(&hit.distances);
            // The discs are sorted by slot, so the first of equally near ones counts.
            let is_nearer = distances.lt(nearest.discs.distance);
            let slot = W::splat(f32::from_bits(hit.slot));
            let normal = Vec3Lanes::splat(surfel.normal);
            let disc = nearest.discs;
            nearest.discs.distance = W::select(is_nearer, distances, disc.distance);
            let center = Vec3Lanes::splat(surfel.center);
            nearest.discs.center = Vec3Lanes::select(is_nearer, center, disc.center);
            nearest.discs.normal = Vec3Lanes::select(is_nearer, normal, disc.normal);
            nearest.slots = W::select(is_nearer, slot, nearest.slots);
            nearest.radii = W::select(is_nearer, W::splat(surfel.radius), nearest.radii);
            nearest.n_discs = nearest.n_discs + W::select(hit.hit_mask::<W>(), W::splat(1.0), zero);
            self.surfels.push(surfel);
        }
        nearest
    }

    /// Blends the discs that were hit, of which `SplatFit` keeps those near the nearest hits.
    #[inline(always)]
    fn blend<W: PacketLanes>(
        &mut self,
        rays: &PacketRays<W>,
        hits: &mut Vec<PacketDiscHit>,
        nearest: &mut NearestDiscs<W>,
    ) -> BlendedDiscs<W> {
        let (origin, direction) = (rays.origin(), rays.direction());
        let mut fitted = FittedDiscs {
            discs: &mut self.surfels,
            hits,
            position: origin.plus(direction.scaled(nearest.discs.distance)),
            per_radius: W::splat(1.0) / nearest.radii,
        };
        if self.kind == SurfaceKind::SplatFit {
            fitted.keep_nearest();
            nearest.n_discs = nearest.n_discs.min(W::splat(MAX_GATHERED as f32));
        }
        let mut accumulator =
            SplatAccumulator::new(self.kind, self.cloud.options.align, &nearest.discs, direction);
        for (surfel, hit) in fitted.discs.iter().zip(fitted.hits.iter()) {
            let distances = W::load(&hit.distances);
            let position = origin.plus(direction.scaled(distances));
            let offset = position.minus(Vec3Lanes::splat(surfel.center));
            accumulator.add(surfel, distances, offset, hit.hit_mask::<W>());
        }
        let blend = accumulator.finish();
        let offset = W::splat(RESTART_OFFSET / self.cloud.radius_factor());
        let restart = nearest.discs.distance + offset * nearest.radii;
        let mut blended = BlendedDiscs { blend, restart, crossed: u32::MAX };
        if self.kind == SurfaceKind::SplatFit {
            let planes = fitted.planes(blended.blend.normal);
            blended.blend.normal = planes.normal;
            if self.cloud.fits_balls() {
                blended.move_to_planes(&planes, rays, nearest.radii);
            }
        }
        blended
    }

    /// Returns those of `lanes` whose hits are known to be enclosed; none unless edges are tested.
    #[inline(always)]
    fn enclosed<L: Lanes>(
        &self,
        rays: &PacketRays<L::PacketLanes>,
        hits: &[PacketDiscHit],
        nearest: &NearestDiscs<L::PacketLanes>,
        blended: &BlendedDiscs<L::PacketLanes>,
        lanes: u32,
    ) -> u32 {
        if !self.tests_edge {
            return 0;
        }
        let direction = rays.direction();
        let factor = L::PacketLanes::splat(self.cloud.radius_factor());
        let candidates = PacketCandidates {
            position: rays.origin().plus(direction.scaled(blended.blend.distance)),
            normal: blended.blend.normal,
            direction,
            radius: nearest.radii / factor,
        };
        let is_hit = L::PacketLanes::splat(0.0).lt(nearest.n_discs).bits();
        let (points, lanes) = (&self.cloud.points, is_hit & blended.crossed & lanes);
        match self.cloud.fits_balls() {
            true => enclosed_by_blocks::<L, false>(points, hits, lanes, &candidates),
            false => enclosed_by_blocks::<L, true>(points, hits, lanes, &candidates),
        }
    }

    /// Writes the splat of each ray.
    #[inline(always)]
    fn store<W: PacketLanes>(
        &self,
        nearest: &NearestDiscs<W>,
        blended: &BlendedDiscs<W>,
        enclosed: u32,
        splats: &mut [Splat],
    ) {
        let min_discs =
            if self.kind == SurfaceKind::Cylinder { self.cloud.options.density } else { 1 };
        let (nearest_distances, slots) = (nearest.discs.distance.store(), nearest.slots.store());
        let (n_discs, radii) = (nearest.n_discs.store(), nearest.radii.store());
        let (distances, restarts) = (blended.blend.distance.store(), blended.restart.store());
        let [x, y, z] = blended.blend.normal.store_packet();
        let [r, g, b] = blended.blend.color.store_packet();
        for (lane, splat) in splats.iter_mut().enumerate() {
            *splat = Splat::MISS;
            if 0.0 < n_discs[lane] {
                let is_crossed = blended.crossed >> lane & 1 == 1;
                *splat = Splat {
                    hit: Hit { distance: nearest_distances[lane], slot: slots[lane].to_bits() },
                    distance: distances[lane],
                    n_discs: n_discs[lane] as u32,
                    radius: radii[lane],
                    restart: restarts[lane],
                    normal: Vec3::new(x[lane], y[lane], z[lane]),
                    color: Vec3::new(r[lane], g[lane], b[lane]),
                    is_dense: min_discs <= n_discs[lane] as u32 && is_crossed,
                    is_enclosed: enclosed >> lane & 1 == 1,
                };
            }
        }
    }
}
