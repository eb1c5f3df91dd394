//! The ways of single rays and of packets through an octree: nodes and cells, about front to back.

use crate::flat::{MAX_OCTREE_DEPTH, Octree, OctreeNode};
use crate::math::{Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, Vec3, Vec3Lanes};
use crate::trace::counts::{Counted, count};

/// The size of a pixel along a ray, in the units of the ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelSize {
    /// Size at the ray's origin.
    pub at_origin: f32,
    /// Growth with the distance.
    pub per_distance: f32,
}

impl PixelSize {
    /// Points as fine as they are.
    pub const ZERO: Self = Self { at_origin: 0.0, per_distance: 0.0 };

    /// Returns the size in units that are `factor` as long.
    pub fn scaled(self, factor: f32) -> Self {
        Self { at_origin: factor * self.at_origin, ..self }
    }

    /// Returns the size at a distance.
    #[inline(always)]
    fn at<F: Floats>(&self, distance: F) -> F {
        F::splat(self.at_origin) + F::splat(self.per_distance) * distance
    }
}

/// Rays in lanes: one ray, or those of a packet.
#[derive(Clone, Copy)]
pub struct WalkRays<F> {
    /// Origins.
    pub origin: Vec3Lanes<F>,
    /// Unit directions.
    pub direction: Vec3Lanes<F>,
    /// The `finite_inverse` of the directions.
    pub inverse: Vec3Lanes<F>,
    /// Least distances at which hits count.
    pub t_min: F,
    /// Greatest distances at which hits count.
    pub t_max: F,
}

/// The cube of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellCube {
    /// Lower corner.
    pub min: Vec3,
    /// Length of the sides.
    pub size: f32,
}

/// A cell with the intervals of rays in it.
#[derive(Clone, Copy)]
pub struct CellInterval<F> {
    /// Index of the cell.
    pub cell_idx: u32,
    /// Distances at which the rays enter the cell.
    pub enter: F,
    /// Distances at which the rays leave the cell.
    pub leave: F,
    /// The cell's cube.
    pub cube: CellCube,
}

/// A node that is still to be visited by some of the lanes.
#[derive(Clone, Copy)]
struct PendingNode {
    node_idx: u32,
    lanes: u32,
    cube: CellCube,
}

/// The nodes that are still to be visited. Its memory is reused from ray to ray.
pub struct OctreeWalk<'t> {
    octree: &'t Octree,
    pixel: PixelSize,
    pending: [PendingNode; MAX_PENDING],
    n_pending: usize,
    /// The child that the rays enter first, if they enter all.
    nearest_child: usize,
}

/// Factor on the size of a cell by which hits may lie outside of it.
pub const MAX_CELL_MARGIN: f32 = 0.1;

/// Seven children of each node above the deepest wait, and all of the last one.
const MAX_PENDING: usize = 7 * MAX_OCTREE_DEPTH + 8;

/// For each axis the children on its upper side.
const UPPER: [[f32; LANES]; 3] = [
    [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0],
    [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
];

impl CellCube {
    /// Returns the child at an index.
    #[inline(always)]
    fn child(&self, i: usize) -> Self {
        let size = 0.5 * self.size;
        let upper = Vec3::from_array([0, 1, 2].map(|axis: usize| (i >> axis & 1) as f32));
        Self { min: self.min + size * upper, size }
    }
}

/// Returns the intervals of the lines of rays in the cube from `lower`, which is relative to their origins. They do not
/// depend on the rays' ranges, nor does the place where a surface is found in them.
#[inline(always)]
fn interval<F: Floats>(rays: &WalkRays<F>, lower: Vec3Lanes<F>, size: F) -> (F, F) {
    let (mut enter, mut leave) = (F::splat(f32::NEG_INFINITY), F::splat(f32::INFINITY));
    let axes = [(lower.x, rays.inverse.x), (lower.y, rays.inverse.y), (lower.z, rays.inverse.z)];
    for (lower, inverse) in axes {
        let (a, b) = (lower * inverse, (lower + size) * inverse);
        (enter, leave) = (a.min(b).max(enter), a.max(b).min(leave));
    }
    (enter, leave)
}

/// Returns the lanes whose rays pass a cube in this interval before their limits, or closely beside it.
#[inline(always)]
fn is_passed<F: Floats>(rays: &WalkRays<F>, (enter, leave): (F, F), size: F, limits: F) -> F::Mask {
    let margin = F::splat(MAX_CELL_MARGIN) * size;
    enter.le(leave) & rays.t_min.le(leave + margin) & (enter - margin).le(limits)
}

impl<'t> OctreeWalk<'t> {
    /// Returns the walk of no ray.
    pub fn new(octree: &'t Octree, pixel: PixelSize) -> Self {
        let cube = CellCube { min: Vec3::ZERO, size: 0.0 };
        let pending = [PendingNode { node_idx: 0, lanes: 0, cube }; MAX_PENDING];
        Self { octree, pixel, pending, n_pending: 0, nearest_child: 0 }
    }

    /// Starts at the root with the rays in `lanes`, whose directions are about `direction`.
    #[inline(always)]
    pub fn start(&mut self, lanes: u32, direction: Vec3) {
        let is_negative = |axis: usize| usize::from(direction[axis] < 0.0) << axis;
        self.nearest_child = is_negative(0) | is_negative(1) | is_negative(2);
        self.n_pending = 0;
        if let Some(cube) = self.octree.cube() {
            let cube = CellCube { min: cube.min, size: cube.size().x };
            self.pending[0] = PendingNode { node_idx: 0, lanes, cube };
            self.n_pending = 1;
        }
    }

    /// Returns the next cell that rays of a packet pass through before their `limits`, and the lanes of these.
    #[inline(always)]
    pub fn next_cell<F: Floats>(
        &mut self,
        rays: &WalkRays<F>,
        limits: F,
    ) -> Option<(CellInterval<F>, u32)> {
        while 0 < self.n_pending {
            self.n_pending -= 1;
            let PendingNode { node_idx, lanes, cube } = self.pending[self.n_pending];
            count(Counted::Cells, PACKET_WIDTH);
            let lower = Vec3Lanes::splat(cube.min).minus(rays.origin);
            let (enter, leave) = interval(rays, lower, F::splat(cube.size));
            let passed =
                lanes & is_passed(rays, (enter, leave), F::splat(cube.size), limits).bits();
            if passed == 0 {
                continue;
            }
            let node = self.octree.node(node_idx);
            let shown = passed & self.shown_lanes(node, cube.size, enter.max(rays.t_min));
            if shown != passed {
                self.add_all_children(node, &cube, passed & !shown);
            }
            if shown != 0 {
                let cell_idx = node.cell - 1;
                return Some((CellInterval { cell_idx, enter, leave, cube }, shown));
            }
        }
        None
    }

    /// Returns the next cell that one ray passes through before its `limit`.
    #[inline(always)]
    pub fn next_cell_of_ray<L: Lanes>(
        &mut self,
        ray: &WalkRays<f32>,
        lanes: &WalkRays<L>,
        limit: f32,
    ) -> Option<CellInterval<f32>> {
        while 0 < self.n_pending {
            self.n_pending -= 1;
            let PendingNode { node_idx, cube, .. } = self.pending[self.n_pending];
            count(Counted::Cells, 1);
            let node = self.octree.node(node_idx);
            let lower = Vec3Lanes::splat(cube.min).minus(ray.origin);
            let (enter, leave) = interval(ray, lower, cube.size);
            if !is_passed(ray, (enter, leave), cube.size, limit) {
                continue;
            }
            if self.shown_lanes(node, cube.size, enter.max(ray.t_min)) != 0 {
                return Some(CellInterval { cell_idx: node.cell - 1, enter, leave, cube });
            }
            self.add_passed_children(node, &cube, lanes);
        }
        None
    }

    /// Returns the lanes for which the cell of a node is fine enough.
    #[inline(always)]
    fn shown_lanes<F: Floats>(&self, node: &OctreeNode, size: f32, enter: F) -> u32 {
        if node.cell == 0 {
            return 0;
        }
        let is_small = F::splat(size).le(self.pixel.at(enter)).bits();
        if node.is_finest { u32::MAX } else { is_small }
    }

    #[inline(always)]
    fn add(&mut self, node: &OctreeNode, cube: &CellCube, child: usize, lanes: u32) {
        let before = node.children & ((1 << child) - 1) as u8;
        let node_idx = node.first_child + before.count_ones();
        self.pending[self.n_pending] = PendingNode { node_idx, lanes, cube: cube.child(child) };
        self.n_pending += 1;
    }

    /// Adds all children, the farthest first.
    #[inline(always)]
    fn add_all_children(&mut self, node: &OctreeNode, cube: &CellCube, lanes: u32) {
        for order in (0..LANES).rev() {
            let child = order ^ self.nearest_child;
            if node.children >> child & 1 == 1 {
                self.add(node, cube, child, lanes);
            }
        }
    }

    /// Adds the children that a ray passes through, the farthest first. The ray is in all lanes.
    #[inline(always)]
    fn add_passed_children<L: Lanes>(
        &mut self,
        node: &OctreeNode,
        cube: &CellCube,
        ray: &WalkRays<L>,
    ) {
        let size = L::splat(0.5 * cube.size);
        let upper = Vec3Lanes {
            x: size * L::load(&UPPER[0]),
            y: size * L::load(&UPPER[1]),
            z: size * L::load(&UPPER[2]),
        };
        let lower = Vec3Lanes::splat(cube.min).plus(upper).minus(ray.origin);
        let (enter, leave) = interval(ray, lower, size);
        let passed = is_passed(ray, (enter, leave), size, ray.t_max).bits();
        let passed = passed & u32::from(node.children);
        for order in (0..LANES).rev() {
            let child = order ^ self.nearest_child;
            if passed >> child & 1 == 1 {
                self.add(node, cube, child, 1);
            }
        }
    }
}
