//! The cells of one level of an octree, computed from the field.

use super::cube_points::{CubePoints, child_cube};
use super::octree::{CellCorners, CellPlane};
use super::points::{CellPoints, FieldPoints, FieldValue};
use crate::math::Aabb;
use crate::progress::Progress;
use crate::surface::FIELD_SUPPORT;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Size of the finest cells, in radii of the points: about one spacing.
pub(super) const FINEST_CELL: f32 = 0.5;
/// Maximum distance of a plane from the middle of its cell, in those of the corners. Planes on the face between two cells
/// belong to both: rounding decided otherwise, and left holes.
const MAX_PLANE_HEIGHT: f32 = 1.1;
/// Number of positions of a cell at which the field is evaluated: the corners and the middle.
const N_SAMPLES: usize = 9;
/// Minimum number of points of a cell whose children are computed in parallel.
const MIN_PARALLEL: usize = 4096;

/// A cell that holds the surface.
pub(super) trait OctreeCell: Sized + Send {
    /// Returns the cell, or none if the surface does not pass through it. `middle` is the field in its middle.
    fn new(
        field: &FieldPoints,
        points: &CellPoints,
        flips: &[bool],
        cell: &Aabb,
        middle: &FieldValue,
    ) -> Option<Self>;
}

/// A cell with its place.
pub(super) struct PlacedCell<C> {
    /// The numbers of the children on the way from the root, three bits each.
    pub key: u64,
    pub is_finest: bool,
    pub cell: C,
}

/// The search for the cells of one level.
pub(super) struct Level<'a> {
    pub field: &'a FieldPoints,
    pub level: usize,
    /// True if cells end where they are as fine as their points.
    pub is_adaptive: bool,
    /// True if the level is the deepest one.
    pub is_deepest: bool,
    pub has_edge_test: bool,
    /// Number of cells that may still be added.
    pub n_left: &'a AtomicUsize,
    /// Number of points that the search may still look at, in all of the cells that it visits.
    pub n_steps_left: &'a AtomicUsize,
    pub progress: &'a dyn Progress,
}

impl Level<'_> {
    /// Returns the cells of the level below a cube at a depth, by rising key. They are incomplete once no cell may be
    /// added any more.
    pub fn cells<C: OctreeCell>(
        &self,
        cube: &Aabb,
        inside: &CubePoints,
        key: u64,
        depth: usize,
    ) -> Vec<PlacedCell<C>> {
        let points = &inside.points;
        let is_stopped =
            self.progress.is_cancelled() || !take(self.n_steps_left, points.slots.len());
        if points.is_empty() || is_stopped || !inside.may_have_zero() {
            return Vec::new();
        }
        let radius = points.mean_support() / FIELD_SUPPORT;
        let is_fine = self.is_adaptive && cube.size().x <= FINEST_CELL * radius;
        if depth == self.level {
            let is_finest = is_fine || self.is_deepest;
            let cell = self.cell(cube, points);
            return cell.map(|cell| PlacedCell { key, is_finest, cell }).into_iter().collect();
        }
        // A coarser level has the finest cells here.
        if is_fine || self.n_left.load(Ordering::Relaxed) == 0 {
            return Vec::new();
        }
        let parts = self.field.split(points, cube);
        let child = |(i, part): (usize, &CubePoints)| {
            self.cells(&child_cube(cube, i), part, key << 3 | i as u64, depth + 1)
        };
        if points.slots.len() < MIN_PARALLEL {
            return parts.iter().enumerate().flat_map(child).collect();
        }
        let children: Vec<_> = parts.par_iter().enumerate().map(child).collect();
        children.into_iter().flatten().collect()
    }

    fn cell<C: OctreeCell>(&self, cube: &Aabb, points: &CellPoints) -> Option<C> {
        if !take(self.n_steps_left, N_SAMPLES * points.slots.len()) {
            return None;
        }
        let flips = self.field.flips(points, cube);
        let middle = self.field.value(points, &flips, cube.center())?;
        let cell = C::new(self.field, points, &flips, cube, &middle)?;
        let on_surface = cube.center() - middle.value * middle.normal;
        let is_inside =
            !self.has_edge_test || self.field.enclose(points, on_surface, middle.normal);
        (is_inside && take(self.n_left, 1)).then_some(cell)
    }
}

/// Subtracts from what is left, and sets it to zero if it is less. Returns true if it sufficed.
fn take(left: &AtomicUsize, n: usize) -> bool {
    let subtract = |left: usize| Some(left.saturating_sub(n));
    let before = left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, subtract);
    before.is_ok_and(|before| n < before)
}

impl OctreeCell for CellPlane {
    fn new(
        _: &FieldPoints,
        _: &CellPoints,
        _: &[bool],
        cell: &Aabb,
        middle: &FieldValue,
    ) -> Option<Self> {
        let FieldValue { value, normal, slot } = *middle;
        let extent = normal.abs().dot(0.5 * cell.size());
        (value.abs() <= MAX_PLANE_HEIGHT * extent).then_some(Self { normal, height: value, slot })
    }
}

impl OctreeCell for CellCorners {
    fn new(
        field: &FieldPoints,
        points: &CellPoints,
        flips: &[bool],
        cell: &Aabb,
        middle: &FieldValue,
    ) -> Option<Self> {
        let per_step = 1.0 / (Self::STEP * cell.size().x);
        let mut corners = Self { values: [0; 8], normals: [[0; 3]; 8], slot: middle.slot };
        for (i, (value, normal)) in
            field.corner_values(points, flips, cell)?.into_iter().enumerate()
        {
            corners.values[i] = (value * per_step).clamp(-32767.0, 32767.0).round() as i16;
            corners.normals[i] = normal.to_array().map(|axis| (127.0 * axis).round() as i8);
        }
        let has_both_signs = corners.values.iter().any(|value| *value <= 0)
            && corners.values.iter().any(|value| 0 <= *value);
        has_both_signs.then_some(corners)
    }
}
