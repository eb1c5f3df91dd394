//! Construction of octrees level by level, each from points whose supports are as wide as its cells need.

use super::cube_points::CubePoints;
use super::octree::{
    CellCorners, CellPlane, MAX_OCTREE_BYTES_PER_POINT, MAX_OCTREE_DEPTH, Octree, OctreeNode,
};
use super::octree_cells::{FINEST_CELL, Level, OctreeCell, PlacedCell};
use super::points::FieldPoints;
use crate::error::Result;
use crate::flat::points::FlatPoints;
use crate::math::{Aabb, Vec3};
use crate::progress::Progress;
use crate::surface::{FIELD_SUPPORT, OctreeDepth};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Minimum support of the points of a level, in sizes of its cells: a cell that the surface touches has values at all of
/// its corners, 1.74 sides away at most. Wider supports than those of the points themselves tell coarse cells from the
/// finest, so that this stays below `FIELD_SUPPORT / FINEST_CELL`.
const MIN_LEVEL_SUPPORT: f32 = 2.0;

/// Number of points for each point of the cloud that the search for the cells of a level looks at. Clouds of surfaces need
/// about a thousand; among points that lie on each other in great numbers there is no end.
const STEPS_PER_POINT: usize = 4000;
/// Number of cells that the octree of any cloud may have.
const MIN_CELLS: usize = 64;

/// The choices of an octree.
#[derive(Clone, Copy, Debug)]
pub struct OctreeOptions {
    /// True for the field at the corners of cells, false for planes.
    pub has_corners: bool,
    /// The depth of the cells.
    pub depth: OctreeDepth,
    /// True if cells beyond the outermost points are left out.
    pub has_edge_test: bool,
    /// True if all normals point to the same side of the surface.
    pub has_sides: bool,
}

impl Octree {
    /// Builds an octree over points.
    ///
    /// The result does not depend on the number of threads. It takes at most `MAX_OCTREE_BYTES_PER_POINT` bytes a point
    /// or 64 cells, for which deeper levels are left out; a warning says so if they were asked for.
    ///
    /// # Errors
    ///
    /// Fails if `progress` is cancelled.
    pub fn new(
        points: &FlatPoints,
        options: &OctreeOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let tree = match options.has_corners {
            true => {
                let (tree, corners) = build::<CellCorners>(points, options, progress)?;
                Self { corners, ..tree }
            }
            false => {
                let (tree, planes) = build::<CellPlane>(points, options, progress)?;
                Self { planes, ..tree }
            }
        };
        if let OctreeDepth::Levels(wanted) = options.depth
            && tree.cube.is_some()
            && tree.depth < wanted as usize
        {
            let line = format!("the octree has {} levels: more take too much memory", tree.depth);
            progress.warning(&line, &["octree_depth"]);
        }
        Ok(tree)
    }
}

fn build<C: OctreeCell>(
    points: &FlatPoints,
    options: &OctreeOptions,
    progress: &dyn Progress,
) -> Result<(Octree, Vec<C>)> {
    let field = FieldPoints::new(points, options.has_sides);
    let all = field.all();
    let size = all.bounds.size().max_element();
    if all.is_empty() || !size.is_finite() {
        return Ok((Octree::default(), Vec::new()));
    }
    let finest = FINEST_CELL * all.mean_support() / FIELD_SUPPORT;
    let natural = (size / finest).log2().ceil().clamp(1.0, MAX_OCTREE_DEPTH as f32) as usize;
    let (depth, side) = match options.depth {
        OctreeDepth::Auto => (natural, size.max(finest * (natural as f32).exp2())),
        OctreeDepth::Levels(levels) => ((levels as usize).clamp(1, MAX_OCTREE_DEPTH), size),
    };
    let min = all.bounds.center() - 0.5 * side;
    let cube = Aabb { min, max: min + Vec3::splat(side) };
    let is_adaptive = options.depth == OctreeDepth::Auto;
    let n_bytes = MAX_OCTREE_BYTES_PER_POINT * all.slots.len();
    // A cell has a node, and its share of the nodes above.
    let cell_bytes = size_of::<C>() + 2 * size_of::<OctreeNode>();
    let n_left = AtomicUsize::new((n_bytes / cell_bytes).max(MIN_CELLS));
    progress.begin("build octree", depth as u64 + 1);
    let cells_of = |level: usize, is_deepest: bool| {
        let cell_size = side / (level as f32).exp2();
        let field = field.widened(MIN_LEVEL_SUPPORT * cell_size);
        let (has_edge_test, n_left) = (options.has_edge_test, &n_left);
        let n_steps_left = AtomicUsize::new(STEPS_PER_POINT * all.slots.len());
        let level = Level {
            field: &field,
            level,
            is_adaptive,
            is_deepest,
            has_edge_test,
            n_left,
            n_steps_left: &n_steps_left,
            progress,
        };
        let cells = level.cells::<C>(&cube, &CubePoints::new(field.all()), 0, 0);
        (cells, n_steps_left.load(Ordering::Relaxed) == 0)
    };
    let mut levels: Vec<Vec<PlacedCell<C>>> = Vec::new();
    for level in 0..=depth {
        let is_wanted = is_adaptive || level == depth;
        let n_before = n_left.load(Ordering::Relaxed);
        let (cells, is_endless) =
            if is_wanted { cells_of(level, level == depth) } else { (Vec::new(), false) };
        progress.check()?;
        progress.advance(1);
        let is_full = is_wanted && (is_endless || n_left.load(Ordering::Relaxed) == 0);
        if is_full && is_adaptive && 0 < level {
            break;
        }
        if is_full {
            return coarser(points, options, depth - 1, n_before, progress);
        }
        levels.push(cells);
    }
    if let Some(deepest) = levels.last_mut() {
        deepest.iter_mut().for_each(|cell| cell.is_finest = true);
    }
    let n_levels = levels.len();
    let (nodes, cells) = lay_out(levels);
    let cube = (!cells.is_empty()).then_some(cube);
    Ok((Octree { cube, depth: n_levels - 1, nodes, ..Octree::default() }, cells))
}

/// Builds an octree again at a depth where it may have room, if there is any for `n_cells`.
fn coarser<C: OctreeCell>(
    points: &FlatPoints,
    options: &OctreeOptions,
    depth: usize,
    n_cells: usize,
    progress: &dyn Progress,
) -> Result<(Octree, Vec<C>)> {
    if depth == 0 || n_cells == 0 {
        return Ok((Octree::default(), Vec::new()));
    }
    build(points, &OctreeOptions { depth: OctreeDepth::Levels(depth as u32), ..*options }, progress)
}

/// Puts nodes over the cells of all levels.
fn lay_out<C>(mut levels: Vec<Vec<PlacedCell<C>>>) -> (Vec<OctreeNode>, Vec<C>) {
    let mut keys: Vec<Vec<u64>> = vec![Vec::new(); levels.len()];
    for level in (0..levels.len()).rev() {
        let own = levels[level].iter().map(|cell| cell.key);
        let below = keys.get(level + 1).into_iter().flatten().map(|key| key >> 3);
        let mut all: Vec<u64> = own.chain(below).collect();
        all.sort_unstable();
        all.dedup();
        keys[level] = all;
    }
    let (mut nodes, mut cells) = (Vec::new(), Vec::new());
    let mut next_level = 0;
    for (level, keys_here) in keys.iter().enumerate() {
        next_level += keys_here.len();
        let mut below = keys.get(level + 1).map_or(&[][..], Vec::as_slice).iter().peekable();
        let mut own = levels[level].drain(..).peekable();
        let mut next_child = next_level;
        for key in keys_here {
            let mut node = OctreeNode { first_child: next_child as u32, ..OctreeNode::default() };
            while let Some(child) = below.next_if(|child| *child >> 3 == *key) {
                node.children |= 1 << (child & 7);
                next_child += 1;
            }
            if let Some(PlacedCell { is_finest, cell, .. }) = own.next_if(|cell| cell.key == *key) {
                cells.push(cell);
                (node.cell, node.is_finest) = (cells.len() as u32, is_finest);
            }
            nodes.push(node);
        }
    }
    (nodes, cells)
}
