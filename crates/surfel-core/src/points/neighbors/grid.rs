//! A sparse hashed grid with cells as wide as the neighbour distance. Only cells with points take memory.

use super::cell_grid::{CellGrid, finite_indices};
use super::neighbor::{Neighbor, checked_square, distance_squared, key, neighbor};
use super::neighbor_index::NeighborIndex;
use crate::error::Result;
use crate::math::Vec3;
use crate::math::hash;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;

/// Points sorted by the hash of their cell. Cells of equal hash share a bucket.
pub(super) struct Grid<'a> {
    positions: &'a [Vec3],
    distance_squared: f32,
    cells: CellGrid,
    /// Bucket `b` holds `points[first[b] .. first[b + 1]]`.
    first: Vec<u32>,
    points: Vec<u32>,
}

impl<'a> Grid<'a> {
    /// Sorts positions into cells as wide as a distance.
    pub fn new(positions: &'a [Vec3], distance: f32, progress: &dyn Progress) -> Result<Self> {
        let distance_squared = checked_square(distance)?;
        let mut points = finite_indices(positions)?;
        progress.check()?;
        let cells = CellGrid::new(Vec3::ZERO, distance);
        let n_buckets = points.len().next_power_of_two();
        let bucket_of =
            |point: u32| bucket(cells.cell(positions[point as usize]), n_buckets) as u64;
        let mut keys: Vec<u64> =
            points.par_iter().map(|&point| bucket_of(point) << 32 | u64::from(point)).collect();
        keys.par_sort_unstable();
        progress.check()?;
        let mut first = vec![0u32; n_buckets + 1];
        for (slot, &key) in keys.iter().enumerate() {
            points[slot] = key as u32;
            first[(key >> 32) as usize + 1] += 1;
        }
        for bucket in 0..n_buckets {
            first[bucket + 1] += first[bucket];
        }
        Ok(Self { positions, distance_squared, cells, first, points })
    }

    /// Lists the buckets of a cell and its 26 neighbours, each once.
    fn buckets_around(&self, cell: [i64; 3], buckets: &mut Vec<usize>) {
        buckets.clear();
        for corner in 0..27 {
            let step = [corner % 3 - 1, corner / 3 % 3 - 1, corner / 9 - 1];
            let near = std::array::from_fn(|axis| cell[axis].saturating_add(step[axis]));
            buckets.push(bucket(near, self.first.len() - 1));
        }
        buckets.sort_unstable();
        buckets.dedup();
    }
}

impl NeighborIndex for Grid<'_> {
    fn n_slots(&self) -> usize {
        self.points.len()
    }

    fn chunk_size(&self) -> usize {
        1024
    }

    fn visit_slots(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let (mut buckets, mut keys, mut neighbors) = (Vec::new(), Vec::new(), Vec::new());
        let mut cell_of_buckets = None;
        for &point in &self.points[slots] {
            progress.check()?;
            let position = self.positions[point as usize];
            let cell = self.cells.cell(position);
            if cell_of_buckets != Some(cell) {
                self.buckets_around(cell, &mut buckets);
                cell_of_buckets = Some(cell);
            }
            keys.clear();
            for &bucket in &buckets {
                let range = self.first[bucket] as usize..self.first[bucket + 1] as usize;
                for &other in &self.points[range] {
                    let squared = distance_squared(self.positions[other as usize], position);
                    if squared <= self.distance_squared && other != point {
                        keys.push(key(squared, other));
                    }
                }
            }
            keys.sort_unstable();
            neighbors.clear();
            neighbors.extend(keys.iter().map(|&key| neighbor(key)));
            visit(point, &neighbors);
        }
        Ok(())
    }
}

fn bucket(cell: [i64; 3], n_buckets: usize) -> usize {
    let mixed = cell.iter().fold(0, |mixed, &index| hash(mixed ^ index as u64));
    mixed as usize & (n_buckets - 1)
}
