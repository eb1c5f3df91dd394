//! The votes of neighbours on structures: the region around a point decides whether it is scattered.

use super::neighborhood_stats::SPARSE;
use super::point_shape::{PointShape, Structure};
use super::vegetation::{count_scattered, is_noisy, is_vegetated};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor, Neighborhood};
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours that vote on the structure of a point.
const N_VOTERS: usize = 8;
/// Indices of the neighbours that vote on the structure of a point, `u32::MAX` where there are fewer.
pub type Voters = [u32; N_VOTERS];
/// Number of rounds in which points take over half of their neighbours' mean.
const N_ROUNDS: usize = 12;
/// Fraction of scattered points around a point, after all rounds, that makes it a scattered one.
const MIN_SCATTERED: f32 = 0.5;
/// Minimum fraction of scattered points around a scattered point of a noisy cloud.
const MIN_SCATTERED_IN_NOISE: f32 = 0.9;
/// Maximum number of rounds in which islands of a surface shrink.
const N_ISLAND_ROUNDS: usize = 8;
/// Fraction of scattered points from which a surface point is looked at again: small islands of a surface among scattered
/// points, as where branches happen to lie in a plane, are scattered too.
const MIN_FRACTION_NEAR_SCATTER: f32 = 0.02;
/// Number of neighbours most of which are scattered around a point of an island.
const N_ISLAND_NEIGHBORS: usize = 48;

/// Returns the voters among the neighbours of a point, which come nearest first.
pub fn voters_among(neighbors: &[Neighbor]) -> Voters {
    let mut indices = [u32::MAX; N_VOTERS];
    for (index, neighbor) in indices.iter_mut().zip(neighbors) {
        *index = neighbor.index;
    }
    indices
}

/// Lets the region around a point decide whether it is scattered, so that structures do not flicker: a rough point of a
/// surface stays on the surface, and a flat spot of a crown becomes leaves.
///
/// `n_rough` is the number of points whose nearest neighbours lie in no plane. If most of them lie in a plane of more
/// neighbours, the cloud is noisy rather than leafy, and points are scattered only amid others.
///
/// A sparse scattered point by a surface stays one if much is scattered, as in a forest: its disc would be wide.
pub fn smoothed(
    tree: &KdTree,
    shapes: &[PointShape],
    voters: Vec<Voters>,
    n_rough: usize,
    typical_radius: f32,
    progress: &dyn Progress,
) -> Result<Vec<Structure>> {
    let own = shapes.par_iter().map(|shape| shape.structure);
    let n_scattered = count_scattered(shapes);
    if n_scattered == 0 {
        return Ok(own.collect());
    }
    let is_noisy = is_noisy(n_scattered, n_rough);
    let is_vegetated = is_vegetated(shapes, n_rough);
    let min_scattered = if is_noisy { MIN_SCATTERED_IN_NOISE } else { MIN_SCATTERED };
    let max_radius = if is_vegetated { SPARSE * typical_radius } else { f32::INFINITY };
    let voters = match voters.is_empty() {
        true => {
            tree.map(Neighborhood::Nearest(N_VOTERS), progress, |_, found| voters_among(found))?
        }
        false => voters,
    };
    let mut fractions: Vec<f32> =
        own.clone().map(|structure| f32::from(u8::from(structure == Structure::Scatter))).collect();
    for _ in 0..N_ROUNDS {
        progress.check()?;
        let mixed = |(own, voters): (&f32, &Voters)| {
            let of_voters = voters.iter().filter(|voter| **voter != u32::MAX);
            let n_voters = of_voters.clone().count().max(1) as f32;
            let sum: f32 = of_voters.map(|voter| fractions[*voter as usize]).sum();
            0.5 * (own + sum / n_voters)
        };
        fractions = fractions.par_iter().zip(&voters).map(mixed).collect();
    }
    let decided = |((own, shape), fraction): ((Structure, &PointShape), &f32)| match own {
        Structure::Line => Structure::Line,
        _ if min_scattered <= *fraction => Structure::Scatter,
        Structure::Scatter if shape.radius <= max_radius => Structure::Surface,
        own => own,
    };
    let mut structures: Vec<Structure> = own.zip(shapes).zip(&fractions).map(decided).collect();
    if !is_noisy {
        scatter_islands(tree, &mut structures, &fractions, progress)?;
    }
    Ok(structures)
}

/// Scatters the surface points most of whose neighbours are scattered. In each round after the first, only points near
/// those that the last one scattered are looked at.
fn scatter_islands(
    tree: &KdTree,
    structures: &mut [Structure],
    fractions: &[f32],
    progress: &dyn Progress,
) -> Result<()> {
    let positions = tree.positions();
    let is_near_scatter = |point: &u32| {
        let (structure, fraction) = (structures[*point as usize], fractions[*point as usize]);
        structure == Structure::Surface && MIN_FRACTION_NEAR_SCATTER <= fraction
    };
    let near_scatter = (0..positions.len() as u32).filter(is_near_scatter);
    let mut candidates: Vec<IslandCandidate> =
        near_scatter.map(|point| IslandCandidate { point, reach_squared: f32::INFINITY }).collect();
    let position = |candidate: &IslandCandidate| positions[candidate.point as usize];
    let mut scattered: Vec<Vec3> = candidates.iter().map(position).collect();
    for _ in 0..N_ISLAND_ROUNDS {
        let last_scattered = KdTree::new(&scattered, progress)?;
        let look = |candidate: &mut IslandCandidate| {
            progress.check()?;
            let nearest = last_scattered.nearest(position(candidate), 1, None);
            let is_far = |nearest: &Neighbor| candidate.reach_squared < nearest.distance_squared;
            if nearest.first().is_none_or(is_far) {
                return Ok(false);
            }
            let around =
                tree.nearest(position(candidate), N_ISLAND_NEIGHBORS, Some(candidate.point));
            candidate.reach_squared = around.last().map_or(0.0, |last| last.distance_squared);
            let of_neighbor = |neighbor: &Neighbor| structures[neighbor.index as usize];
            let is_scattered = |neighbor: &&Neighbor| of_neighbor(neighbor) == Structure::Scatter;
            Ok(around.len() <= 2 * around.iter().filter(is_scattered).count())
        };
        let is_island = candidates.par_iter_mut().map(look).collect::<Result<Vec<bool>>>()?;
        let mut is_island = is_island.into_iter();
        let (islands, others): (Vec<_>, Vec<_>) =
            candidates.into_iter().partition(|_| is_island.next() == Some(true));
        islands.iter().for_each(|island| structures[island.point as usize] = Structure::Scatter);
        scattered = islands.iter().map(position).collect();
        candidates = others;
    }
    Ok(())
}

/// A surface point near scattered ones.
struct IslandCandidate {
    point: u32,
    /// Squared distance to the farthest of its neighbours, infinite if these are not known.
    reach_squared: f32,
}

#[cfg(test)]
mod tests {
    //! Islands of surfaces.

    use super::*;
    use crate::math::Random;
    use crate::progress::NoProgress;

    fn island_in_a_cube(radius: f32) -> (Vec<Vec3>, Vec<Structure>) {
        let mut random = Random::new(6, 0);
        let mut point = || Vec3::from_array(std::array::from_fn(|_| random.next_f32()));
        let points: Vec<Vec3> = (0..8000).map(|_| point()).collect();
        let structure = |point: &Vec3| match point.distance(Vec3::splat(0.5)) < radius {
            true => Structure::Surface,
            false => Structure::Scatter,
        };
        let structures = points.iter().map(structure).collect();
        (points, structures)
    }

    #[test]
    fn small_islands_of_a_surface_amid_leaves_vanish() {
        // A sphere of the smaller radius has 33 points, one of the larger has 2100.
        for (radius, stays) in [(0.1, false), (0.4, true)] {
            let (points, mut structures) = island_in_a_cube(radius);
            let tree = KdTree::new(&points, &NoProgress).unwrap();
            let fractions = vec![1.0; points.len()];
            scatter_islands(&tree, &mut structures, &fractions, &NoProgress).unwrap();
            assert_eq!(structures.contains(&Structure::Surface), stays, "{radius}");
        }
    }

    #[test]
    fn islands_equal_a_look_at_all_points_in_each_round() {
        let (points, mut structures) = island_in_a_cube(0.3);
        let tree = KdTree::new(&points, &NoProgress).unwrap();
        let mut expected = structures.clone();
        for _ in 0..N_ISLAND_ROUNDS {
            let last = expected.clone();
            let is_scattered = |point: u32| last[point as usize] == Structure::Scatter;
            for (point, structure) in expected.iter_mut().enumerate() {
                let around = tree.nearest(points[point], N_ISLAND_NEIGHBORS, Some(point as u32));
                let n_scattered = around.iter().filter(|other| is_scattered(other.index)).count();
                if around.len() <= 2 * n_scattered {
                    *structure = Structure::Scatter;
                }
            }
        }
        let n_before = structures.iter().filter(|own| **own == Structure::Surface).count();
        scatter_islands(&tree, &mut structures, &vec![1.0; points.len()], &NoProgress).unwrap();
        let n_after = structures.iter().filter(|own| **own == Structure::Surface).count();
        assert!(0 < n_after && n_after < n_before, "{n_after} of {n_before}");
        assert_eq!(structures, expected);
    }
}
