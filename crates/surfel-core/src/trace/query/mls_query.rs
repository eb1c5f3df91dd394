//! The surface of moving least squares along rays: from the balls that a ray enters to the polynomial fitted to the points
//! around.

use crate::flat::{FlatCloud, Slot};
use crate::math::{
    Floats, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, SimdTask, Vec3, Vec3Lanes, rounded_normal,
    set_bits,
};
use crate::surface::mls::{self, PlaneLanes, PlaneSums, PolynomialSums, StepLanes};
use crate::surface::{
    CandidateHitLanes, EdgeTest, EdgeTestResult, NeighborhoodStats, support_weight,
};
use crate::trace::counts::{Counted, count};
use crate::trace::query::edge_test::{PacketCandidates, enclosed_lanes, lane_mask};
use crate::trace::query::hit::NearestHits;
use crate::trace::query::point_lists::PointLists;
use crate::trace::query::smooth_query::damped;
use crate::trace::simd::packet_rays::PacketRays;
use std::marker::PhantomData;

/// Maximum number of fits along a ray: planes, then polynomials.
pub const MAX_FITS: usize = 6;
/// Number of planes before polynomials, which cost twice as much. It is fixed, so that no ray depends on the others of its
/// packet.
pub const N_PLANES: usize = 2;
/// Distance between a fit's position and its intersection, in radii of the ball, at which the intersection is the surface.
pub const TOLERANCE: f32 = 0.1;
/// Maximum distance along the ray between a position and the intersection of its fit, in radii of the ball.
pub const MAX_STEP: f32 = 1.5;
/// Maximum distance along the ray between the ball and the surface, in radii of the ball.
pub const MAX_DISTANCE_FROM_BALL: f32 = 2.0;
/// Distance that a position may move before the points around it are listed again, in radii of the ball.
pub const LIST_MARGIN: f32 = 0.6;
/// Minimum distance behind a ball without a surface nearby at which the search goes on, in radii of the ball.
pub const RESTART_OFFSET: f32 = 0.3;
/// The distance behind such a ball, as a fraction of the distance to the plane that was found.
pub const RESTART_FRACTION: f32 = 0.7;
/// Minimum weight, which is the cube of that of the fit, of a point whose colour is blended.
pub const MIN_COLOR_WEIGHT: f32 = 1e-4;

/// Surface points of up to sixteen rays.
#[derive(Clone, Copy)]
pub struct MlsHits<W> {
    /// Lanes of the rays that hit the surface.
    pub lanes: u32,
    /// Distances along the rays.
    pub distances: W,
    /// Unit normals, facing the rays' origins.
    pub normals: Vec3Lanes<W>,
    /// Linear colours.
    pub colors: [Vec3; PACKET_WIDTH],
    /// Slots of the points nearest to the hits, as bits.
    pub slots: W,
    /// Distances along the rays at which those that hit nothing go on.
    pub restarts: W,
}

/// Finds where rays hit the surface near the balls that they enter. The memory is reused from packet to packet.
pub struct MlsTracer<'s> {
    cloud: &'s FlatCloud,
    lists: PointLists,
}

impl<'s> MlsTracer<'s> {
    /// Returns a tracer of the cloud's surface.
    pub fn new(cloud: &'s FlatCloud) -> Self {
        Self { cloud, lists: PointLists::default() }
    }

    /// Finds for those `lanes` whose rays are nearest to the points in `slots` at `distances` where they hit the surface.
    #[inline(always)]
    pub fn trace<L: Lanes, const HAS_COLORS: bool>(
        &mut self,
        rays: &PacketRays<L::PacketLanes>,
        lanes: u32,
        distances: L::PacketLanes,
        slots: &[Slot; PACKET_WIDTH],
    ) -> MlsHits<L::PacketLanes> {
        let Self { cloud, lists } = self;
        L::dispatch(FindSurface::<L, HAS_COLORS> {
            cloud,
            lists,
            rays,
            lanes,
            distances,
            slots,
            width: PhantomData,
        })
    }
}

struct FindSurface<'a, L: Lanes, const HAS_COLORS: bool> {
    cloud: &'a FlatCloud,
    lists: &'a mut PointLists,
    rays: &'a PacketRays<L::PacketLanes>,
    lanes: u32,
    distances: L::PacketLanes,
    slots: &'a [Slot; PACKET_WIDTH],
    width: PhantomData<L>,
}

impl<L: Lanes, const HAS_COLORS: bool> SimdTask for FindSurface<'_, L, HAS_COLORS> {
    type Output = MlsHits<L::PacketLanes>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { cloud, lists, rays, lanes, distances, slots, .. } = self;
        let mut radii = [1.0; PACKET_WIDTH];
        for lane in set_bits::<PACKET_WIDTH>(lanes) {
            radii[lane] = cloud.points.radius(slots[lane]);
        }
        let direction = rays.direction();
        let mut positions = PacketCandidates {
            position: rays.origin().plus(direction.scaled(distances)),
            normal: Vec3Lanes::splat(Vec3::ZERO).minus(direction),
            direction,
            radius: L::PacketLanes::load(&radii),
        };
        let mut hits = MlsHits {
            lanes: 0,
            distances,
            normals: positions.normal,
            colors: [Vec3::ZERO; PACKET_WIDTH],
            slots: L::PacketLanes::load(&slots.map(f32::from_bits)),
            restarts: distances,
        };
        let found = match cloud.options.degree {
            1 => approach::<L, 1>(cloud, lists, rays, lanes, &mut positions, &mut hits),
            2 => approach::<L, 6>(cloud, lists, rays, lanes, &mut positions, &mut hits),
            _ => approach::<L, 10>(cloud, lists, rays, lanes, &mut positions, &mut hits),
        };
        finish::<L, HAS_COLORS>(cloud, lists, rays, &positions, found, &mut hits);
        hits
    }
}

/// Moves positions along their rays to the surface, and returns the lanes that reach it. The polynomial has `N`
/// coefficients; one is a plane. Afterwards `positions` are those around which the points are listed.
#[inline(always)]
fn approach<L: Lanes, const N: usize>(
    cloud: &FlatCloud,
    lists: &mut PointLists,
    rays: &PacketRays<L::PacketLanes>,
    lanes: u32,
    positions: &mut PacketCandidates<L::PacketLanes>,
    hits: &mut MlsHits<L::PacketLanes>,
) -> u32 {
    let splat = <L::PacketLanes as Floats>::splat;
    let PacketCandidates { direction, radius, .. } = *positions;
    let start = hits.distances;
    let mut listed = start;
    let (mut open, mut found, mut stale) = (lanes, 0, lanes);
    let mut last_step = splat(0.0);
    lists.clear();
    for fit in 1..=MAX_FITS {
        if stale != 0 {
            let mask = lane_mask::<L::PacketLanes>(stale);
            // Most surfaces lie behind the position where the ball is met.
            let center = hits.distances + splat(if fit == 1 { LIST_MARGIN } else { 0.0 }) * radius;
            listed = L::PacketLanes::select(mask, center, listed);
            positions.position = rays.origin().plus(direction.scaled(listed));
            let support = mls::SUPPORT_FACTOR;
            lists.collect::<L>(&cloud.points, positions, stale, support + LIST_MARGIN, support);
        }
        let shift = direction.scaled((hits.distances - listed) / radius);
        let fits_planes = N == 1 || fit <= N_PLANES;
        let (fitted, is_valid) = if fits_planes {
            let planes = fit_planes(lists, shift, direction);
            if fit == 1 {
                let clearance = splat(RESTART_FRACTION) * planes.height.abs().min(splat(MAX_STEP));
                // Points that span no plane tell no height.
                let clearance = L::PacketLanes::select(planes.is_plane, clearance, splat(0.0));
                let ahead = clearance.max(splat(RESTART_OFFSET)) * radius;
                hits.restarts = hits.restarts + ahead;
            }
            (planes.intersect(direction), planes.is_plane)
        } else {
            fit_polynomials::<_, N>(lists, shift, hits.normals, direction)
        };
        let step = damped(fitted.step, last_step);
        last_step = if N != 1 && fit == N_PLANES { splat(0.0) } else { step };
        let moved = hits.distances + step * radius;
        let is_near = step.abs().le(splat(MAX_STEP))
            & (moved - start).abs().le(splat(MAX_DISTANCE_FROM_BALL) * radius);
        let moves = lane_mask::<L::PacketLanes>(open) & is_valid & is_near;
        hits.distances = L::PacketLanes::select(moves, moved, hits.distances);
        hits.normals = Vec3Lanes::select(moves, fitted.normal, hits.normals);
        open &= moves.bits();
        if N == 1 || !fits_planes {
            found |= open & fitted.step.abs().le(splat(TOLERANCE)).bits();
            open &= !found;
        }
        if open == 0 {
            break;
        }
        let drift = (hits.distances - listed).abs();
        stale = open & (splat(LIST_MARGIN) * radius).lt(drift).bits();
    }
    let in_range = rays.t_min.le(hits.distances) & hits.distances.le(rays.t_max);
    positions.position = rays.origin().plus(direction.scaled(listed));
    found & in_range.bits()
}

/// Fits planes to the listed points, around positions that are moved by `shift` from those of the lists.
#[inline(always)]
fn fit_planes<W: PacketLanes>(
    lists: &PointLists,
    shift: Vec3Lanes<W>,
    direction: Vec3Lanes<W>,
) -> PlaneLanes<W> {
    count(Counted::Terms, PACKET_WIDTH * lists.rows().len());
    let mut sums = PlaneSums::default();
    for row in lists.rows() {
        let offset = row.offset().minus(shift);
        sums.add(offset, support_weight(offset.dot(offset), row.inverse_support_squared()));
    }
    sums.planes(direction)
}

/// Fits polynomials of `N` coefficients over planes with these normals through the positions, and returns the lanes in which
/// there are points enough.
#[inline(always)]
fn fit_polynomials<W: PacketLanes, const N: usize>(
    lists: &PointLists,
    shift: Vec3Lanes<W>,
    normals: Vec3Lanes<W>,
    direction: Vec3Lanes<W>,
) -> (StepLanes<W>, W::Mask) {
    count(Counted::Terms, PACKET_WIDTH * lists.rows().len());
    let mut sums = PolynomialSums::<W, N>::new(normals, mls::SUPPORT_FACTOR);
    for row in lists.rows() {
        let offset = row.offset().minus(shift);
        sums.add(offset, support_weight(offset.dot(offset), row.inverse_support_squared()));
    }
    (sums.intersect(direction), sums.has_points())
}

/// Adds the hits in `lanes` that the points enclose, with their nearest points and colours.
#[inline(always)]
fn finish<L: Lanes, const HAS_COLORS: bool>(
    cloud: &FlatCloud,
    lists: &PointLists,
    rays: &PacketRays<L::PacketLanes>,
    listed: &PacketCandidates<L::PacketLanes>,
    lanes: u32,
    hits: &mut MlsHits<L::PacketLanes>,
) {
    if lanes == 0 {
        return;
    }
    hits.normals = rounded_normal(hits.normals);
    let splat = <L::PacketLanes as Floats>::splat;
    let PacketCandidates { direction, radius, .. } = *listed;
    let position = rays.origin().plus(direction.scaled(hits.distances));
    let shift = position.minus(listed.position).scaled(splat(1.0) / radius);
    let point_radius = radius * splat(1.0 / cloud.radius_factor());
    let mut accepted = lanes;
    if cloud.edge_test != EdgeTest::Off {
        let unit = splat(1.0 / cloud.radius_factor());
        let candidates = CandidateHitLanes::new(hits.normals, direction, unit);
        let mut neighborhood = NeighborhoodStats::<_, false>::new(candidates);
        for row in lists.rows() {
            let offset = row.offset().minus(shift);
            let is_neighbor = neighborhood.is_neighbor(offset);
            neighborhood.add(offset, Vec3Lanes::splat(Vec3::ZERO), is_neighbor);
        }
        let EdgeTestResult { enclosed, sparse } = neighborhood.evaluate();
        accepted = lanes & enclosed & !sparse;
        let open = lanes & !accepted;
        if open != 0 {
            let radius = splat(cloud.edge_retest_factor) * point_radius;
            let hits = PacketCandidates { position, normal: hits.normals, direction, radius };
            accepted |= enclosed_lanes::<L, false>(&cloud.points, open, &hits);
        }
    }
    hits.lanes = accepted;
    if HAS_COLORS {
        find_colors::<L::PacketLanes>(cloud, lists, shift, accepted, hits);
    }
}

/// Finds the points nearest to the hits in `lanes`, and the colours.
#[inline(always)]
fn find_colors<W: PacketLanes>(
    cloud: &FlatCloud,
    lists: &PointLists,
    shift: Vec3Lanes<W>,
    lanes: u32,
    hits: &mut MlsHits<W>,
) {
    let mask = lane_mask::<W>(lanes);
    let mut nearest = NearestHits { distances: W::splat(f32::INFINITY), slots: hits.slots };
    let mut colors = [(Vec3::ZERO, 0.0); PACKET_WIDTH];
    for row in lists.rows() {
        let offset = row.offset::<W>().minus(shift);
        nearest.merge(mask, offset.dot(offset), W::load(&row.slot));
        if !cloud.blends_colors {
            continue;
        }
        let own = support_weight(offset.dot(offset), row.inverse_support_squared());
        let own = own * own * own;
        let counts = (mask & W::splat(MIN_COLOR_WEIGHT).lt(own)).bits();
        let own = own.store();
        for lane in set_bits::<PACKET_WIDTH>(counts) {
            let color = cloud.points.surfel(row.slot[lane].to_bits()).color;
            colors[lane].0 += own[lane] * color;
            colors[lane].1 += own[lane];
        }
    }
    hits.slots = W::select(mask, nearest.slots, hits.slots);
    let slots = hits.slots.store();
    for lane in set_bits::<PACKET_WIDTH>(lanes) {
        let (sum, weight) = colors[lane];
        let of_nearest = || cloud.points.surfel(slots[lane].to_bits()).color;
        hits.colors[lane] = if 0.0 < weight { sum / weight } else { of_nearest() };
    }
}
