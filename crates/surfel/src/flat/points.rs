//! A cloud in the form that kernels read: tree nodes and leaf blocks.

use super::block::{PointBlock, fits};
use super::bounds::block_bounds;
use super::source::Source;
use crate::bvh::{self, NO_PRIMITIVE, Node, Primitive};
use crate::error::Result;
use crate::image::decode_srgb8;
use crate::math::{Aabb, LANES, Vec3};
use crate::points::PointCloud;
use crate::progress::Progress;
use crate::surface::{Gathered, SurfaceKind};
use rayon::prelude::*;

/// Points and the tree over them.
#[derive(Clone, Debug, Default)]
pub struct FlatPoints {
    pub nodes: Vec<Node>,
    pub blocks: Vec<PointBlock>,
    /// Index in the cloud of the point at each slot; `NO_POINT` where there is none.
    pub ids: Vec<u32>,
}

/// Marks a slot without a point.
pub const NO_POINT: u32 = u32::MAX;

/// A point's place: eight times its block, plus its lane.
pub type Slot = u32;

impl FlatPoints {
    /// Sorts `cloud` into a tree. Each point needs a radius (but for `SurfaceKind::Points`) and, for
    /// oriented kinds, a normal.
    ///
    /// `colors` are sRGB-encoded, one a point.
    pub fn new(
        cloud: &PointCloud,
        kind: SurfaceKind,
        colors: &[[u8; 3]],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let source = Source::new(cloud, kind, colors)?;
        let ids = 0..source.len() as u32;
        let primitives = ids.into_par_iter().map(|id| source.primitive(id)).collect();
        let tree = bvh::build(primitives, |primitives| share_a_block(kind, primitives), progress)?;
        let blocks: Vec<PointBlock> =
            tree.blocks.par_iter().map(|ids| encode(&source, ids)).collect();
        let mut nodes = tree.nodes;
        bvh::fit_boxes(&mut nodes, |block| block_bounds(kind, &blocks[block as usize]));
        Ok(Self { nodes, blocks, ids: tree.blocks.into_flattened() })
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

    /// The disc at `slot`, pierced at `position`.
    pub fn gathered(&self, slot: Slot, position: Vec3) -> Gathered {
        let (block, lane) = (&self.blocks[slot as usize / LANES], slot as usize % LANES);
        Gathered {
            center: block.position(lane),
            normal: block.normal(lane),
            radius: block.radius(lane),
            color: Vec3::from_array(block.color(lane).map(decode_srgb8)),
            position,
        }
    }

    /// Slots that hold points.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        (0..self.ids.len() as Slot).filter(|&slot| self.id(slot) != NO_POINT)
    }
}

fn share_a_block(kind: SurfaceKind, primitives: &[Primitive]) -> bool {
    let size = Aabb::of_points(primitives.iter().map(Primitive::center)).size();
    let radii = primitives.iter().map(Primitive::scale);
    let smallest = radii.clone().fold(f32::INFINITY, f32::min);
    kind == SurfaceKind::Points || fits(size, smallest, radii.fold(0.0, f32::max))
}

fn encode(source: &Source, ids: &[u32; LANES]) -> PointBlock {
    let n_points = ids.iter().filter(|&&id| id != NO_PRIMITIVE).count();
    let mut points = [source.point(ids[0]); LANES];
    for (point, &id) in points[..n_points].iter_mut().zip(ids) {
        *point = source.point(id);
    }
    PointBlock::new(&points[..n_points])
}
