//! The points of a block: eight before one ray, or one after the other before sixteen rays.

use super::hit::Hit;
use super::packet::Packet;
use crate::flat::{FlatPoints, PointBlock, Slot};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, Vec3Lanes};
use crate::surface::{PointLanes, RayLanes, Shape};

/// Where one ray meets the points of one block.
pub struct BlockHits<L: Floats> {
    first_slot: Slot,
    distances: L,
    radii: L,
    is_hit: L::Mask,
}

impl<L: Lanes> BlockHits<L> {
    #[inline(always)]
    pub fn find<S: Shape>(points: &FlatPoints, block_idx: u32, ray: &Ray) -> Self {
        let lanes = points.blocks[block_idx as usize].points::<L>(ray.origin);
        let (distances, is_hit) = S::intersect(&lanes, &RayLanes::<L>::new(ray));
        Self { first_slot: block_idx * LANES as u32, distances, radii: lanes.radius, is_hit }
    }

    /// The lanes that are hit up to `t_max`.
    #[inline(always)]
    pub fn lanes(&self, t_max: f32) -> u32 {
        (self.is_hit & self.distances.less_equal(L::splat(t_max))).bits()
    }

    /// The nearest, at infinity if there is none: found without a branch, as it cannot be foretold.
    #[inline(always)]
    pub fn nearest(&self) -> Hit {
        let distances = L::select(self.is_hit, self.distances, L::splat(f32::INFINITY));
        // Of the two zeros the positive one.
        let distance = distances.min_lane() + 0.0;
        let lane = distances.less_equal(L::splat(distance)).bits().trailing_zeros();
        let is_hit = distance < f32::INFINITY;
        Hit { distance, slot: if is_hit { self.first_slot + lane } else { Hit::MISS.slot } }
    }

    /// All up to `t_max`, each with the radius of what was hit. A list to loop over rather than a function
    /// to call with a closure, which would not be compiled for the SIMD level of the kernel around it.
    #[inline(always)]
    pub fn up_to(&self, t_max: f32) -> HitList {
        HitList {
            first_slot: self.first_slot,
            lanes: self.lanes(t_max),
            distances: self.distances.store(),
            radii: self.radii.store(),
        }
    }
}

pub struct HitList {
    first_slot: Slot,
    lanes: u32,
    distances: [f32; LANES],
    radii: [f32; LANES],
}

impl HitList {
    #[inline(always)]
    pub fn next(&mut self) -> Option<(Hit, f32)> {
        if self.lanes == 0 {
            return None;
        }
        let lane = self.lanes.trailing_zeros() as usize;
        self.lanes &= self.lanes - 1;
        let slot = self.first_slot + lane as u32;
        Some((Hit { distance: self.distances[lane] + 0.0, slot }, self.radii[lane]))
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

    pub fn radius(&self, lane: usize) -> f32 {
        self.radius[lane]
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
