//! Triangles in the form that kernels read: tree nodes and leaf blocks.

use super::points::Slot;
use super::refit::Refit;
use super::tree::BlockTree;
use crate::bvh::{self, NO_PRIMITIVE, Node, Primitive};
use crate::error::Result;
use crate::math::{Aabb, Floats, LANES, Lanes, PortableLanes, Vec3, Vec3Lanes};
use crate::progress::Progress;
use crate::surface::triangle;
use rayon::prelude::*;

/// Triangles and the tree over them.
#[derive(Clone, Debug, Default)]
pub struct FlatTriangles {
    pub nodes: Vec<Node>,
    pub blocks: Vec<TriangleBlock>,
    /// Of the tree when it was built: the nodes and blocks that a random ray is expected to visit.
    pub cost: f64,
}

/// Eight triangles, lane by lane: coordinates as the mesh has them, so that shared edges stay shared.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct TriangleBlock {
    /// Corner by corner, axis by axis; an unused lane has three times the same place, which nothing hits.
    pub corners: [[[f32; LANES]; 3]; 3],
    /// Index in the mesh of each triangle; `NO_PRIMITIVE` in unused lanes.
    pub ids: [u32; LANES],
}

impl TriangleBlock {
    /// Of the triangles that `ids` name, the first of which is one, with these corners.
    fn new(ids: &[u32; LANES], corners: impl Fn(u32) -> [Vec3; 3]) -> Self {
        let mut block = Self { corners: [[[0.0; LANES]; 3]; 3], ids: *ids };
        let unused = [corners(ids[0])[0]; 3];
        for (lane, &id) in ids.iter().enumerate() {
            let corners = if id == NO_PRIMITIVE { unused } else { corners(id) };
            for (place, corner) in block.corners.iter_mut().zip(corners) {
                for axis in 0..3 {
                    place[axis][lane] = corner[axis];
                }
            }
        }
        block
    }

    #[inline(always)]
    pub fn corners<L: Lanes>(&self) -> [Vec3Lanes<L>; 3] {
        [load(&self.corners[0]), load(&self.corners[1]), load(&self.corners[2])]
    }

    pub fn triangle(&self, lane: usize) -> [Vec3; 3] {
        self.corners.map(|[x, y, z]| Vec3::new(x[lane], y[lane], z[lane]))
    }

    /// Unused lanes have a place of the first triangle, so that all lanes count.
    fn bounds(&self) -> Aabb {
        let [a, b, c] = self.corners::<PortableLanes>();
        let low = [a.x.min(b.x).min(c.x), a.y.min(b.y).min(c.y), a.z.min(b.z).min(c.z)];
        let high = [a.x.max(b.x).max(c.x), a.y.max(b.y).max(c.y), a.z.max(b.z).max(c.z)];
        Aabb {
            min: Vec3::from_array(low.map(|lanes| lanes.min_lane())),
            max: Vec3::from_array(high.map(|lanes| lanes.max_lane())),
        }
    }
}

#[inline(always)]
fn load<L: Lanes>([x, y, z]: &[[f32; LANES]; 3]) -> Vec3Lanes<L> {
    Vec3Lanes { x: L::load(x), y: L::load(y), z: L::load(z) }
}

impl BlockTree for FlatTriangles {
    type Block = TriangleBlock;

    #[inline(always)]
    fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    #[inline(always)]
    fn blocks(&self) -> &[TriangleBlock] {
        &self.blocks
    }
}

impl FlatTriangles {
    /// Sorts triangles into a tree. Those that nothing can hit are left out: without area, or not finite.
    pub fn new(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let corners = |id: u32| triangles[id as usize].map(|vertex| positions[vertex as usize]);
        let primitive = |id: u32| {
            let corners = corners(id);
            let bounds = if is_solid(corners) { triangle::bounds(corners) } else { Aabb::EMPTY };
            Primitive::new(bounds, id, 0.0)
        };
        let ids = 0..triangles.len() as u32;
        let tree = bvh::build(ids.into_par_iter().map(primitive).collect(), |_| true, progress)?;
        let encode = |ids: &[u32; LANES]| TriangleBlock::new(ids, corners);
        let blocks = tree.blocks.par_iter().map(encode).collect();
        let mut flat = Self { nodes: tree.nodes, blocks, cost: 0.0 };
        flat.cost = flat.fit_boxes();
        if cfg!(debug_assertions) {
            flat.validate();
        }
        Ok(flat)
    }

    /// Moves the corners to where `positions` now has them, of as many vertices under the same triangles.
    ///
    /// The tree is unfit if its cost exceeds `REBUILD_COST`, or if other triangles than before can be hit.
    pub fn refit(&mut self, positions: &[Vec3], triangles: &[[u32; 3]]) -> Refit {
        let corners = |id: u32| triangles[id as usize].map(|vertex| positions[vertex as usize]);
        let ids = 0..triangles.len() as u32;
        let n_solid = ids.into_par_iter().filter(|&id| is_solid(corners(id))).count();
        let encode = |block: &mut TriangleBlock| {
            *block = TriangleBlock::new(&block.ids, corners);
            let used = block.ids.iter().filter(|&&id| id != NO_PRIMITIVE);
            used.filter(|&&id| is_solid(corners(id))).count()
        };
        let n_kept: usize = self.blocks.par_iter_mut().map(encode).sum();
        if n_kept != n_solid || self.slots().count() != n_solid {
            return Refit::Unfit;
        }
        Refit::of(self.fit_boxes() / self.cost)
    }

    fn fit_boxes(&mut self) -> f64 {
        let Self { nodes, blocks, .. } = self;
        bvh::fit_boxes(nodes, |block| blocks[block as usize].bounds())
    }

    /// Panics unless the boxes of the tree contain all that a ray can hit.
    pub fn validate(&self) {
        bvh::validate_boxes(&self.nodes, |block| self.blocks[block as usize].bounds());
    }

    /// The triangle's index in its mesh.
    pub fn id(&self, slot: Slot) -> u32 {
        self.blocks[slot as usize / LANES].ids[slot as usize % LANES]
    }

    /// Corners of the triangle at `slot`.
    pub fn triangle(&self, slot: Slot) -> [Vec3; 3] {
        self.blocks[slot as usize / LANES].triangle(slot as usize % LANES)
    }

    /// Bytes of the tree, and of the triangles.
    pub fn bytes(&self) -> (usize, usize) {
        (size_of_val(self.nodes.as_slice()), size_of_val(self.blocks.as_slice()))
    }

    /// Slots that hold triangles.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        let n_slots = (LANES * self.blocks.len()) as Slot;
        (0..n_slots).filter(|&slot| self.id(slot) != NO_PRIMITIVE)
    }
}

/// Whether a triangle has an area, and one in the range of f32.
fn is_solid([a, b, c]: [Vec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    normal != Vec3::ZERO && normal.is_finite() && a.is_finite() && b.is_finite() && c.is_finite()
}
