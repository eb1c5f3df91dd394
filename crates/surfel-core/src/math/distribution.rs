//! Piecewise-constant distributions over a row or a grid of weighted cells.

use rayon::prelude::*;

/// The end of every cumulative distribution, whose steps are integers: rounding leaves no cell that has
/// weight without a probability, and the reported probability is exactly that of the sampling.
const CDF_END: u32 = u32::MAX;

/// Cells in a row, sampled in proportion to their weights.
///
/// The density is constant in each cell: this type and [`Distribution2d`] are the piecewise-constant
/// distributions of Pharr, Jakob and Humphreys 2016 (Physically Based Rendering, 13.3.1 and 13.6.7).
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution1d {
    /// Start of each cell in the cumulative distribution: not empty, ascending from 0. A cell ends where the
    /// next one begins.
    cdf: Vec<u32>,
}

/// Cells in a grid, sampled in proportion to their weights: first the row, then the cell in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution2d {
    rows: Distribution1d,
    width: usize,
    /// The `cdf` of each row of `width` cells, one row after the other.
    cdf: Vec<u32>,
}

impl Distribution1d {
    /// Builds a distribution, or returns `None` without cells. Weights that are negative or not finite count
    /// as 0; if all do, the cells are equally likely.
    #[cfg(test)]
    pub fn new(weights: &[f32]) -> Option<Self> {
        let weights: Vec<f64> = weights.iter().map(|weight| f64::from(*weight)).collect();
        Self::from_weights(&weights)
    }

    fn from_weights(weights: &[f64]) -> Option<Self> {
        let n_cells = u32::try_from(weights.len()).ok().filter(|n| 0 < *n)?;
        let mut cdf = vec![0; n_cells as usize];
        assign_cells(&mut cdf, weights);
        Some(Self { cdf })
    }

    /// Maps `u`, uniform in [0, 1), to a cell and a uniform offset in it, again in [0, 1).
    pub fn sample(&self, u: f32) -> (usize, f32) {
        sample_cell(&self.cdf, u)
    }

    /// Returns the probability of `cell`. Its density over the unit interval is this times the number of
    /// cells.
    pub fn probability(&self, cell: usize) -> f32 {
        probability(&self.cdf, cell)
    }
}

impl Distribution2d {
    /// Builds a distribution over `width` x `height` cells of `weight(x, y)`, or returns `None` without cells
    /// or with more than memory can address. Weights that are negative or not finite count as 0; where all of
    /// a row do, or all rows, the cells are equally likely.
    pub fn new(
        width: u32,
        height: u32,
        weight: impl Fn(usize, usize) -> f32 + Sync,
    ) -> Option<Self> {
        let width = usize::try_from(width).ok().filter(|width| 0 < *width)?;
        let mut cdf = vec![0; width.checked_mul(usize::try_from(height).ok()?)?];
        let assign_row = |(y, cdf): (usize, &mut [u32])| {
            let weights: Vec<f64> = (0..width).map(|x| f64::from(weight(x, y))).collect();
            assign_cells(cdf, &weights)
        };
        let rows: Vec<f64> = cdf.par_chunks_exact_mut(width).enumerate().map(assign_row).collect();
        Some(Self { rows: Distribution1d::from_weights(&rows)?, width, cdf })
    }

    /// Returns the starts of the rows in the distribution over all rows, and of the cells in that of each row. A cell ends
    /// where the next one begins, the last one at the largest u32.
    pub fn arrays(&self) -> (&[u32], &[u32]) {
        (&self.rows.cdf, &self.cdf)
    }

    /// Maps a uniform point of the unit square to the column and the row of a cell and a uniform offset in
    /// it.
    pub fn sample(&self, (u, v): (f32, f32)) -> ((usize, usize), (f32, f32)) {
        let (y, offset_y) = self.rows.sample(v);
        let (x, offset_x) = sample_cell(self.row(y), u);
        ((x, y), (offset_x, offset_y))
    }

    /// Returns the probability of a cell. Its density over the unit square is this times the number of cells.
    pub fn probability(&self, (x, y): (usize, usize)) -> f32 {
        self.rows.probability(y) * probability(self.row(y), x)
    }

    fn row(&self, y: usize) -> &[u32] {
        &self.cdf[y * self.width..][..self.width]
    }
}

/// Gives every cell with weight one step of the `cdf` and distributes the others by weight; returns the sum
/// of the weights.
fn assign_cells(cdf: &mut [u32], weights: &[f64]) -> f64 {
    let valid = |weight: &f64| if 0.0 < *weight && weight.is_finite() { *weight } else { 0.0 };
    let sum: f64 = weights.iter().map(valid).sum();
    let is_empty = sum == 0.0;
    let valid = |weight: &f64| if is_empty { 1.0 } else { valid(weight) };
    let sum_shared = if is_empty { weights.len() as f64 } else { sum };
    let n_weighted = weights.iter().filter(|weight| 0.0 < valid(weight)).count() as u32;
    let shared = f64::from(CDF_END - n_weighted);
    let (mut sum_before, mut n_before) = (0.0, 0);
    for (start, weight) in cdf.iter_mut().zip(weights) {
        // Both sums add in the same order, so that the quotient ends at 1 and never exceeds it.
        *start = n_before + (sum_before / sum_shared * shared) as u32;
        let weight = valid(weight);
        sum_before += weight;
        n_before += u32::from(0.0 < weight);
    }
    sum
}

fn sample_cell(cdf: &[u32], u: f32) -> (usize, f32) {
    let step = (f64::from(u) * f64::from(CDF_END)).clamp(0.0, f64::from(CDF_END - 1));
    // Several cells may begin here: those without weight begin where the next one does. The last one is
    // meant.
    let cell = cdf.partition_point(|start| f64::from(*start) <= step).saturating_sub(1);
    let (start, end) = bounds(cdf, cell);
    let offset = (step - f64::from(start)) / f64::from(end - start);
    (cell, (offset as f32).min(1f32.next_down()))
}

fn probability(cdf: &[u32], cell: usize) -> f32 {
    let (start, end) = bounds(cdf, cell);
    (f64::from(end - start) / f64::from(CDF_END)) as f32
}

fn bounds(cdf: &[u32], cell: usize) -> (u32, u32) {
    (cdf[cell], cdf.get(cell + 1).copied().unwrap_or(CDF_END))
}

#[cfg(test)]
mod tests {
    //! Cells are sampled in proportion to their weights.

    use super::*;
    use crate::math::{hash, owen_sobol_2d};

    #[test]
    fn probabilities_are_proportional_to_weights() {
        let row =
            Distribution1d::new(&[1.0, 0.0, 3.0, f32::NAN, 4.0, -1.0, f32::INFINITY]).unwrap();
        let probabilities = [0.125, 0.0, 0.375, 0.0, 0.5, 0.0, 0.0];
        for (cell, expected) in probabilities.into_iter().enumerate() {
            assert!((row.probability(cell) - expected).abs() < 1e-7, "{cell}");
            assert_eq!(row.probability(cell) == 0.0, expected == 0.0);
        }
        assert_eq!(row.sample(0.0), (0, 0.0));
        assert_eq!(row.sample(1f32.next_down()).0, 4);
        let (cell, offset) = row.sample(0.3125);
        assert!(cell == 2 && (offset - 0.5).abs() < 1e-6);
    }

    #[test]
    fn tiny_weights_can_be_sampled() {
        let mut weights = vec![1e-30; 1000];
        weights[500] = 1e30;
        let row = Distribution1d::new(&weights).unwrap();
        assert!((0..1000).all(|cell| 0.0 < row.probability(cell)));
        assert_eq!(row.sample(0.0).0, 0);
        assert_eq!(row.sample(0.5).0, 500);
        let sum: f64 = (0..1000).map(|cell| f64::from(row.probability(cell))).sum();
        assert!((sum - 1.0).abs() < 1e-7, "{sum}");
    }

    #[test]
    fn zero_weights_are_equally_likely_and_zero_cells_give_none() {
        let row = Distribution1d::new(&[0.0; 4]).unwrap();
        assert!((0..4).all(|cell| (row.probability(cell) - 0.25).abs() < 1e-7));
        assert_eq!(row.sample(0.9).0, 3);
        let grid = Distribution2d::new(3, 2, |_, _| 0.0).unwrap();
        assert!((grid.probability((2, 1)) - 1.0 / 6.0).abs() < 1e-7);
        assert_eq!(Distribution1d::new(&[]), None);
        assert_eq!(Distribution2d::new(0, 5, |_, _| 1.0), None);
        assert_eq!(Distribution2d::new(5, 0, |_, _| 1.0), None);
    }

    #[test]
    fn cells_are_sampled_by_probability_and_evenly_inside() {
        let (width, height) = (7, 5);
        let weight = |x: usize, y: usize| {
            if (x + y).is_multiple_of(3) { 0.0 } else { (hash((x * 10 + y) as u64) % 97) as f32 }
        };
        let grid = Distribution2d::new(width, height, weight).unwrap();
        let (n, mut counts, mut offset_sums) = (1 << 16, vec![0u32; 35], (0.0, 0.0));
        for i in 0..n {
            let ((x, y), offset) = grid.sample(owen_sobol_2d(i, 3));
            assert!((0.0..1.0).contains(&offset.0) && (0.0..1.0).contains(&offset.1));
            counts[y * 7 + x] += 1;
            offset_sums =
                (offset_sums.0 + f64::from(offset.0), offset_sums.1 + f64::from(offset.1));
        }
        let n = f64::from(n);
        for (cell, count) in counts.into_iter().enumerate() {
            let cell = (cell % 7, cell / 7);
            let expected = n * f64::from(grid.probability(cell));
            // Four standard deviations of independent samples; these are spread better.
            assert!((f64::from(count) - expected).abs() <= 4.0 * expected.sqrt(), "{cell:?}");
            assert_eq!(weight(cell.0, cell.1) == 0.0, count == 0, "{cell:?}");
        }
        assert!((offset_sums.0 / n - 0.5).abs() < 0.005 && (offset_sums.1 / n - 0.5).abs() < 0.005);
    }
}
