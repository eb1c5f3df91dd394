//! Points in the form that kernels read: tree nodes and leaf blocks.

use super::block::PointBlock;
use super::block_tree::{BlockTree, Slot};
use super::bounds::block_bounds;
use super::point_columns::{PointColumns, fits_precision};
use crate::bvh::{self, BvhNode, BvhPrimitive, NO_PRIMITIVE};
use crate::error::Result;
use crate::image::decode_srgb8;
use crate::math::{Aabb, LANES, Vec3, median};
use crate::points::mean_overlap;
use crate::progress::Progress;
use crate::surface::{SurfaceKind, Surfel};
use rayon::prelude::*;

/// Points and the tree over them.
#[derive(Clone, Debug, Default)]
pub struct FlatPoints {
    /// Nodes of the tree, the root first.
    pub nodes: Vec<BvhNode>,
    /// Leaf blocks of the tree.
    pub blocks: Vec<PointBlock>,
    /// Index in the cloud of the point at each slot, or `NO_PRIMITIVE` in unused slots.
    pub ids: Vec<u32>,
    /// Expected number of nodes and blocks that a random ray visits, for the boxes of the tree when it was built.
    pub cost: f64,
}

impl BlockTree for FlatPoints {
    type Block = PointBlock;

    #[inline(always)]
    fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    #[inline(always)]
    fn blocks(&self) -> &[PointBlock] {
        &self.blocks
    }
}

impl FlatPoints {
    /// Sorts points into a tree. The tree leaves out points that no ray can hit: those whose position or radius is
    /// not finite, or whose radius is not positive.
    ///
    /// # Errors
    ///
    /// Fails if `progress` is cancelled.
    pub fn new(columns: PointColumns, progress: &dyn Progress) -> Result<Self> {
        let kind = columns.kind();
        let ids = 0..columns.len() as u32;
        let primitives = ids.into_par_iter().map(|id| columns.primitive(id)).collect();
        let can_share_block = |primitives: &[BvhPrimitive]| {
            fits_precision(kind, primitives.iter().map(|p| (p.center(), p.payload())))
        };
        let tree = bvh::build(primitives, can_share_block, progress)?;
        let encode = |ids: &[u32; LANES]| PointBlock::new(columns.points(ids).as_slice());
        let blocks: Vec<PointBlock> = tree.blocks.par_iter().map(encode).collect();
        let ids = tree.blocks.into_flattened();
        let mut points = Self { nodes: tree.nodes, blocks, ids, cost: 0.0 };
        points.cost = points.refit_boxes(kind);
        if cfg!(debug_assertions) {
            points.validate(kind);
        }
        Ok(points)
    }

    /// Recomputes the boxes of the tree and returns its cost.
    pub(super) fn refit_boxes(&mut self, kind: SurfaceKind) -> f64 {
        let Self { nodes, blocks, .. } = self;
        bvh::refit_boxes(nodes, |block| block_bounds(kind, &blocks[block as usize]))
    }

    /// Panics unless the boxes of the tree contain all that a ray can hit.
    pub fn validate(&self, kind: SurfaceKind) {
        bvh::validate_boxes(&self.nodes, |block| block_bounds(kind, &self.blocks[block as usize]));
        assert_eq!(self.ids.len(), self.blocks.len() * LANES);
    }

    /// Returns the sizes of the tree and of the points in bytes.
    pub fn bytes(&self) -> (usize, usize) {
        let points = size_of_val(self.blocks.as_slice()) + size_of_val(self.ids.as_slice());
        (size_of_val(self.nodes.as_slice()), points)
    }

    /// Returns the index in the cloud of the point at `slot`, or `NO_PRIMITIVE` if the slot is unused.
    pub fn id(&self, slot: Slot) -> u32 {
        self.ids[slot as usize]
    }

    /// Returns the largest radius of all points.
    pub(super) fn max_radius(&self) -> f32 {
        self.blocks.par_iter().map(PointBlock::max_radius).reduce(|| 0.0, f32::max)
    }

    /// Returns how evenly the points are placed: the median, over a sample of blocks, of the least distance between
    /// two of a block's points in radii. It is about 0.4 for evenly spaced points and 0.15 for random ones; infinite
    /// if no block is full.
    pub(super) fn evenness(&self) -> f32 {
        median(self.sample().filter_map(PointBlock::min_distance)).unwrap_or(f32::INFINITY)
    }

    /// Returns up to a thousand blocks, spread over all.
    fn sample(&self) -> impl Iterator<Item = &PointBlock> + Clone {
        const N_SAMPLES: usize = 1000;
        let step = self.blocks.len().div_ceil(N_SAMPLES).max(1);
        self.blocks.iter().step_by(step)
    }

    /// Returns the number of discs over each other, by a sample of the blocks and their greatest radii.
    pub(super) fn overlap(&self) -> f32 {
        let sample = self.sample();
        let bounds = Aabb::of_points(sample.clone().map(|block| block.position(0)));
        mean_overlap(self.ids.len(), sample.map(PointBlock::max_radius), bounds)
    }

    /// Returns the radius of the point at `slot`.
    pub fn radius(&self, slot: Slot) -> f32 {
        self.blocks[slot as usize / LANES].radius(slot as usize % LANES)
    }

    /// Returns the centre of the point at `slot`.
    #[inline]
    pub fn center(&self, slot: Slot) -> Vec3 {
        self.blocks[slot as usize / LANES].position(slot as usize % LANES)
    }

    /// Returns the unit normal of the point at `slot`.
    #[inline]
    pub fn normal(&self, slot: Slot) -> Vec3 {
        self.blocks[slot as usize / LANES].normal(slot as usize % LANES)
    }

    /// Returns the point at `slot` with its linear colour.
    #[inline(always)]
    pub fn surfel(&self, slot: Slot) -> Surfel {
        let (block, lane) = (&self.blocks[slot as usize / LANES], slot as usize % LANES);
        Surfel {
            center: block.position(lane),
            normal: block.normal(lane),
            radius: block.radius(lane),
            color: Vec3::from_array(block.color(lane).map(decode_srgb8)),
        }
    }

    /// Returns the slots that hold points.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        (0..self.ids.len() as Slot).filter(|&slot| self.id(slot) != NO_PRIMITIVE)
    }
}
