//! Neighbourhoods of all points of a cloud: one question, three ways to the same answer.

mod brute_force;
mod found;
mod grid;
mod knn;
mod leafwise;
mod scan_line;
mod surroundings;

use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;
use std::str::FromStr;

pub use brute_force::nearest_by_brute_force;
pub use knn::Tree;

/// How neighbours are found; the answer does not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Sparse hashed cells as wide as the distance asked for.
    Grid,
    /// A sweep along the longest axis over a two-dimensional array of cells (Wiesmeier 2011).
    ScanLine,
    /// A balanced tree; the only one that also finds the nearest k.
    #[default]
    Knn,
}

/// Which points are the neighbours of a point. It is never its own neighbour; its duplicates are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Query {
    /// The k nearest; of equally distant ones those of lower index. All others, if there are fewer.
    Nearest(usize),
    /// All at most this far away.
    Within(f32),
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Neighbor {
    pub index: u32,
    pub distance_squared: f32,
}

/// `visit(point, neighbours)` of every point, in the points' order; neighbours come nearest first.
///
/// A position that is not finite has no neighbours and is nobody's neighbour.
pub fn map_neighborhoods<T: Copy + Default + Send + Sync>(
    positions: &[Vec3],
    method: Method,
    query: Query,
    progress: &dyn Progress,
    visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
) -> Result<Vec<T>> {
    match (method, query) {
        (Method::Knn, _) => Tree::new(positions, progress)?.map(query, progress, visit),
        (_, Query::Nearest(_)) => Err(Error::Setting {
            name: "neighbors",
            found: method.to_string(),
            expected: "knn when the nearest k are asked for",
        }),
        (Method::Grid, Query::Within(distance)) => {
            let grid = grid::Grid::new(positions, distance, progress)?;
            map(&grid, positions, progress, visit)
        }
        (Method::ScanLine, Query::Within(distance)) => {
            match scan_line::ScanLine::new(positions, distance, progress)? {
                Some(sweep) => map(&sweep, positions, progress, visit),
                None => map_neighborhoods(positions, Method::Grid, query, progress, visit),
            }
        }
    }
}

/// A search structure that answers one query for all its points, in an order that suits it.
trait Index: Sync {
    /// Points in the structure, in its own order called slots.
    fn n_slots(&self) -> usize;

    /// Slots that one task should take together.
    fn run_length(&self) -> usize;

    /// Calls `visit` with the index and the sorted neighbours of each point in `slots`.
    fn visit_run(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()>;
}

fn map<T: Copy + Default + Send + Sync>(
    index: &impl Index,
    positions: &[Vec3],
    progress: &dyn Progress,
    visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
) -> Result<Vec<T>> {
    let mut values = vec![T::default(); positions.len()];
    let n_slots = index.n_slots();
    progress.begin("neighbours", n_slots as u64);
    // Blocks bound the memory that answers take before they stand in the points' order.
    let block_length = index.run_length().max(1 << 18);
    for block in ranges(0..n_slots, block_length) {
        let runs: Vec<Range<usize>> = ranges(block, index.run_length()).collect();
        let answers = runs.into_par_iter().map(|slots| {
            progress.check()?;
            let mut answers = Vec::with_capacity(slots.len());
            let length = slots.len();
            index.visit_run(slots, progress, |point, neighbors| {
                answers.push((point, visit(point as usize, neighbors)));
            })?;
            progress.advance(length as u64);
            Ok(answers)
        });
        scatter(&answers.collect::<Result<Vec<_>>>()?, &mut values);
    }
    for (point, _) in positions.iter().enumerate().filter(|(_, p)| !p.is_finite()) {
        values[point] = visit(point, &[]);
    }
    Ok(values)
}

/// Every thread owns a part of `values` and takes from all answers those that fall into it.
fn scatter<T: Copy + Send + Sync>(answers: &[Vec<(u32, T)>], values: &mut [T]) {
    let part_length = values.len().div_ceil(rayon::current_num_threads()).max(1);
    values.par_chunks_mut(part_length).enumerate().for_each(|(part, values)| {
        let first = part * part_length;
        for &(point, value) in answers.iter().flatten() {
            if let Some(target) = values.get_mut((point as usize).wrapping_sub(first)) {
                *target = value;
            }
        }
    });
}

/// A cell index along one axis, computed so that points within `distance` are at most one cell apart.
struct CellSize {
    origin: Vec3,
    cells_per_unit: f64,
}

impl CellSize {
    fn new(origin: Vec3, distance: f32) -> Self {
        // Squares in f32 accept points that are a rounding error farther away than `distance`.
        Self { origin, cells_per_unit: 1.0 / (f64::from(distance) * (1.0 + 1e-6)) }
    }

    /// Saturates far out: those cells are then shared, and a search only sees more candidates.
    fn cell(&self, position: Vec3) -> [i64; 3] {
        let cells = (position.as_dvec3() - self.origin.as_dvec3()) * self.cells_per_unit;
        cells.floor().to_array().map(|cell| cell as i64)
    }
}

fn ranges(whole: Range<usize>, length: usize) -> impl Iterator<Item = Range<usize>> {
    let end = whole.end;
    whole.step_by(length).map(move |first| first..end.min(first + length))
}

/// Squared distance in the one order of operations that all methods share, so that they agree to the bit.
fn distance_squared(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x * d.x + d.y * d.y + d.z * d.z
}

/// A neighbour as one number: by distance, then by index. Squares are not negative, so their bits sort.
fn key(distance_squared: f32, index: u32) -> u64 {
    (u64::from(distance_squared.to_bits()) << 32) | u64::from(index)
}

fn neighbor(key: u64) -> Neighbor {
    Neighbor { index: key as u32, distance_squared: f32::from_bits((key >> 32) as u32) }
}

/// Indices of the finite positions; an error if 32 bits cannot number them.
fn finite_indices(positions: &[Vec3]) -> Result<Vec<u32>> {
    check_count(positions)?;
    let finite = |&i: &u32| positions[i as usize].is_finite();
    Ok((0..positions.len() as u32).into_par_iter().filter(finite).collect())
}

fn check_count(positions: &[Vec3]) -> Result<()> {
    // The largest index is the mark of an empty place.
    let limit = u32::MAX as usize;
    if limit <= positions.len() {
        return Err(Error::TooManyPoints { found: positions.len(), limit: limit - 1 });
    }
    Ok(())
}

/// The square of a distance, which must be a normal number: then rounding is of no account.
fn checked_square(distance: f32) -> Result<f32> {
    let square = distance * distance;
    if 0.0 < distance && square.is_normal() {
        return Ok(square);
    }
    let expected = "a positive number between 1e-18 and 1e19";
    Err(Error::Setting { name: "neighbour distance", found: distance.to_string(), expected })
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Grid => "grid",
            Self::ScanLine => "scan-line",
            Self::Knn => "knn",
        })
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "grid" => Ok(Self::Grid),
            "scan-line" => Ok(Self::ScanLine),
            "knn" => Ok(Self::Knn),
            _ => Err(Error::Setting {
                name: "neighbors",
                found: text.to_owned(),
                expected: "grid, scan-line or knn",
            }),
        }
    }
}

#[cfg(test)]
mod tests;
