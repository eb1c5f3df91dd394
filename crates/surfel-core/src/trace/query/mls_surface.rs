//! The closest hit of each ray on the surface of moving least squares.

use crate::flat::FlatCloud;
use crate::math::{Lanes, PACKET_WIDTH, PacketLanes, Ray, Vec3};
use crate::surface::mls::Ball;
use crate::trace::query::closest::closest_shapes;
use crate::trace::query::hit::Hit;
use crate::trace::query::mls_query::MlsTracer;
use crate::trace::query::searching_rays::{CandidatePacket, SearchingRays};
use crate::trace::simd::packet_rays::PacketRays;

/// Maximum number of balls of a ray that are tried. A ray with more runs along a rim and is taken to miss.
pub const MAX_TRIED_BALLS: usize = 48;

/// The hit of a ray on the surface.
#[derive(Clone, Copy)]
pub struct MlsHit {
    /// The distance along the ray and the slot of the nearest point.
    pub hit: Hit,
    /// Radius of the ball through which the surface was found.
    pub radius: f32,
    /// Unit normal, facing the ray's origin.
    pub normal: Vec3,
    /// Linear colour.
    pub color: Vec3,
}

impl MlsHit {
    /// The result of a ray that hits nothing.
    pub const MISS: Self =
        Self { hit: Hit::MISS, radius: 0.0, normal: Vec3::ZERO, color: Vec3::ZERO };
}

/// Traces all rays together until each hits the surface, or enters no more balls.
#[inline(always)]
pub fn mls_hits<L: Lanes, const HAS_COLORS: bool>(
    cloud: &FlatCloud,
    all_rays: &[Ray],
    hits: &mut [MlsHit],
) {
    hits.fill(MlsHit::MISS);
    let mut searching = SearchingRays::new(all_rays);
    let mut tracer = MlsTracer::new(cloud);
    for _ in 0..MAX_TRIED_BALLS {
        closest_shapes::<L, Ball>(&cloud.points, &searching.rays, &mut searching.nearest);
        for first in (0..searching.drop_misses()).step_by(PACKET_WIDTH) {
            let packet = searching.packet(first);
            let CandidatePacket { rays, slots, distances, .. } = &packet;
            let found = tracer.trace::<L, HAS_COLORS>(
                &PacketRays::<L::PacketLanes>::new(rays),
                packet.lanes(),
                L::PacketLanes::load(distances),
                slots,
            );
            let [x, y, z] = found.normals.store_packet();
            let (found_distances, restarts) = (found.distances.store(), found.restarts.store());
            let found_slots = found.slots.store();
            for lane in 0..packet.len {
                if found.lanes >> lane & 1 == 1 {
                    let slot = found_slots[lane].to_bits();
                    hits[searching.ray_idx(first + lane)] = MlsHit {
                        hit: Hit { distance: found_distances[lane], slot },
                        radius: cloud.points.radius(slots[lane]),
                        normal: Vec3::new(x[lane], y[lane], z[lane]),
                        color: found.colors[lane],
                    };
                    continue;
                }
                let least = distances[lane] * (1.0 + 2.0 * f32::EPSILON) + f32::MIN_POSITIVE;
                searching.restart(first + lane, restarts[lane].max(least));
            }
        }
        if !searching.keep_restarted() {
            break;
        }
    }
}
