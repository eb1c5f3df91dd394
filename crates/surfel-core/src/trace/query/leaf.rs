//! The shapes in the blocks of a tree: eight of them against one ray, or one after the other against sixteen
//! rays.

use crate::flat::{BlockTree, FlatPoints, FlatTriangles, PointBlock, Slot};
use crate::math::{
    Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Ray, SetBits, Vec3, Vec3Lanes,
    set_bits,
};
use crate::surface::triangle::StoredVec3Lanes;
use crate::surface::{
    PointLanes, RayFrame, RayLanes, RayRelativeTriangles, Shape, Triangle, TriangleLanes,
};
use crate::trace::counts::{Counted, count};
use crate::trace::query::hit::{Hit, NearestHits};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::traversal::packet::Packet;
use std::marker::PhantomData;

/// A kind of shape that the blocks of a tree hold.
pub trait LeafGeometry {
    /// The tree over the blocks.
    type Tree: BlockTree;
    /// The rays of a packet, prepared for these shapes.
    type PreparedRays<W: PacketLanes>: Copy;
    /// A block, prepared for a packet.
    type PacketBlock<L: Lanes>: PacketBlock<L, PreparedRays = Self::PreparedRays<L::PacketLanes>>;
    /// The eight shapes of a block relative to the origin of a ray.
    type DecodedBlock<L: Lanes>;
    /// Average number of rays per block below which a packet's rays are faster tested one by one.
    const SPARSE_THRESHOLD: f32;

    /// Prepares the rays of a packet.
    fn prepare_rays<W: PacketLanes>(rays: &PacketRays<W>) -> Self::PreparedRays<W>;

    /// Decodes the shapes of a block for rays from `origin`.
    fn decode_relative_to<L: Lanes>(
        tree: &Self::Tree,
        block_idx: u32,
        origin: Vec3,
    ) -> Self::DecodedBlock<L>;

    /// Intersects the shapes of a block, decoded for the origin of `ray`.
    fn block_hits<L: Lanes>(
        block: &Self::DecodedBlock<L>,
        block_idx: u32,
        ray: &Ray,
    ) -> BlockHits<L>;

    /// Prepares a block for a packet.
    fn packet_block<L: Lanes>(
        tree: &Self::Tree,
        block_idx: u32,
        packet: &Packet<L::PacketLanes>,
    ) -> Self::PacketBlock<L>;
}

/// A block, prepared for the sixteen rays of a packet.
pub trait PacketBlock<L: Lanes> {
    /// The rays of the packet, prepared for these shapes.
    type PreparedRays;

    /// Returns the lanes whose shapes some of the rays may hit. It is `LaneSelection::All` where finding out
    /// costs more than intersecting: then no loop over the lanes needs a branch.
    fn candidate_lanes(&self) -> LaneSelection;

    /// Intersects the shape in `lane` with all rays, and returns distances and the rays that hit. The rays
    /// are no part of the block: to copy them for each block would take as long as to intersect a triangle.
    fn intersect(
        &self,
        rays: &Self::PreparedRays,
        lane: usize,
    ) -> (L::PacketLanes, <L::PacketLanes as Floats>::Mask);
}

/// Lanes to test.
#[derive(Clone, Copy)]
pub enum LaneSelection {
    /// All lanes.
    All,
    /// The lanes of this mask.
    Mask(u32),
}

/// The hits of one ray on the shapes of one block.
pub struct BlockHits<L: Floats> {
    first_slot: Slot,
    distances: L,
    radii: L,
    is_hit: L::Mask,
}

impl<L: Lanes> BlockHits<L> {
    /// Returns the lanes that are hit up to `t_max`.
    #[inline(always)]
    pub fn lanes(&self, t_max: f32) -> u32 {
        (self.is_hit & self.distances.le(L::splat(t_max))).bits()
    }

    /// Returns the nearest hit, at infinity if there is none, without a branch, which would be unpredictable.
    #[inline(always)]
    pub fn nearest(&self) -> Hit {
        let distances = L::select(self.is_hit, self.distances, L::splat(f32::INFINITY));
        // The sum turns a negative zero into a positive one.
        let distance = distances.reduce_min() + 0.0;
        let lane = distances.le(L::splat(distance)).bits().trailing_zeros();
        let is_hit = distance < f32::INFINITY;
        Hit { distance, slot: if is_hit { self.first_slot + lane } else { Hit::MISS.slot } }
    }

    /// Merges the hit in each lane into the nearest ones of that lane.
    #[inline(always)]
    pub fn merge_into(&self, nearest: &mut NearestHits<L>) {
        let slots = L::packed_indices(self.is_hit, self.first_slot, self.first_slot);
        nearest.merge(self.is_hit, self.distances, slots);
    }

    /// Iterates over all hits up to `t_max`, each with the radius of its shape. It is an iterator rather than
    /// a function that takes a closure, which would not be compiled for the SIMD level of the kernel around
    /// it.
    #[inline(always)]
    pub fn up_to(&self, t_max: f32) -> HitIter {
        HitIter {
            first_slot: self.first_slot,
            lanes: set_bits(self.lanes(t_max)),
            distances: self.distances.store(),
            radii: self.radii.store(),
        }
    }
}

/// An iterator over the hits of one ray on the shapes of one block, each with the radius of its shape.
pub struct HitIter {
    first_slot: Slot,
    lanes: SetBits<LANES>,
    distances: [f32; LANES],
    radii: [f32; LANES],
}

impl Iterator for HitIter {
    type Item = (Hit, f32);

    #[inline(always)]
    fn next(&mut self) -> Option<(Hit, f32)> {
        let lane = self.lanes.next()?;
        let slot = self.first_slot + lane as u32;
        Some((Hit { distance: self.distances[lane] + 0.0, slot }, self.radii[lane]))
    }
}

impl<S: Shape> LeafGeometry for S {
    type Tree = FlatPoints;
    type PreparedRays<W: PacketLanes> = RayLanes<W>;
    type PacketBlock<L: Lanes> = PacketPoints<L, S>;
    type DecodedBlock<L: Lanes> = PointLanes<L>;
    /// Values between 9 and 13 hardly make a difference where many points lie behind a pixel; those above 9
    /// are slower in small clouds.
    const SPARSE_THRESHOLD: f32 = 9.0;

    #[inline(always)]
    fn prepare_rays<W: PacketLanes>(rays: &PacketRays<W>) -> RayLanes<W> {
        rays.lanes()
    }

    #[inline(always)]
    fn decode_relative_to<L: Lanes>(
        points: &FlatPoints,
        block_idx: u32,
        origin: Vec3,
    ) -> PointLanes<L> {
        points.blocks[block_idx as usize].points(origin)
    }

    #[inline(always)]
    fn block_hits<L: Lanes>(block: &PointLanes<L>, block_idx: u32, ray: &Ray) -> BlockHits<L> {
        count(Counted::Shapes, LANES);
        let (distances, is_hit) = S::intersect(block, &RayLanes::new(ray));
        BlockHits { first_slot: block_idx * LANES as u32, distances, radii: block.radius, is_hit }
    }

    #[inline(always)]
    fn packet_block<L: Lanes>(
        points: &FlatPoints,
        block_idx: u32,
        packet: &Packet<L::PacketLanes>,
    ) -> PacketPoints<L, S> {
        PacketPoints::new(&points.blocks[block_idx as usize], packet)
    }
}

/// The points of a block, prepared for a packet.
pub struct PacketPoints<L: Lanes, S> {
    shape: PhantomData<S>,
    corner: Vec3Lanes<L::PacketLanes>,
    offset: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    radius: [f32; LANES],
}

impl<L: Lanes, S> PacketPoints<L, S> {
    #[inline(always)]
    fn new(block: &PointBlock, packet: &Packet<L::PacketLanes>) -> Self {
        let (offset, normal) = (block.offsets::<L>(), block.normals::<L>());
        Self {
            shape: PhantomData,
            corner: Vec3Lanes::splat(block.corner()).minus(packet.lanes.origin()),
            offset: offset.store(),
            normal: normal.store(),
            radius: block.radii::<L>().store(),
        }
    }

    /// Returns the radius of the point in `lane`.
    pub fn radius(&self, lane: usize) -> f32 {
        self.radius[lane]
    }
}

impl<L: Lanes, S: Shape> PacketBlock<L> for PacketPoints<L, S> {
    type PreparedRays = RayLanes<L::PacketLanes>;

    #[inline(always)]
    fn candidate_lanes(&self) -> LaneSelection {
        LaneSelection::All
    }

    #[inline(always)]
    fn intersect(
        &self,
        rays: &RayLanes<L::PacketLanes>,
        lane: usize,
    ) -> (L::PacketLanes, <L::PacketLanes as Floats>::Mask) {
        let point = PointLanes {
            center: self.corner.plus(Vec3Lanes::splat_lane(&self.offset, lane)),
            normal: Vec3Lanes::splat_lane(&self.normal, lane),
            radius: L::PacketLanes::splat(self.radius[lane]),
        };
        count(Counted::Shapes, PACKET_WIDTH);
        S::intersect(&point, rays)
    }
}

impl LeafGeometry for Triangle {
    type Tree = FlatTriangles;
    type PreparedRays<W: PacketLanes> = RayFrame<W>;
    type PacketBlock<L: Lanes> = PacketTriangles<L>;
    type DecodedBlock<L: Lanes> = RayRelativeTriangles<Vec3Lanes<L>, L>;
    /// A value of 9 takes an eighth longer for a million triangles.
    const SPARSE_THRESHOLD: f32 = 4.0;

    #[inline(always)]
    fn prepare_rays<W: PacketLanes>(rays: &PacketRays<W>) -> RayFrame<W> {
        RayFrame::new(rays.lanes())
    }

    #[inline(always)]
    fn decode_relative_to<L: Lanes>(
        triangles: &FlatTriangles,
        block_idx: u32,
        origin: Vec3,
    ) -> RayRelativeTriangles<Vec3Lanes<L>, L> {
        let corners = triangles.blocks[block_idx as usize].corners::<L>();
        TriangleLanes::new(corners).relative_to(Vec3Lanes::splat(origin))
    }

    #[inline(always)]
    fn block_hits<L: Lanes>(
        block: &RayRelativeTriangles<Vec3Lanes<L>, L>,
        block_idx: u32,
        ray: &Ray,
    ) -> BlockHits<L> {
        let (distances, is_hit) = block.intersect(&RayFrame::new(RayLanes::new(ray)));
        let first_slot = block_idx * LANES as u32;
        BlockHits { first_slot, distances, radii: L::splat(0.0), is_hit }
    }

    #[inline(always)]
    fn packet_block<L: Lanes>(
        triangles: &FlatTriangles,
        block_idx: u32,
        packet: &Packet<L::PacketLanes>,
    ) -> PacketTriangles<L> {
        let block = &triangles.blocks[block_idx as usize];
        let lanes = TriangleLanes::new(block.corners::<L>());
        let (from, origins) = match packet.common_origin {
            Some(origin) => (origin, None),
            None => (Vec3::ZERO, Some(packet.lanes.origin())),
        };
        PacketTriangles {
            triangles: lanes.relative_to(Vec3Lanes::splat(from)).store(),
            origins,
            candidates: packet.frustum.overlapping_triangles::<L>(&block.corners),
        }
    }
}

/// The triangles of a block, prepared for a packet.
pub struct PacketTriangles<L: Lanes> {
    /// Triangles relative to the common origin of the rays, which is computed once for all eight, or else to
    /// zero.
    triangles: RayRelativeTriangles<StoredVec3Lanes, [f32; LANES]>,
    /// The origins of the rays, if they share none.
    origins: Option<Vec3Lanes<L::PacketLanes>>,
    /// The mask of triangles whose boxes overlap the packet's frustum.
    candidates: u32,
}

impl<L: Lanes> PacketBlock<L> for PacketTriangles<L> {
    type PreparedRays = RayFrame<L::PacketLanes>;

    #[inline(always)]
    fn candidate_lanes(&self) -> LaneSelection {
        LaneSelection::Mask(self.candidates)
    }

    /// The results have the same bits with and without a common origin.
    #[inline(always)]
    fn intersect(
        &self,
        rays: &RayFrame<L::PacketLanes>,
        lane: usize,
    ) -> (L::PacketLanes, <L::PacketLanes as Floats>::Mask) {
        let triangle = self.triangles.splat::<L::PacketLanes>(lane);
        match self.origins {
            None => triangle.intersect(rays),
            Some(origins) => triangle.relative_to(origins).intersect(rays),
        }
    }
}
