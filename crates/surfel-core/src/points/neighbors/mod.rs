//! Neighbourhoods of all points of a cloud, by three methods that give the same result, and the connected components of points
//! that are linked.

mod all_knn;
mod brute_force;
mod candidate_set;
mod cell_grid;
mod grid;
mod kd_tree;
mod nearby_leaves;
mod neighbor;
mod neighbor_index;
mod scan_line;
mod signed_union_find;

use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::progress::Progress;
use neighbor_index::map;
use std::str::FromStr;

pub use brute_force::nearest_by_brute_force;
pub use kd_tree::KdTree;
pub(crate) use neighbor::spacing_per_reach;
pub use neighbor::{Neighbor, Neighborhood};
pub(crate) use signed_union_find::{Member, SignedUnionFind};

/// The method that finds neighbours. The result does not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NeighborMethod {
    /// Sparse hashed cells as wide as the neighbour distance.
    Grid,
    /// A sweep along the longest axis over a two-dimensional array of cells (Wiesmeier 2011).
    ScanLine,
    /// A balanced kd-tree, the only method that also finds the nearest k.
    #[default]
    Knn,
}

/// Returns `visit(point, neighbours)` of every point, in the order of the points. Neighbours come nearest first.
///
/// A point whose position is not finite has no neighbours and is no neighbour.
///
/// # Errors
///
/// Returns [`Error::Setting`] for a neighbourhood out of range or one that `method` cannot find,
/// [`Error::TooManyPoints`] beyond 32-bit indices, and [`Error::Cancelled`] if `progress` is cancelled.
pub fn map_neighborhoods<T: Copy + Default + Send + Sync>(
    positions: &[Vec3],
    method: NeighborMethod,
    neighborhood: Neighborhood,
    progress: &dyn Progress,
    visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
) -> Result<Vec<T>> {
    match (method, neighborhood) {
        (NeighborMethod::Knn, _) => {
            KdTree::new(positions, progress)?.map(neighborhood, progress, visit)
        }
        (_, Neighborhood::Nearest(_)) => Err(Error::Setting {
            name: "neighbors",
            found: method.to_string(),
            expected: "knn for the nearest k",
        }),
        (NeighborMethod::Grid, Neighborhood::Within(distance)) => {
            let grid = grid::Grid::new(positions, distance, progress)?;
            map(&grid, positions, progress, visit)
        }
        (NeighborMethod::ScanLine, Neighborhood::Within(distance)) => {
            match scan_line::ScanLine::new(positions, distance, progress)? {
                Some(sweep) => map(&sweep, positions, progress, visit),
                None => map_neighborhoods(
                    positions,
                    NeighborMethod::Grid,
                    neighborhood,
                    progress,
                    visit,
                ),
            }
        }
    }
}

impl std::fmt::Display for NeighborMethod {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Grid => "grid",
            Self::ScanLine => "scan-line",
            Self::Knn => "knn",
        })
    }
}

impl FromStr for NeighborMethod {
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
