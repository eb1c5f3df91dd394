//! Triangles in the form that kernels read: tree nodes and leaf blocks.

use super::block_tree::{BlockTree, Slot};
use super::refit::Refit;
use crate::bvh::{self, BvhNode, BvhPrimitive, NO_PRIMITIVE};
use crate::error::{Error, Result};
use crate::math::{Aabb, Floats, LANES, Lanes, PortableLanes, Vec3, Vec3Lanes};
use crate::progress::Progress;
use crate::surface::triangle;
use rayon::prelude::*;

/// Triangles and the tree over them.
#[derive(Clone, Debug, Default)]
pub struct FlatTriangles {
    /// Nodes of the tree, the root first.
    pub nodes: Vec<BvhNode>,
    /// Leaf blocks of the tree.
    pub blocks: Vec<TriangleBlock>,
    /// Expected number of nodes and blocks that a random ray visits, for the boxes of the tree when it was built.
    pub cost: f64,
}

/// Eight triangles, lane by lane, with the unchanged coordinates of the mesh, so that shared edges stay shared.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct TriangleBlock {
    /// Coordinates by corner, axis and lane. The three corners of an unused lane are equal, so that no ray hits
    /// them.
    pub corners: [[[f32; LANES]; 3]; 3],
    /// Index in the mesh of each triangle, or `NO_PRIMITIVE` in unused lanes.
    pub ids: [u32; LANES],
}

impl TriangleBlock {
    /// Returns the triangles of `ids`, at least the first of which must be a triangle, with these corners.
    fn new(ids: &[u32; LANES], corners: impl Fn(u32) -> [Vec3; 3]) -> Self {
        let mut block = Self { corners: [[[0.0; LANES]; 3]; 3], ids: *ids };
        let unused = [corners(ids[0])[0]; 3];
        for (lane, &id) in ids.iter().enumerate() {
            let corners = if id == NO_PRIMITIVE { unused } else { corners(id) };
            for (rows, corner) in block.corners.iter_mut().zip(corners) {
                for axis in 0..3 {
                    rows[axis][lane] = corner[axis];
                }
            }
        }
        block
    }

    /// Loads the three corners of all triangles.
    #[inline(always)]
    pub fn corners<L: Lanes>(&self) -> [Vec3Lanes<L>; 3] {
        [load(&self.corners[0]), load(&self.corners[1]), load(&self.corners[2])]
    }

    /// Returns the corners of the triangle in `lane`.
    pub fn triangle(&self, lane: usize) -> [Vec3; 3] {
        self.corners.map(|[x, y, z]| Vec3::new(x[lane], y[lane], z[lane]))
    }

    /// Returns the bounding box of all lanes. Unused lanes hold a corner of the first triangle.
    fn bounds(&self) -> Aabb {
        let [a, b, c] = self.corners::<PortableLanes>();
        let low = [a.x.min(b.x).min(c.x), a.y.min(b.y).min(c.y), a.z.min(b.z).min(c.z)];
        let high = [a.x.max(b.x).max(c.x), a.y.max(b.y).max(c.y), a.z.max(b.z).max(c.z)];
        Aabb {
            min: Vec3::from_array(low.map(|lanes| lanes.reduce_min())),
            max: Vec3::from_array(high.map(|lanes| lanes.reduce_max())),
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
    fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    #[inline(always)]
    fn blocks(&self) -> &[TriangleBlock] {
        &self.blocks
    }
}

impl FlatTriangles {
    /// Sorts triangles into a tree, which leaves out those that no ray can hit: triangles without area, or not
    /// finite.
    ///
    /// # Errors
    ///
    /// Fails if there are too many triangles for 32-bit indices, or if `progress` is cancelled.
    pub fn new(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let corners = |id: u32| triangles[id as usize].map(|vertex| positions[vertex as usize]);
        let primitive = |id: u32| {
            let corners = corners(id);
            let bounds =
                if is_traceable(corners) { triangle::bounds(corners) } else { Aabb::EMPTY };
            BvhPrimitive::new(bounds, id, 0.0)
        };
        let n_triangles = u32::try_from(triangles.len()).map_err(|_| Error::TooManyBlocks {
            found: triangles.len() / LANES,
            limit: u32::MAX as usize / LANES,
        })?;
        let ids = 0..n_triangles;
        let tree = bvh::build(ids.into_par_iter().map(primitive).collect(), |_| true, progress)?;
        let encode = |ids: &[u32; LANES]| TriangleBlock::new(ids, corners);
        let blocks = tree.blocks.par_iter().map(encode).collect();
        let mut flat = Self { nodes: tree.nodes, blocks, cost: 0.0 };
        flat.cost = flat.refit_boxes();
        if cfg!(debug_assertions) {
            flat.validate();
        }
        Ok(flat)
    }

    /// Moves the corners to `positions`, which has as many vertices for the same triangles.
    ///
    /// The tree needs a rebuild if its cost ratio exceeds `MAX_COST_RATIO`, or if other triangles than before are
    /// traceable.
    pub fn refit(&mut self, positions: &[Vec3], triangles: &[[u32; 3]]) -> Refit {
        let corners = |id: u32| triangles[id as usize].map(|vertex| positions[vertex as usize]);
        let ids = 0..triangles.len() as u32;
        let n_traceable = ids.into_par_iter().filter(|&id| is_traceable(corners(id))).count();
        let encode = |block: &mut TriangleBlock| {
            *block = TriangleBlock::new(&block.ids, corners);
            let used = block.ids.iter().filter(|&&id| id != NO_PRIMITIVE);
            used.filter(|&&id| is_traceable(corners(id))).count()
        };
        let n_kept: usize = self.blocks.par_iter_mut().map(encode).sum();
        if n_kept != n_traceable || self.slots().count() != n_traceable {
            return Refit::NeedsRebuild;
        }
        Refit::from_costs(self.refit_boxes(), self.cost)
    }

    fn refit_boxes(&mut self) -> f64 {
        let Self { nodes, blocks, .. } = self;
        bvh::refit_boxes(nodes, |block| blocks[block as usize].bounds())
    }

    /// Panics unless the boxes of the tree contain all that a ray can hit.
    pub fn validate(&self) {
        bvh::validate_boxes(&self.nodes, |block| self.blocks[block as usize].bounds());
    }

    /// Returns the index in the mesh of the triangle at `slot`, or `NO_PRIMITIVE` if the slot is unused.
    pub fn id(&self, slot: Slot) -> u32 {
        self.blocks[slot as usize / LANES].ids[slot as usize % LANES]
    }

    /// Returns the corners of the triangle at `slot`.
    pub fn triangle(&self, slot: Slot) -> [Vec3; 3] {
        self.blocks[slot as usize / LANES].triangle(slot as usize % LANES)
    }

    /// Returns the sizes of the tree and of the triangles in bytes.
    pub fn bytes(&self) -> (usize, usize) {
        (size_of_val(self.nodes.as_slice()), size_of_val(self.blocks.as_slice()))
    }

    /// Returns the slots that hold triangles.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        let n_slots = (LANES * self.blocks.len()) as Slot;
        (0..n_slots).filter(|&slot| self.id(slot) != NO_PRIMITIVE)
    }
}

/// Returns true if a triangle has an area, and one within the range of f32.
fn is_traceable([a, b, c]: [Vec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    normal != Vec3::ZERO && normal.is_finite() && a.is_finite() && b.is_finite() && c.is_finite()
}
