//! Packets of sixteen coherent rays.

use crate::bvh::BvhNode;
use crate::flat::BlockTree;
use crate::math::{
    LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Ray, Vec3, clip_to_box, finite_inverse, set_bits,
};
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::traversal::children::{ChildBox, ChildRows};
use crate::trace::traversal::frustum::{Frustum, FrustumApex};

/// Up to sixteen coherent rays.
pub struct Packet<'r, W> {
    /// The rays.
    pub rays: &'r [Ray],
    /// The boxes at which the search begins, if not at the root.
    pub entry_points: Option<&'r [ChildRows]>,
    /// The rays in lanes.
    pub lanes: PacketRays<W>,
    /// The frustum around all rays.
    pub frustum: Frustum,
    /// The finite inverse of the directions, in the order of the frustum's axes.
    inverse: [W; 3],
    /// The origins relative to the frustum's apex, in the same order.
    relative_origin: [W; 3],
    /// The origin of all rays, if they share one.
    pub common_origin: Option<Vec3>,
}

/// A search along the rays of a packet.
pub trait PacketVisitor<L: Lanes> {
    /// The tree that is searched.
    type Tree: BlockTree;
    /// True if near boxes are visited first.
    const IS_ORDERED: bool;
    /// Average number of rays per block below which each ray is tested on its own, for all blocks of a node
    /// at once (see `sparse`). With 0, no ray is.
    const SPARSE_THRESHOLD: f32;

    /// Returns the distances beyond which rays ignore boxes; they are below any distance for a ray that is
    /// done.
    fn limits(&self) -> &[f32; PACKET_WIDTH];

    /// Tests all rays against a block.
    fn visit(&mut self, tree: &Self::Tree, block_idx: u32);

    /// Tests the ray in one lane against a block.
    fn visit_single(&mut self, tree: &Self::Tree, block_idx: u32, lane: usize);

    /// Tests rays one by one against blocks, each given with the mask of its rays.
    #[inline(always)]
    fn visit_sparse(&mut self, tree: &Self::Tree, blocks: &[(u32, u32)]) {
        for &(block_idx, lanes) in blocks {
            for lane in set_bits::<PACKET_WIDTH>(lanes) {
                self.visit_single(tree, block_idx, lane);
            }
        }
    }
}

impl<'r, W: PacketLanes> Packet<'r, W> {
    /// Builds a packet of one to sixteen rays, which `lanes` holds, too. Returns `None` if they are not
    /// coherent.
    #[inline(always)]
    pub fn new(
        root: &BvhNode,
        rays: &'r [Ray],
        lanes: PacketRays<W>,
        apex: &FrustumApex,
        entry_points: Option<&'r [ChildRows]>,
    ) -> Option<Self> {
        let frustum = Frustum::new(root, apex, std::slice::from_ref(&lanes))?;
        let [a, b, c] = frustum.axes;
        let along = [lanes.direction[a], lanes.direction[b], lanes.direction[c]];
        Some(Self {
            common_origin: lanes.common_origin(rays[0].origin),
            rays,
            entry_points,
            inverse: [finite_inverse(along[0]), finite_inverse(along[1]), finite_inverse(along[2])],
            relative_origin: [
                lanes.origin[a] - W::splat(frustum.apex[a]),
                lanes.origin[b] - W::splat(frustum.apex[b]),
                lanes.origin[c] - W::splat(frustum.apex[c]),
            ],
            lanes,
            frustum,
        })
    }

    /// Returns the distance at which each ray ends, which is negative infinity in lanes without a ray.
    #[inline(always)]
    pub fn initial_limits(&self) -> [f32; PACKET_WIDTH] {
        let mut limits = self.lanes.t_max.store();
        limits[self.rays.len()..].fill(f32::NEG_INFINITY);
        limits
    }

    /// Returns the lanes whose rays enter the box before their limits.
    #[inline(always)]
    pub fn intersect_box(&self, bounds: &ChildBox, limits: &[f32; PACKET_WIDTH]) -> u32 {
        let range = (self.lanes.t_min, W::load(limits));
        let (enter, leave) =
            clip_to_box(range, &self.relative_origin, &self.inverse, &bounds.min, &bounds.max);
        enter.le(leave).bits()
    }
}
