//! The smooth surface in queries that only ask whether a ray hits: for packets, and for single rays, which find the same.

use crate::flat::{FlatCloud, FlatPoints, Slot};
use crate::math::{Aabb, LaneMask, Lanes, PACKET_WIDTH, Ray, SimdTask, Vec3, Vec3Lanes};
use crate::surface::{
    CandidateHit, EdgeTest, EdgeTestResult, FIT_REACH, FitPoint, LEAVING_DISTANCE, OverhangSums,
    PointSums, SphereSums,
};
use crate::trace::query::any::HitFilter;
use crate::trace::query::edge_test::{evaluate_one, is_enclosed};
use crate::trace::query::hit::Hit;
use crate::trace::query::smooth_query::{
    FindSurface, MAX_DISTANCE_FROM_DISC, MAX_FITS, MAX_LAST_STEP, StoredBlock, TOLERANCE, damped,
    inverse_support_squared, unit,
};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::traversal::region::{BoxVisitor, query_box};
use std::marker::PhantomData;

/// Accepts discs near which the ray hits the smooth surface, but for those through which it leaves the surface at its
/// origin.
#[derive(Clone, Copy)]
pub struct SmoothFilter<'s>(pub &'s FlatCloud);

impl HitFilter for SmoothFilter<'_> {
    type Scratch = Vec<StoredBlock>;
    const ACCEPTS_ALL: bool = false;

    #[inline(always)]
    fn accepts<L: Lanes>(&self, ray: &Ray, hit: &Hit) -> bool {
        L::dispatch(TestSurface::<L> { cloud: self.0, ray, hit, lanes: PhantomData })
    }

    #[inline(always)]
    fn accepts_packet<L: Lanes>(
        &self,
        blocks: &mut Vec<StoredBlock>,
        rays: &PacketRays<L::PacketLanes>,
        lanes: u32,
        distances: L::PacketLanes,
        slots: &[Slot; PACKET_WIDTH],
    ) -> u32 {
        let cloud = self.0;
        let may_leave = cloud.has_known_sides();
        let found =
            FindSurface::<L, false> { cloud, blocks, rays, lanes, distances, slots, may_leave };
        L::dispatch(found).lanes
    }
}

/// The test whether a ray hits the surface near the disc that it hits.
struct TestSurface<'a, L> {
    cloud: &'a FlatCloud,
    ray: &'a Ray,
    hit: &'a Hit,
    lanes: PhantomData<L>,
}

impl<L: Lanes> SimdTask for TestSurface<'_, L> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Self { cloud, ray, hit, .. } = self;
        let points = &cloud.points;
        let radius = points.radius(hit.slot);
        let toward = |normal: Vec3| if 0.0 < normal.dot(ray.direction) { -normal } else { normal };
        let of_disc = points.normal(hit.slot);
        let leaves = hit.distance < LEAVING_DISTANCE * radius && 0.0 < of_disc.dot(ray.direction);
        if leaves && cloud.has_known_sides() {
            return false;
        }
        let mut normal = toward(of_disc);
        let mut distance = hit.distance;
        let mut last_step = 0.0;
        let mut inside = ray.at(distance);
        for fit in 1..=MAX_FITS {
            let sums = fit_one::<L>(points, ray.at(distance), normal, radius);
            let Vec3Lanes { x, y, z } = sums.mean_offset();
            inside = ray.at(distance) + Vec3::new(x, y, z);
            let sphere = sums.intersect(Vec3Lanes::splat(ray.direction));
            let step = damped(sphere.step, last_step);
            last_step = step;
            let moved = distance + step;
            if !sphere.is_hit || MAX_DISTANCE_FROM_DISC * radius < (moved - hit.distance).abs() {
                return false;
            }
            distance = moved;
            normal = toward(Vec3::new(sphere.normal.x, sphere.normal.y, sphere.normal.z));
            if sphere.step.abs() <= TOLERANCE * radius {
                break;
            }
            if fit == MAX_FITS && MAX_LAST_STEP * radius < sphere.step.abs() {
                return false;
            }
        }
        let candidate = CandidateHit { normal, direction: ray.direction, radius };
        let position = ray.at(distance);
        ray.t_min <= distance
            && distance <= ray.t_max
            && (cloud.edge_test == EdgeTest::Off
                || is_within_edge::<L>(self.cloud, position, candidate)
                    && !sticks_out::<L>(points, &candidate, position, inside - position))
    }
}

/// True if a hit sticks out beyond an edge; `inside` is the mean of the points of its fit relative to it.
#[inline(always)]
fn sticks_out<L: Lanes>(
    points: &FlatPoints,
    hit: &CandidateHit,
    position: Vec3,
    inside: Vec3,
) -> bool {
    let CandidateHit { normal, radius, .. } = *hit;
    let [normal, inside] = [normal, inside].map(Vec3Lanes::splat);
    let sums = OverhangSums::<L>::new(normal, inside, L::splat(radius));
    sum_up::<L, _>(points, position, radius, sums).reduce_lanes().sticks_out()
}

/// Adds the points around one position to sums over them, eight at a time, one per lane.
#[inline(always)]
fn sum_up<L: Lanes, S: PointSums<L>>(
    points: &FlatPoints,
    position: Vec3,
    radius: f32,
    sums: S,
) -> S {
    let reach = Vec3::splat(FIT_REACH * radius);
    let region = Aabb { min: position - reach, max: position + reach };
    let mut visitor = SingleHitSums::<L, S> { position, sums, lanes: PhantomData };
    query_box::<L>(points, &region, &mut visitor);
    visitor.sums
}

struct SingleHitSums<L, S> {
    position: Vec3,
    sums: S,
    lanes: PhantomData<L>,
}

impl<L: Lanes, S: PointSums<L>> BoxVisitor for SingleHitSums<L, S> {
    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let (point, is_used) = fit_points::<L>(points, block_idx, self.position);
        let near = is_used & self.sums.is_near(&point);
        if near.bits() != 0 {
            self.sums.add(&point, near);
        }
    }
}

/// Returns the points of a block relative to a position, and the lanes that have one.
#[inline(always)]
fn fit_points<L: Lanes>(
    points: &FlatPoints,
    block_idx: u32,
    position: Vec3,
) -> (FitPoint<L>, L::Mask) {
    let points = points.blocks[block_idx as usize].points::<L>(position);
    let point = FitPoint {
        offset: points.center,
        normal: unit(points.normal),
        inverse_support_squared: inverse_support_squared(points.radius),
    };
    (point, L::splat(0.0).lt(points.radius))
}

/// True if the points around a hit enclose it, or those of a wider neighbourhood.
#[inline(always)]
fn is_within_edge<L: Lanes>(cloud: &FlatCloud, position: Vec3, hit: CandidateHit) -> bool {
    let points = &cloud.points;
    let EdgeTestResult { enclosed, sparse } = evaluate_one::<L, false>(points, position, hit);
    let wider = CandidateHit { radius: cloud.edge_retest_factor * hit.radius, ..hit };
    enclosed & !sparse != 0 || is_enclosed::<L, false>(points, position, wider)
}

/// Sums up the points around one position.
#[inline(always)]
fn fit_one<L: Lanes>(
    points: &FlatPoints,
    position: Vec3,
    guide: Vec3,
    radius: f32,
) -> SphereSums<f32> {
    let sums = SphereSums::<L>::new(Vec3Lanes::splat(guide), L::splat(radius));
    sum_up::<L, _>(points, position, radius, sums).reduce_lanes()
}
