//! Draws among weighted cells: a row of them, or a grid.

use rayon::prelude::*;

/// What the probabilities of a row of cells sum to, in whole parts: rounding leaves no cell that has
/// weight without a part, and the probability told is exactly that of the draw.
const PARTS: u32 = u32::MAX;

/// Cells in a row, drawn in proportion to their weights.
///
/// With a density that is constant in each cell, this and [`Distribution2d`] are the distributions of
/// Pharr, Jakob and Humphreys 2016 (Physically Based Rendering, 13.3.1 and 13.6.7).
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution1d {
    /// The first part of each cell: not empty, ascending from 0. A cell ends where the next begins.
    starts: Vec<u32>,
}

/// Cells in a grid, drawn in proportion to their weights: first the row, then the cell in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution2d {
    rows: Distribution1d,
    width: usize,
    /// Those of `Distribution1d` for each row of `width` cells, one row after the other.
    starts: Vec<u32>,
}

impl Distribution1d {
    /// None without cells. Weights that are negative or not finite count as 0; if all do, each cell
    /// is as likely as any other.
    #[cfg(test)]
    pub fn new(weights: &[f32]) -> Option<Self> {
        let weights: Vec<f64> = weights.iter().map(|weight| f64::from(*weight)).collect();
        Self::of_weights(&weights)
    }

    fn of_weights(weights: &[f64]) -> Option<Self> {
        let n_cells = u32::try_from(weights.len()).ok().filter(|n| 0 < *n)?;
        let mut starts = vec![0; n_cells as usize];
        share_out(&mut starts, weights);
        Some(Self { starts })
    }

    /// The cell that `u`, uniform in [0, 1), draws, and a uniform place in it, again in [0, 1).
    pub fn sample(&self, u: f32) -> (usize, f32) {
        draw(&self.starts, u)
    }

    /// That `cell` is drawn. Over the unit interval, the density in it is this times the number of cells.
    pub fn probability(&self, cell: usize) -> f32 {
        probability(&self.starts, cell)
    }
}

impl Distribution2d {
    /// Of `width` x `height` cells with `weight(x, y)`; None without cells, or with more than fit in
    /// memory's addresses. Weights that are negative or not finite count as 0; where all of a row do, or
    /// all rows, each is as likely as any other.
    pub fn new(
        width: u32,
        height: u32,
        weight: impl Fn(usize, usize) -> f32 + Sync,
    ) -> Option<Self> {
        let width = usize::try_from(width).ok().filter(|width| 0 < *width)?;
        let mut starts = vec![0; width.checked_mul(usize::try_from(height).ok()?)?];
        let share_out_row = |(y, starts): (usize, &mut [u32])| {
            let weights: Vec<f64> = (0..width).map(|x| f64::from(weight(x, y))).collect();
            share_out(starts, &weights)
        };
        let rows: Vec<f64> =
            starts.par_chunks_exact_mut(width).enumerate().map(share_out_row).collect();
        Some(Self { rows: Distribution1d::of_weights(&rows)?, width, starts })
    }

    /// Column and row of the cell that `uv`, uniform in the unit square, draws, and a uniform place in it.
    pub fn sample(&self, (u, v): (f32, f32)) -> ((usize, usize), (f32, f32)) {
        let (y, place_y) = self.rows.sample(v);
        let (x, place_x) = draw(self.row(y), u);
        ((x, y), (place_x, place_y))
    }

    /// That the cell is drawn. Over the unit square, the density in it is this times the number of cells.
    pub fn probability(&self, (x, y): (usize, usize)) -> f32 {
        self.rows.probability(y) * probability(self.row(y), x)
    }

    fn row(&self, y: usize) -> &[u32] {
        &self.starts[y * self.width..][..self.width]
    }
}

/// Gives every cell with weight one part and shares out the others; returns the sum of the weights.
fn share_out(starts: &mut [u32], weights: &[f64]) -> f64 {
    let valid = |weight: &f64| if 0.0 < *weight && weight.is_finite() { *weight } else { 0.0 };
    let sum: f64 = weights.iter().map(valid).sum();
    let is_empty = sum == 0.0;
    let valid = |weight: &f64| if is_empty { 1.0 } else { valid(weight) };
    let sum_shared = if is_empty { weights.len() as f64 } else { sum };
    let n_drawn = weights.iter().filter(|weight| 0.0 < valid(weight)).count() as u32;
    let shared = f64::from(PARTS - n_drawn);
    let (mut sum_before, mut n_before) = (0.0, 0);
    for (start, weight) in starts.iter_mut().zip(weights) {
        // The sums are made in the same order, so that the quotient ends at 1 and never passes it.
        *start = n_before + (sum_before / sum_shared * shared) as u32;
        let weight = valid(weight);
        sum_before += weight;
        n_before += u32::from(0.0 < weight);
    }
    sum
}

fn draw(starts: &[u32], u: f32) -> (usize, f32) {
    let part = (f64::from(u) * f64::from(PARTS)).clamp(0.0, f64::from(PARTS - 1));
    // The last of those that begin here: cells without parts begin where the next does.
    let cell = starts.partition_point(|start| f64::from(*start) <= part).saturating_sub(1);
    let (start, end) = bounds(starts, cell);
    let place = (part - f64::from(start)) / f64::from(end - start);
    (cell, (place as f32).min(1f32.next_down()))
}

fn probability(starts: &[u32], cell: usize) -> f32 {
    let (start, end) = bounds(starts, cell);
    (f64::from(end - start) / f64::from(PARTS)) as f32
}

fn bounds(starts: &[u32], cell: usize) -> (u32, u32) {
    (starts[cell], starts.get(cell + 1).copied().unwrap_or(PARTS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{hash, scrambled_pair};

    #[test]
    fn probabilities_are_the_shares_of_the_weights() {
        let row =
            Distribution1d::new(&[1.0, 0.0, 3.0, f32::NAN, 4.0, -1.0, f32::INFINITY]).unwrap();
        let probabilities = [0.125, 0.0, 0.375, 0.0, 0.5, 0.0, 0.0];
        for (cell, expected) in probabilities.into_iter().enumerate() {
            assert!((row.probability(cell) - expected).abs() < 1e-7, "{cell}");
            assert_eq!(row.probability(cell) == 0.0, expected == 0.0);
        }
        assert_eq!(row.sample(0.0), (0, 0.0));
        assert_eq!(row.sample(1f32.next_down()).0, 4);
        let (cell, place) = row.sample(0.3125);
        assert!(cell == 2 && (place - 0.5).abs() < 1e-6);
    }

    #[test]
    fn the_least_weight_can_be_drawn() {
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
    fn without_weights_all_are_alike_and_without_cells_there_is_nothing() {
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
    fn cells_are_drawn_as_often_as_told_and_evenly_inside() {
        let (width, height) = (7, 5);
        let weight = |x: usize, y: usize| {
            if (x + y).is_multiple_of(3) { 0.0 } else { (hash((x * 10 + y) as u64) % 97) as f32 }
        };
        let grid = Distribution2d::new(width, height, weight).unwrap();
        let (n, mut counts, mut places) = (1 << 16, vec![0u32; 35], (0.0, 0.0));
        for i in 0..n {
            let ((x, y), place) = grid.sample(scrambled_pair(i, 3));
            assert!((0.0..1.0).contains(&place.0) && (0.0..1.0).contains(&place.1));
            counts[y * 7 + x] += 1;
            places = (places.0 + f64::from(place.0), places.1 + f64::from(place.1));
        }
        let n = f64::from(n);
        for (cell, count) in counts.into_iter().enumerate() {
            let cell = (cell % 7, cell / 7);
            let expected = n * f64::from(grid.probability(cell));
            // Four standard deviations of independent draws; these are spread better.
            assert!((f64::from(count) - expected).abs() <= 4.0 * expected.sqrt(), "{cell:?}");
            assert_eq!(weight(cell.0, cell.1) == 0.0, count == 0, "{cell:?}");
        }
        assert!((places.0 / n - 0.5).abs() < 0.005 && (places.1 / n - 0.5).abs() < 0.005);
    }
}
