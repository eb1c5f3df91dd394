//! The sixteen rays of a packet in lanes.

use crate::math::{LaneMask, PACKET_WIDTH, PacketLanes, Ray, Vec3, Vec3Lanes};
use crate::surface::RayLanes;

/// Sixteen rays in lanes.
#[derive(Clone, Copy)]
pub struct PacketRays<W> {
    /// Origins, axis by axis.
    pub origin: [W; 3],
    /// Directions, axis by axis.
    pub direction: [W; 3],
    /// Least distances at which hits count.
    pub t_min: W,
    /// Greatest distances at which hits count.
    pub t_max: W,
}

impl<W: PacketLanes> PacketRays<W> {
    /// Loads one to sixteen rays. The last one also fills the lanes that are left.
    #[inline(always)]
    pub fn new(rays: &[Ray]) -> Self {
        let mut filled = [rays[rays.len() - 1]; PACKET_WIDTH];
        let rays: &[Ray; PACKET_WIDTH] = match rays.first_chunk() {
            Some(rays) => rays,
            None => {
                filled[..rays.len()].copy_from_slice(rays);
                &filled
            }
        };
        let [x, y, z, t_min, to_x, to_y, to_z, t_max] = W::columns(bytemuck::cast_ref(rays));
        Self { origin: [x, y, z], direction: [to_x, to_y, to_z], t_min, t_max }
    }

    /// Returns `origin` if it is the origin of all rays.
    #[inline(always)]
    pub fn common_origin(&self, origin: Vec3) -> Option<Vec3> {
        let [x, y, z] = self.origin;
        let (at_x, at_y, at_z) = (W::splat(origin.x), W::splat(origin.y), W::splat(origin.z));
        let not_above = x.le(at_x) & y.le(at_y) & z.le(at_z);
        let not_below = at_x.le(x) & at_y.le(y) & at_z.le(z);
        let is_common = (not_above & not_below).bits() == (1 << PACKET_WIDTH) - 1;
        if is_common { Some(origin) } else { None }
    }

    /// Returns the rays in the form in which shapes intersect them.
    #[inline(always)]
    pub fn lanes(&self) -> RayLanes<W> {
        RayLanes { direction: self.direction(), t_min: self.t_min }
    }

    /// Returns the origins.
    #[inline(always)]
    pub fn origin(&self) -> Vec3Lanes<W> {
        let [x, y, z] = self.origin;
        Vec3Lanes { x, y, z }
    }

    /// Returns the directions.
    #[inline(always)]
    pub fn direction(&self) -> Vec3Lanes<W> {
        let [x, y, z] = self.direction;
        Vec3Lanes { x, y, z }
    }
}
