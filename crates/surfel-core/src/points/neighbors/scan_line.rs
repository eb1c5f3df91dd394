//! A sweep along the longest axis over a two-dimensional array of cells (Wiesmeier 2011, section on preprocessing).

use super::cell_grid::{CellGrid, finite_indices};
use super::neighbor::{Neighbor, checked_square, distance_squared, key, neighbor};
use super::neighbor_index::NeighborIndex;
use crate::error::Result;
use crate::math::Aabb;
use crate::math::Vec3;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;

/// Maximum number of cells per point. Beyond it the array is too large, which outliers and short distances cause.
const MAX_CELLS_PER_POINT: usize = 2;

/// Marks the absence of a slot.
const NONE: u32 = u32::MAX;

/// Points in the order of the sweep, and the array that spans the two shorter sides of their bounds.
pub(super) struct ScanLine<'a> {
    positions: &'a [Vec3],
    distance_squared: f32,
    sweep_axis: usize,
    points: Vec<u32>,
    cells: CellGrid,
    n_cells: [usize; 2],
}

impl<'a> ScanLine<'a> {
    /// Sorts the points for the sweep. Returns none, with a note, if an outlier or a short distance would make the
    /// array larger than the cloud.
    pub fn new(
        positions: &'a [Vec3],
        distance: f32,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let distance_squared = checked_square(distance)?;
        let mut points = finite_indices(positions)?;
        if points.is_empty() {
            let cells = CellGrid::new(Vec3::ZERO, distance);
            let empty =
                Self { positions, distance_squared, sweep_axis: 0, points, cells, n_cells: [0; 2] };
            return Ok(Some(empty));
        }
        let bounds = Aabb::of_points(points.iter().map(|&point| positions[point as usize]));
        let sweep_axis = bounds.longest_axis();
        let cells = CellGrid::new(bounds.min, distance);
        let last_cell = cells.cell(bounds.max);
        let n_cells = across(sweep_axis).map(|axis| (last_cell[axis] as usize).saturating_add(1));
        let n_all_cells = n_cells[0].saturating_mul(n_cells[1]);
        if MAX_CELLS_PER_POINT * points.len() + 1024 < n_all_cells {
            progress.note(&format!(
                "the scan-line array would need {n_all_cells} cells for {} points: grid used instead",
                points.len()
            ));
            return Ok(None);
        }
        progress.check()?;
        let along = |point: u32| positions[point as usize][sweep_axis];
        points.par_sort_unstable_by(|&a, &b| along(a).total_cmp(&along(b)).then(a.cmp(&b)));
        Ok(Some(Self { positions, distance_squared, sweep_axis, points, cells, n_cells }))
    }

    /// Returns the coordinate along the sweep of a slot's point.
    fn along(&self, slot: usize) -> f32 {
        self.positions[self.points[slot] as usize][self.sweep_axis]
    }

    /// Returns true if two slots are too far apart along the sweep alone, by the same rounded operations as the
    /// distance itself.
    fn are_apart(&self, earlier: usize, later: usize) -> bool {
        let gap = self.along(later) - self.along(earlier);
        self.distance_squared < gap * gap
    }

    fn cell(&self, slot: usize) -> [usize; 2] {
        let cell = self.cells.cell(self.positions[self.points[slot] as usize]);
        across(self.sweep_axis).map(|axis| cell[axis] as usize)
    }
}

/// The points near the position of the sweep: one queue per cell, linked through one array.
struct Window<'a> {
    sweep: &'a ScanLine<'a>,
    /// Slots in the window; `next[slot - base]` follows `slot` in its queue.
    inside: Range<usize>,
    base: usize,
    next: Vec<u32>,
    /// First and last slot of each queue, less `base`.
    queues: Vec<[u32; 2]>,
}

impl<'a> Window<'a> {
    fn new(sweep: &'a ScanLine<'a>, slots: &Range<usize>) -> Self {
        let base = (0..slots.start).rev().find(|&slot| sweep.are_apart(slot, slots.start));
        let base = base.map_or(0, |slot| slot + 1);
        let queues = vec![[NONE; 2]; sweep.n_cells[0] * sweep.n_cells[1]];
        Self { sweep, inside: base..base, base, next: Vec::new(), queues }
    }

    /// Moves the window to the points near `slot`.
    fn advance_to(&mut self, slot: usize) {
        let n_slots = self.sweep.points.len();
        while self.inside.end < n_slots
            && (self.inside.end <= slot || !self.sweep.are_apart(slot, self.inside.end))
        {
            self.push_last();
        }
        while self.sweep.are_apart(self.inside.start, slot) {
            self.pop_first();
        }
    }

    fn queue_of(&mut self, slot: usize) -> &mut [u32; 2] {
        let [a, b] = self.sweep.cell(slot);
        &mut self.queues[a * self.sweep.n_cells[1] + b]
    }

    fn push_last(&mut self) {
        let slot = self.inside.end;
        let entry = (slot - self.base) as u32;
        let [first, last] = *self.queue_of(slot);
        *self.queue_of(slot) = [if first == NONE { entry } else { first }, entry];
        self.next.push(NONE);
        if last != NONE {
            self.next[last as usize] = entry;
        }
        self.inside.end += 1;
    }

    /// Removes the first point of the window, which is also the first of its queue.
    fn pop_first(&mut self) {
        let slot = self.inside.start;
        let after = self.next[slot - self.base];
        let queue = self.queue_of(slot);
        *queue = if after == NONE { [NONE; 2] } else { [after, queue[1]] };
        self.inside.start += 1;
    }

    /// Collects the keys of the neighbours of `slot`.
    fn gather(&self, slot: usize, keys: &mut Vec<u64>) {
        let sweep = self.sweep;
        let point = sweep.points[slot];
        let position = sweep.positions[point as usize];
        let [a, b] = sweep.cell(slot);
        for row in a.saturating_sub(1)..sweep.n_cells[0].min(a + 2) {
            for column in b.saturating_sub(1)..sweep.n_cells[1].min(b + 2) {
                let mut entry = self.queues[row * sweep.n_cells[1] + column][0];
                while entry != NONE {
                    let other = sweep.points[self.base + entry as usize];
                    let squared = distance_squared(sweep.positions[other as usize], position);
                    if squared <= sweep.distance_squared && other != point {
                        keys.push(key(squared, other));
                    }
                    entry = self.next[entry as usize];
                }
            }
        }
    }
}

impl NeighborIndex for ScanLine<'_> {
    fn n_slots(&self) -> usize {
        self.points.len()
    }

    /// Returns a large size, as each chunk sets up an array of its own.
    fn chunk_size(&self) -> usize {
        (self.points.len() / 64).max(4096)
    }

    fn visit_slots(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let mut window = Window::new(self, &slots);
        let (mut keys, mut neighbors) = (Vec::new(), Vec::new());
        for slot in slots {
            progress.check()?;
            window.advance_to(slot);
            keys.clear();
            window.gather(slot, &mut keys);
            keys.sort_unstable();
            neighbors.clear();
            neighbors.extend(keys.iter().map(|&key| neighbor(key)));
            visit(self.points[slot], &neighbors);
        }
        Ok(())
    }
}

/// Returns the two axes perpendicular to the sweep.
fn across(sweep_axis: usize) -> [usize; 2] {
    [(sweep_axis + 1) % 3, (sweep_axis + 2) % 3]
}
