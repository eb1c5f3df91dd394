//! The shapes of a block: eight before one ray, or one after the other before sixteen rays.

use super::hit::Hit;
use super::packet::Packet;
use crate::flat::{BlockTree, FlatPoints, FlatTriangles, PointBlock, Slot, TriangleBlock};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, Vec3Lanes};
use crate::surface::{LineLanes, PointLanes, RayLanes, Shape, Triangle, TriangleLanes};
use std::marker::PhantomData;

/// What stands in the leaves of a tree.
pub trait Leaf {
    type Tree: BlockTree;
    type BeforePacket<L: Lanes>: BeforePacket<L>;

    /// A block's shapes before one ray.
    fn hits<L: Lanes>(tree: &Self::Tree, block_idx: u32, ray: &Ray) -> BlockHits<L>;

    /// A block made ready for the rays of a packet.
    fn before_packet<L: Lanes>(
        tree: &Self::Tree,
        block_idx: u32,
        packet: &Packet<L::Wide>,
    ) -> Self::BeforePacket<L>;
}

/// A block before sixteen rays.
pub trait BeforePacket<L: Lanes> {
    /// Where all rays meet the shape in `lane`.
    fn intersect(&self, lane: usize) -> (L::Wide, <L::Wide as Floats>::Mask);
}

/// Where one ray meets the shapes of one block.
pub struct BlockHits<L: Floats> {
    first_slot: Slot,
    distances: L,
    radii: L,
    is_hit: L::Mask,
}

impl<L: Lanes> BlockHits<L> {
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

impl<S: Shape> Leaf for S {
    type Tree = FlatPoints;
    type BeforePacket<L: Lanes> = PointsBeforePacket<L, S>;

    #[inline(always)]
    fn hits<L: Lanes>(points: &FlatPoints, block_idx: u32, ray: &Ray) -> BlockHits<L> {
        let lanes = points.blocks[block_idx as usize].points::<L>(ray.origin);
        let (distances, is_hit) = S::intersect(&lanes, &RayLanes::<L>::new(ray));
        BlockHits { first_slot: block_idx * LANES as u32, distances, radii: lanes.radius, is_hit }
    }

    #[inline(always)]
    fn before_packet<L: Lanes>(
        points: &FlatPoints,
        block_idx: u32,
        packet: &Packet<L::Wide>,
    ) -> PointsBeforePacket<L, S> {
        PointsBeforePacket::new(&points.blocks[block_idx as usize], packet)
    }
}

/// Points as sixteen rays meet them.
pub struct PointsBeforePacket<L: Lanes, S> {
    shape: PhantomData<S>,
    corner: Vec3Lanes<L::Wide>,
    rays: RayLanes<L::Wide>,
    offset: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    radius: [f32; LANES],
}

impl<L: Lanes, S> PointsBeforePacket<L, S> {
    #[inline(always)]
    fn new(block: &PointBlock, packet: &Packet<L::Wide>) -> Self {
        let (offset, normal) = (block.offsets::<L>(), block.normals::<L>());
        Self {
            shape: PhantomData,
            corner: Vec3Lanes::splat(block.corner()).minus(packet.wide.origin()),
            rays: packet.wide.lanes(),
            offset: [offset.x.store(), offset.y.store(), offset.z.store()],
            normal: [normal.x.store(), normal.y.store(), normal.z.store()],
            radius: block.radii::<L>().store(),
        }
    }

    pub fn radius(&self, lane: usize) -> f32 {
        self.radius[lane]
    }
}

impl<L: Lanes, S: Shape> BeforePacket<L> for PointsBeforePacket<L, S> {
    #[inline(always)]
    fn intersect(&self, lane: usize) -> (L::Wide, <L::Wide as Floats>::Mask) {
        let point = PointLanes {
            center: self.corner.plus(splat(&self.offset, lane)),
            normal: splat(&self.normal, lane),
            radius: L::Wide::splat(self.radius[lane]),
        };
        S::intersect(&point, &self.rays)
    }
}

impl Leaf for Triangle {
    type Tree = FlatTriangles;
    type BeforePacket<L: Lanes> = TrianglesBeforePacket<L>;

    #[inline(always)]
    fn hits<L: Lanes>(triangles: &FlatTriangles, block_idx: u32, ray: &Ray) -> BlockHits<L> {
        let origin = Vec3Lanes::splat(ray.origin);
        let corners = triangles.blocks[block_idx as usize].corners::<L>();
        let lanes = TriangleLanes { corners: corners.map(|corner| corner.minus(origin)) };
        let (distances, is_hit) = lanes.intersect(&LineLanes::new(RayLanes::<L>::new(ray)));
        let first_slot = block_idx * LANES as u32;
        BlockHits { first_slot, distances, radii: L::splat(0.0), is_hit }
    }

    #[inline(always)]
    fn before_packet<L: Lanes>(
        triangles: &FlatTriangles,
        block_idx: u32,
        packet: &Packet<L::Wide>,
    ) -> TrianglesBeforePacket<L> {
        TrianglesBeforePacket {
            block: triangles.blocks[block_idx as usize],
            origin: packet.wide.origin(),
            lines: LineLanes::new(packet.wide.lanes()),
        }
    }
}

/// Triangles as sixteen rays meet them.
pub struct TrianglesBeforePacket<L: Lanes> {
    block: TriangleBlock,
    origin: Vec3Lanes<L::Wide>,
    lines: LineLanes<L::Wide>,
}

impl<L: Lanes> BeforePacket<L> for TrianglesBeforePacket<L> {
    #[inline(always)]
    fn intersect(&self, lane: usize) -> (L::Wide, <L::Wide as Floats>::Mask) {
        let corner = |i: usize| splat(&self.block.corners[i], lane).minus(self.origin);
        TriangleLanes { corners: [corner(0), corner(1), corner(2)] }.intersect(&self.lines)
    }
}

#[inline(always)]
fn splat<F: Floats>([x, y, z]: &[[f32; LANES]; 3], lane: usize) -> Vec3Lanes<F> {
    Vec3Lanes { x: F::splat(x[lane]), y: F::splat(y[lane]), z: F::splat(z[lane]) }
}
