//! The points of a block: eight before one ray, or one after the other before sixteen rays.

use super::hit::Hit;
use super::packet::Packet;
use crate::flat::{FlatPoints, PointBlock};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, Vec3Lanes};
use crate::surface::{PointLanes, RayLanes, Shape};

/// The hits of one ray in one block.
pub struct BlockHits {
    block_idx: u32,
    lanes: u32,
    distances: [f32; LANES],
    radii: [f32; LANES],
}

impl BlockHits {
    /// Up to `t_max`. Loops over these rather than closures: a closure would not be compiled for the
    /// SIMD level of the kernel around it.
    #[inline(always)]
    pub fn find<L: Lanes, S: Shape>(
        points: &FlatPoints,
        block_idx: u32,
        ray: &Ray,
        t_max: f32,
    ) -> Self {
        let lanes = points.blocks[block_idx as usize].points::<L>(ray.origin);
        let (distances, mask) = S::intersect(&lanes, &RayLanes::<L>::new(ray));
        Self {
            block_idx,
            lanes: (mask & distances.less_equal(L::splat(t_max))).bits(),
            distances: distances.store(),
            radii: lanes.radius.store(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.lanes == 0
    }

    /// The next hit and the radius of what was hit.
    #[inline(always)]
    pub fn next(&mut self) -> Option<(Hit, f32)> {
        if self.lanes == 0 {
            return None;
        }
        let lane = self.lanes.trailing_zeros() as usize;
        self.lanes &= self.lanes - 1;
        let slot = self.block_idx * LANES as u32 + lane as u32;
        Some((Hit { distance: self.distances[lane], slot }, self.radii[lane]))
    }
}

/// A block made ready for the rays of a packet.
pub struct BlockForPacket<L: Lanes> {
    corner: Vec3Lanes<L::Wide>,
    rays: RayLanes<L::Wide>,
    offset: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    radius: [f32; LANES],
}

impl<L: Lanes> BlockForPacket<L> {
    #[inline(always)]
    pub fn new(block: &PointBlock, packet: &Packet<L::Wide>) -> Self {
        let (offset, normal) = (block.offsets::<L>(), block.normals::<L>());
        let [x, y, z] = packet.wide.origin;
        let [to_x, to_y, to_z] = packet.wide.direction;
        Self {
            corner: Vec3Lanes::splat(block.corner()).minus(Vec3Lanes { x, y, z }),
            rays: RayLanes {
                direction: Vec3Lanes { x: to_x, y: to_y, z: to_z },
                t_min: packet.wide.t_min,
            },
            offset: [offset.x.store(), offset.y.store(), offset.z.store()],
            normal: [normal.x.store(), normal.y.store(), normal.z.store()],
            radius: block.radii::<L>().store(),
        }
    }

    /// The point in `lane` before all rays.
    #[inline(always)]
    pub fn intersect<S: Shape>(&self, lane: usize) -> (L::Wide, <L::Wide as Floats>::Mask) {
        let point = PointLanes {
            center: self.corner.plus(splat(&self.offset, lane)),
            normal: splat(&self.normal, lane),
            radius: L::Wide::splat(self.radius[lane]),
        };
        S::intersect(&point, &self.rays)
    }
}

#[inline(always)]
fn splat<F: Floats>([x, y, z]: &[[f32; LANES]; 3], lane: usize) -> Vec3Lanes<F> {
    Vec3Lanes { x: F::splat(x[lane]), y: F::splat(y[lane]), z: F::splat(z[lane]) }
}
