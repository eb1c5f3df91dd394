//! The closest hits of rays on a smooth surface: they go on behind discs without one, but not through slits.

use crate::flat::FlatCloud;
use crate::math::{Lanes, PACKET_WIDTH, PacketLanes, Ray, Vec3};
use crate::surface::{CandidateHit, EdgeTest, EdgeTestResult, MIN_SLIT_DEPTH, Surfel};
use crate::trace::query::closest::closest_hits_kernel;
use crate::trace::query::edge_test::evaluate_one;
use crate::trace::query::hit::{Hit, MAX_REJECTED_HITS};
use crate::trace::query::searching_rays::{CandidatePacket, SearchingRays};
use crate::trace::query::smooth_query::SmoothTracer;
use crate::trace::query::surface_hit::SurfaceHit;
use crate::trace::simd::packet_rays::PacketRays;

/// Distance behind a disc without a smooth surface nearby at which the search restarts, in radii.
pub const SMOOTH_RESTART_OFFSET: f32 = 0.002;
/// Minimum cosine between a ray through a slit and the normal of the disc there. Beside a silhouette rays pass discs more
/// from their side: without this limit six times as much background was covered around the head.
pub const MIN_SLIT_COSINE: f32 = 0.5;

/// Traces all rays together until each hits the smooth surface, or hits no more discs.
#[inline(always)]
pub fn trace_smooth<L: Lanes>(cloud: &FlatCloud, rays: &[Ray], hits: &mut [SurfaceHit]) {
    let mut searching = SearchingRays::new(rays);
    let mut tracer = SmoothTracer::new(cloud);
    // The first disc that each ray passed, from its front where front sides are known.
    let mut passed = vec![Hit::MISS; rays.len()];
    for _ in 0..MAX_REJECTED_HITS {
        closest_hits_kernel::<L>(cloud, &searching.rays, &mut searching.nearest);
        for first in (0..searching.drop_misses()).step_by(PACKET_WIDTH) {
            let packet = searching.packet(first);
            let CandidatePacket { rays, slots, distances, .. } = &packet;
            let packet_rays = PacketRays::<L::PacketLanes>::new(rays);
            let disc_distances = L::PacketLanes::load(distances);
            let found = tracer.trace::<L>(&packet_rays, packet.lanes(), disc_distances, slots);
            let (found_distances, [r, g, b]) =
                (found.distances.store(), found.colors.store_packet());
            let [x, y, z] = found.normals.store_packet();
            let nearest_slots = found.slots.store().map(f32::to_bits);
            for lane in 0..packet.len {
                let (ray, ray_idx) = (rays[lane], searching.ray_idx(first + lane));
                let radius = cloud.points.radius(slots[lane]);
                if found.lanes >> lane & 1 == 1 {
                    let slot = nearest_slots[lane];
                    hits[ray_idx] = SurfaceHit {
                        distance: found_distances[lane],
                        id: cloud.points.id(slot),
                        slot,
                        radius,
                        normal: Vec3::new(x[lane], y[lane], z[lane]),
                        color: Vec3::new(r[lane], g[lane], b[lane]),
                        surface: cloud.surface,
                        is_backface: 0.0 < cloud.points.normal(slot).dot(ray.direction),
                    };
                    continue;
                }
                let is_front = cloud.points.normal(slots[lane]).dot(ray.direction) < 0.0;
                let first_disc = &mut passed[ray_idx];
                if first_disc.is_miss() && (is_front || !cloud.has_front_sides) {
                    *first_disc = Hit { distance: distances[lane], slot: slots[lane] };
                }
                let behind = distances[lane] + SMOOTH_RESTART_OFFSET * radius;
                let t_min = behind.max(distances[lane] * (1.0 + 2.0 * f32::EPSILON));
                searching.restart(first + lane, t_min);
            }
        }
        if !searching.keep_restarted() {
            break;
        }
    }
    for ((disc, hit), ray) in passed.iter().zip(hits).zip(rays) {
        if !disc.is_miss() && is_through_slit::<L>(cloud, disc, hit, ray) {
            let Surfel { normal, radius, color, .. } = cloud.points.surfel(disc.slot);
            let normal = if 0.0 < normal.dot(ray.direction) { -normal } else { normal };
            *hit = SurfaceHit {
                distance: disc.distance,
                id: cloud.points.id(disc.slot),
                slot: disc.slot,
                radius,
                normal,
                color,
                surface: cloud.surface,
                is_backface: false,
            };
        }
    }
}

/// Returns true if a ray went through a slit between the points around `disc`, which it passed before `hit` or a miss: it
/// hits a back face, or sees points all around and the disc not from its side, as in a corner whose points leave a gap.
#[inline(always)]
fn is_through_slit<L: Lanes>(cloud: &FlatCloud, disc: &Hit, hit: &SurfaceHit, ray: &Ray) -> bool {
    let Surfel { normal, radius, .. } = cloud.points.surfel(disc.slot);
    if hit.distance <= disc.distance + MIN_SLIT_DEPTH * radius {
        return false;
    }
    if cloud.has_front_sides && hit.is_backface {
        return true;
    }
    let around_ray = CandidateHit { normal: -ray.direction, direction: ray.direction, radius };
    if cloud.edge_test == EdgeTest::Off || normal.dot(ray.direction).abs() < MIN_SLIT_COSINE {
        return false;
    }
    let position = ray.at(disc.distance);
    let EdgeTestResult { enclosed, sparse } =
        evaluate_one::<L, false>(&cloud.points, position, around_ray);
    enclosed & !sparse != 0
}
