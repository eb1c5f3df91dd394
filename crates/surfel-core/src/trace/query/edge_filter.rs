//! The filter by which only hits within the edge of the surface count.

use crate::flat::{FlatCloud, Slot};
use crate::math::{Floats, Lanes, PACKET_WIDTH, PacketLanes, Ray, Vec3Lanes, set_bits};
use crate::surface::CandidateHit;
use crate::trace::query::any::HitFilter;
use crate::trace::query::edge_test::{PacketCandidates, enclosed_lanes, is_enclosed};
use crate::trace::query::hit::Hit;
use crate::trace::simd::packet_rays::PacketRays;

/// Accepts hits on the discs of a cloud that the edge test passes.
#[derive(Clone, Copy)]
pub struct EdgeFilter<'s>(pub &'s FlatCloud);

impl EdgeFilter<'_> {
    fn radius(&self, slot: Slot) -> f32 {
        self.0.points.radius(slot) / self.0.radius_factor()
    }
}

impl HitFilter for EdgeFilter<'_> {
    type Scratch = ();
    const ACCEPTS_ALL: bool = false;

    #[inline(always)]
    fn accepts<L: Lanes>(&self, ray: &Ray, hit: &Hit) -> bool {
        let normal = self.0.points.normal(hit.slot);
        let candidate = CandidateHit {
            normal: if 0.0 < normal.dot(ray.direction) { -normal } else { normal },
            direction: ray.direction,
            radius: self.radius(hit.slot),
        };
        is_enclosed::<L, true>(&self.0.points, ray.at(hit.distance), candidate)
    }

    #[inline(always)]
    fn accepts_packet<L: Lanes>(
        &self,
        _scratch: &mut (),
        rays: &PacketRays<L::PacketLanes>,
        lanes: u32,
        distances: L::PacketLanes,
        slots: &[Slot; PACKET_WIDTH],
    ) -> u32 {
        let (origin, direction) = (rays.origin(), rays.direction());
        let (mut normals, mut radii) = ([[0.0; PACKET_WIDTH]; 3], [0.0; PACKET_WIDTH]);
        for lane in set_bits::<PACKET_WIDTH>(lanes) {
            [normals[0][lane], normals[1][lane], normals[2][lane]] =
                self.0.points.normal(slots[lane]).to_array();
            radii[lane] = self.radius(slots[lane]);
        }
        let normal = Vec3Lanes::load_packet(&normals);
        let is_away = L::PacketLanes::splat(0.0).lt(normal.dot(direction));
        let (minus, plus) = (L::PacketLanes::splat(-1.0), L::PacketLanes::splat(1.0));
        let candidates = PacketCandidates {
            position: origin.plus(direction.scaled(distances)),
            normal: normal.scaled(L::PacketLanes::select(is_away, minus, plus)),
            direction,
            radius: L::PacketLanes::load(&radii),
        };
        enclosed_lanes::<L, true>(&self.0.points, lanes, &candidates)
    }
}
