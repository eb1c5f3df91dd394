//! Cells as wide as the neighbour distance.

use crate::error::Result;
use crate::math::Vec3;
use crate::points::check_count;
use rayon::prelude::*;

/// A grid of cells so wide that points within a distance lie at most one cell apart along each axis.
pub(super) struct CellGrid {
    origin: Vec3,
    cells_per_unit: f64,
}

impl CellGrid {
    /// Creates a grid of cells as wide as a distance.
    pub fn new(origin: Vec3, distance: f32) -> Self {
        // Squared distances in f32 accept points that are farther away than `distance` by a rounding error.
        Self { origin, cells_per_unit: 1.0 / (f64::from(distance) * (1.0 + 1e-6)) }
    }

    /// Returns the index of the cell of a position. Indices saturate far out, where points then share cells, which
    /// only gives a search more candidates.
    pub fn cell(&self, position: Vec3) -> [i64; 3] {
        let cells = (position.as_dvec3() - self.origin.as_dvec3()) * self.cells_per_unit;
        cells.floor().to_array().map(|cell| cell as i64)
    }
}

/// Returns the indices of the finite positions. Fails if 32-bit indices do not suffice.
pub(super) fn finite_indices(positions: &[Vec3]) -> Result<Vec<u32>> {
    check_count(positions.len())?;
    let is_finite = |&i: &u32| positions[i as usize].is_finite();
    Ok((0..positions.len() as u32).into_par_iter().filter(is_finite).collect())
}
