//! A cloud in the form that kernels read: tree nodes and leaf blocks.

use super::block::PointBlock;
use super::bounds::block_bounds;
use super::source::{Source, fits};
use super::tree::BlockTree;
use crate::bvh::{self, NO_PRIMITIVE, Node, Primitive};
use crate::error::Result;
use crate::image::decode_srgb8;
use crate::math::{LANES, Vec3};
use crate::points::PointCloud;
use crate::progress::Progress;
use crate::surface::{Gathered, SurfaceKind};
use rayon::prelude::*;

/// Points and the tree over them.
#[derive(Clone, Debug, Default)]
pub struct FlatPoints {
    pub nodes: Vec<Node>,
    pub blocks: Vec<PointBlock>,
    /// Index in the cloud of the point at each slot; `NO_PRIMITIVE` where there is none.
    pub ids: Vec<u32>,
    /// Of the tree when it was built: the nodes and blocks that a random ray is expected to visit.
    pub cost: f64,
}

impl BlockTree for FlatPoints {
    type Block = PointBlock;

    #[inline(always)]
    fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    #[inline(always)]
    fn blocks(&self) -> &[PointBlock] {
        &self.blocks
    }
}

/// A point's place: eight times its block, plus its lane.
pub type Slot = u32;

impl FlatPoints {
    /// Sorts `cloud` into a tree. Each point needs a radius (but for `SurfaceKind::Points`) and, for
    /// oriented kinds, a normal.
    ///
    /// `colors` are sRGB-encoded, one a point. Points that nothing can hit are left out: those whose
    /// position or radius is not finite, or whose radius is not positive.
    pub fn new(
        cloud: &PointCloud,
        kind: SurfaceKind,
        colors: &[[u8; 3]],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let source = Source::new(cloud, kind, colors)?;
        let ids = 0..source.len() as u32;
        let primitives = ids.into_par_iter().map(|id| source.primitive(id)).collect();
        let fits = |primitives: &[Primitive]| {
            fits(kind, primitives.iter().map(|p| (p.center(), p.scale())))
        };
        let tree = bvh::build(primitives, fits, progress)?;
        let encode = |ids: &[u32; LANES]| PointBlock::new(source.points(ids).as_slice());
        let blocks: Vec<PointBlock> = tree.blocks.par_iter().map(encode).collect();
        let ids = tree.blocks.into_flattened();
        let mut points = Self { nodes: tree.nodes, blocks, ids, cost: 0.0 };
        points.cost = points.fit_boxes(kind);
        if cfg!(debug_assertions) {
            points.validate(kind);
        }
        Ok(points)
    }

    /// Sets the boxes of the tree and returns its cost.
    pub(super) fn fit_boxes(&mut self, kind: SurfaceKind) -> f64 {
        let Self { nodes, blocks, .. } = self;
        bvh::fit_boxes(nodes, |block| block_bounds(kind, &blocks[block as usize]))
    }

    /// Panics unless the boxes of the tree contain all that a ray can hit.
    pub fn validate(&self, kind: SurfaceKind) {
        bvh::validate_boxes(&self.nodes, |block| block_bounds(kind, &self.blocks[block as usize]));
        assert_eq!(self.ids.len(), self.blocks.len() * LANES);
    }

    /// Bytes of the tree, and of the points.
    pub fn bytes(&self) -> (usize, usize) {
        let points = size_of_val(self.blocks.as_slice()) + size_of_val(self.ids.as_slice());
        (size_of_val(self.nodes.as_slice()), points)
    }

    /// The point's index in its cloud.
    pub fn id(&self, slot: Slot) -> u32 {
        self.ids[slot as usize]
    }

    pub(super) fn greatest_radius(&self) -> f32 {
        self.blocks.par_iter().map(PointBlock::greatest_radius).reduce(|| 0.0, f32::max)
    }

    pub fn radius(&self, slot: Slot) -> f32 {
        self.blocks[slot as usize / LANES].radius(slot as usize % LANES)
    }

    #[inline]
    pub fn center(&self, slot: Slot) -> Vec3 {
        self.blocks[slot as usize / LANES].position(slot as usize % LANES)
    }

    /// Unit.
    #[inline]
    pub fn normal(&self, slot: Slot) -> Vec3 {
        self.blocks[slot as usize / LANES].normal(slot as usize % LANES)
    }

    /// The point at `slot`, with its colour.
    #[inline]
    pub fn gathered(&self, slot: Slot) -> Gathered {
        let (block, lane) = (&self.blocks[slot as usize / LANES], slot as usize % LANES);
        Gathered {
            center: block.position(lane),
            normal: block.normal(lane),
            radius: block.radius(lane),
            color: Vec3::from_array(block.color(lane).map(decode_srgb8)),
        }
    }

    /// Slots that hold points.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        (0..self.ids.len() as Slot).filter(|&slot| self.id(slot) != NO_PRIMITIVE)
    }
}
