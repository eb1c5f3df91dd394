//! Plants: their points look like noise of a surface, but are none, and stay where they are.

use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::KdTree;
use crate::points::normals::planes::fit_plane;
use crate::points::structure::above_land::is_above_land;
use crate::progress::Progress;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Number of neighbours that tell whether a point is rough.
const N_ROUGH_NEIGHBORS: usize = 16;
/// Least surface variation of the neighbours of a rough point, and the least ratio to the variation by noise alone.
const MIN_ROUGH_VARIATION: f32 = 0.06;
const MIN_ROUGH_RATIO: f32 = 3.0;
/// Number of neighbours of a rough point in a crown that fill space as well; those of an ornament on a wall lie in a plane.
const N_WIDE_NEIGHBORS: usize = 128;
/// Least surface variation of these.
const MIN_WIDE_VARIATION: f32 = 0.08;
/// Number of neighbours of a point.
const N_NEIGHBORS: usize = 24;
/// Fraction of the neighbours that are rough in a crown: at edges and corners fewer are.
const MIN_ROUGH_FRACTION: f32 = 0.75;
/// Minimum fraction of the points in crowns: fewer are on ears, claws and other small parts of a surface.
const MIN_IN_CROWNS: f32 = 0.01;
/// Heights above land by noise alone, in multiples of it: planes through few noisy points err as much as the points do.
const SLACK: f32 = 2.0;

/// The plants of a cloud.
pub struct Plants<'a> {
    tree: &'a KdTree<'a>,
    /// Noise of the ground in spacings.
    noise: f32,
    is_land: bool,
    /// True for each point in a crown; empty if there are no crowns.
    in_crown: Vec<bool>,
}

impl<'a> Plants<'a> {
    /// Finds the crowns among the points of `tree`. `noise` is that of the ground in spacings. There may be low plants if the
    /// cloud is land, and crowns if it states no normals, which only surfaces have.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn find(
        tree: &'a KdTree<'a>,
        noise: f32,
        is_land: bool,
        states_normals: bool,
        progress: &dyn Progress,
    ) -> Result<Self> {
        if states_normals {
            return Ok(Self { tree, noise, is_land, in_crown: Vec::new() });
        }
        let positions = tree.positions();
        let is_rough = rough_points(tree, noise, progress)?;
        let in_crown = |point: usize| {
            progress.check()?;
            if !is_rough[point] {
                return Ok(false);
            }
            let around = tree.nearest(positions[point], N_WIDE_NEIGHBORS, Some(point as u32));
            let near = &around[..N_NEIGHBORS.min(around.len())];
            let n_rough = near.iter().filter(|other| is_rough[other.index as usize]).count();
            Ok(MIN_ROUGH_FRACTION * (near.len() as f32) < n_rough as f32
                && MIN_WIDE_VARIATION < fit_plane(positions, point, &around).variation)
        };
        let mut in_crown =
            (0..positions.len()).into_par_iter().map(in_crown).collect::<Result<Vec<bool>>>()?;
        let n_in_crowns = in_crown.iter().filter(|in_crown| **in_crown).count();
        if (n_in_crowns as f32) < MIN_IN_CROWNS * positions.len() as f32 {
            in_crown.clear();
        }
        Ok(Self { tree, noise, is_land, in_crown })
    }

    /// True for a point in a crown, and for one above land, as of a low plant.
    pub fn contains(&self, point: usize) -> bool {
        self.in_crown.get(point).is_some_and(|in_crown| *in_crown)
            || self.is_land && self.is_low(point)
    }

    fn is_low(&self, point: usize) -> bool {
        let positions = self.tree.positions();
        let neighbors = self.tree.nearest(positions[point], N_NEIGHBORS, Some(point as u32));
        let radius_in_spacings = (N_NEIGHBORS as f32 / PI).sqrt();
        is_above_land(positions, point, &neighbors, SLACK * self.noise / radius_in_spacings)
    }
}

/// Returns for each point whether its nearest neighbours lie in no plane, not even in one with a noise in spacings.
fn rough_points(tree: &KdTree, noise: f32, progress: &dyn Progress) -> Result<Vec<bool>> {
    let positions = tree.positions();
    // The squared radius of a disc is four times the variance along each of its axes.
    let by_noise = noise * noise * 2.0 * PI / N_ROUGH_NEIGHBORS as f32;
    let is_rough = |(point, position): (usize, &Vec3)| {
        progress.check()?;
        let neighbors = tree.nearest(*position, N_ROUGH_NEIGHBORS, Some(point as u32));
        let variation = fit_plane(positions, point, &neighbors).variation;
        Ok(MIN_ROUGH_VARIATION.max(MIN_ROUGH_RATIO * by_noise) < variation)
    };
    positions.par_iter().enumerate().map(is_rough).collect()
}

#[cfg(test)]
mod tests {
    //! A tree on noisy ground.

    use crate::math::{Random, Vec3};
    use crate::points::{Denoise, PointCloud, denoise};
    use crate::progress::NoProgress;

    #[test]
    fn the_points_of_a_crown_stay_and_those_of_the_ground_below_move() {
        let mut random = Random::new(8, 0);
        let ground = (0..9000).map(|_| {
            let height = 0.25 * random.next_gaussian() as f32;
            Vec3::new(95.0 * random.next_f32(), 95.0 * random.next_f32(), height)
        });
        let mut points: Vec<Vec3> = ground.collect();
        let n_ground = points.len();
        let mut within = || 2.0 * random.next_f32() - 1.0;
        while points.len() < n_ground + 900 {
            let offset = Vec3::new(within(), within(), within());
            if offset.length() < 1.0 {
                points.push(Vec3::new(47.0, 47.0, 12.0) + 6.0 * offset);
            }
        }
        let mut cloud = PointCloud::from_positions(points.clone());
        denoise(&mut cloud, Denoise::On, &NoProgress).unwrap().unwrap();
        let has_moved = |i: &usize| cloud.positions[*i] != points[*i];
        let n_of_ground = (0..n_ground).filter(has_moved).count();
        let n_of_crown = (n_ground..points.len()).filter(has_moved).count();
        assert!(8800 < n_of_ground && n_of_crown < 250, "{n_of_ground} {n_of_crown}");
    }
}
