//! The shapes of a block: eight before one ray, or one after the other before sixteen rays.

use super::hit::{Hit, NearestHits};
use super::packet::{Packet, WideRays};
use crate::flat::{BlockTree, FlatPoints, FlatTriangles, PointBlock, Slot};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, Vec3, Vec3Lanes, Wide};
use crate::surface::triangle::Rows;
use crate::surface::{
    LineLanes, PointLanes, RayLanes, Shape, Triangle, TriangleLanes, TrianglesSeen,
};
use std::marker::PhantomData;

/// What stands in the leaves of a tree.
pub trait Leaf {
    type Tree: BlockTree;
    /// Rays of a packet as the shapes meet them.
    type Lines<W: Wide>: Copy;
    type BeforePacket<L: Lanes>: BeforePacket<L, Lines = Self::Lines<L::Wide>>;
    /// Eight shapes as rays from one place meet them.
    type Seen<L: Lanes>;
    /// Blocks that fewer rays of a packet enter, on average, are quicker shown to these alone.
    const FEW_RAYS: f32;

    fn lines<W: Wide>(rays: &WideRays<W>) -> Self::Lines<W>;

    /// A block's shapes, decoded for rays from `origin`.
    fn seen_from<L: Lanes>(tree: &Self::Tree, block_idx: u32, origin: Vec3) -> Self::Seen<L>;

    /// Where a ray from there meets the shapes of the block.
    fn hits<L: Lanes>(seen: &Self::Seen<L>, block_idx: u32, ray: &Ray) -> BlockHits<L>;

    /// A block made ready for the rays of a packet.
    fn before_packet<L: Lanes>(
        tree: &Self::Tree,
        block_idx: u32,
        packet: &Packet<L::Wide>,
    ) -> Self::BeforePacket<L>;
}

/// A block before sixteen rays.
pub trait BeforePacket<L: Lanes> {
    type Lines;

    /// The lanes whose shapes some of the rays may meet. All of them where to find out costs more than to
    /// try: then no loop over the lanes needs a branch.
    fn worth_trying(&self) -> Worth;

    /// Where all rays meet the shape in `lane`. The lines stand apart: to copy them for each block would
    /// take as long as to meet a triangle.
    fn intersect(&self, lines: &Self::Lines, lane: usize) -> (L::Wide, <L::Wide as Floats>::Mask);
}

/// Lanes to try.
#[derive(Clone, Copy)]
pub enum Worth {
    All,
    These(u32),
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

    /// Takes into `nearest` what is nearer in its lane.
    #[inline(always)]
    pub fn add_to(&self, nearest: &mut NearestHits<L>) {
        let slots = L::numbered(self.is_hit, self.first_slot, self.first_slot);
        nearest.take(self.is_hit, self.distances, slots);
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
    type Lines<W: Wide> = RayLanes<W>;
    type BeforePacket<L: Lanes> = PointsBeforePacket<L, S>;
    type Seen<L: Lanes> = PointLanes<L>;
    /// Between 9 and 13 it hardly makes a difference where many points lie behind a pixel; more than 9 are
    /// slower in small clouds.
    const FEW_RAYS: f32 = 9.0;

    #[inline(always)]
    fn lines<W: Wide>(rays: &WideRays<W>) -> RayLanes<W> {
        rays.lanes()
    }

    #[inline(always)]
    fn seen_from<L: Lanes>(points: &FlatPoints, block_idx: u32, origin: Vec3) -> PointLanes<L> {
        points.blocks[block_idx as usize].points(origin)
    }

    #[inline(always)]
    fn hits<L: Lanes>(seen: &PointLanes<L>, block_idx: u32, ray: &Ray) -> BlockHits<L> {
        let (distances, is_hit) = S::intersect(seen, &RayLanes::new(ray));
        BlockHits { first_slot: block_idx * LANES as u32, distances, radii: seen.radius, is_hit }
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
            offset: offset.store(),
            normal: normal.store(),
            radius: block.radii::<L>().store(),
        }
    }

    pub fn radius(&self, lane: usize) -> f32 {
        self.radius[lane]
    }
}

impl<L: Lanes, S: Shape> BeforePacket<L> for PointsBeforePacket<L, S> {
    type Lines = RayLanes<L::Wide>;

    #[inline(always)]
    fn worth_trying(&self) -> Worth {
        Worth::All
    }

    #[inline(always)]
    fn intersect(
        &self,
        rays: &RayLanes<L::Wide>,
        lane: usize,
    ) -> (L::Wide, <L::Wide as Floats>::Mask) {
        let point = PointLanes {
            center: self.corner.plus(Vec3Lanes::splat_lane(&self.offset, lane)),
            normal: Vec3Lanes::splat_lane(&self.normal, lane),
            radius: L::Wide::splat(self.radius[lane]),
        };
        S::intersect(&point, rays)
    }
}

impl Leaf for Triangle {
    type Tree = FlatTriangles;
    type Lines<W: Wide> = LineLanes<W>;
    type BeforePacket<L: Lanes> = TrianglesBeforePacket<L>;
    type Seen<L: Lanes> = TrianglesSeen<Vec3Lanes<L>, L>;
    /// With 9, a million triangles take an eighth longer.
    const FEW_RAYS: f32 = 4.0;

    #[inline(always)]
    fn lines<W: Wide>(rays: &WideRays<W>) -> LineLanes<W> {
        LineLanes::new(rays.lanes())
    }

    #[inline(always)]
    fn seen_from<L: Lanes>(
        triangles: &FlatTriangles,
        block_idx: u32,
        origin: Vec3,
    ) -> TrianglesSeen<Vec3Lanes<L>, L> {
        let corners = triangles.blocks[block_idx as usize].corners::<L>();
        TriangleLanes::new(corners).seen_from(Vec3Lanes::splat(origin))
    }

    #[inline(always)]
    fn hits<L: Lanes>(
        seen: &TrianglesSeen<Vec3Lanes<L>, L>,
        block_idx: u32,
        ray: &Ray,
    ) -> BlockHits<L> {
        let (distances, is_hit) = seen.intersect(&LineLanes::new(RayLanes::new(ray)));
        let first_slot = block_idx * LANES as u32;
        BlockHits { first_slot, distances, radii: L::splat(0.0), is_hit }
    }

    #[inline(always)]
    fn before_packet<L: Lanes>(
        triangles: &FlatTriangles,
        block_idx: u32,
        packet: &Packet<L::Wide>,
    ) -> TrianglesBeforePacket<L> {
        let block = &triangles.blocks[block_idx as usize];
        let lanes = TriangleLanes::new(block.corners::<L>());
        let (from, origins) = match packet.common_origin {
            Some(origin) => (origin, None),
            None => (Vec3::ZERO, Some(packet.wide.origin())),
        };
        TrianglesBeforePacket {
            seen: lanes.seen_from(Vec3Lanes::splat(from)).store(),
            origins,
            near: packet.frustum.meets_triangles::<L>(&block.corners),
        }
    }
}

/// Triangles as sixteen rays meet them.
pub struct TrianglesBeforePacket<L: Lanes> {
    /// From where all rays start, which is worked out once for eight triangles, or else from zero.
    seen: TrianglesSeen<Rows, [f32; LANES]>,
    /// Where the rays start if not in one place.
    origins: Option<Vec3Lanes<L::Wide>>,
    /// The lanes whose boxes reach into the packet's frustum.
    near: u32,
}

impl<L: Lanes> BeforePacket<L> for TrianglesBeforePacket<L> {
    type Lines = LineLanes<L::Wide>;

    #[inline(always)]
    fn worth_trying(&self) -> Worth {
        Worth::These(self.near)
    }

    /// Both ways give the same bits.
    #[inline(always)]
    fn intersect(
        &self,
        lines: &LineLanes<L::Wide>,
        lane: usize,
    ) -> (L::Wide, <L::Wide as Floats>::Mask) {
        let seen = self.seen.splat::<L::Wide>(lane);
        match self.origins {
            None => seen.intersect(lines),
            Some(origins) => seen.seen_from(origins).intersect(lines),
        }
    }
}
