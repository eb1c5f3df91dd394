//! Plants: their points look like noise of a surface, but are none, and stay where they are.

use super::noise_at_point::{LocalFit, NearestPoints, variation_by_noise};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::PointCloud;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::planes::{PlaneFit, fit_plane};
use crate::points::structure::above_land::is_above_land;
use crate::points::up::is_mostly_land;
use crate::progress::Progress;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::ops::Range;

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
const MIN_IN_CROWNS: f32 = 0.05;
/// Minimum fraction of the points in crowns on land.
const MIN_IN_CROWNS_ON_LAND: f32 = 0.01;
/// Number of rough points near each other that are in a crown together, or in the noise of a surface.
const RUN_SIZE: usize = 128;
/// Number of points of such a run that vote on it.
const N_VOTERS: usize = 3;
/// Ratios of the noise of a surface to that of its region, which are tried in turn.
const NOISE_RATIOS: [f32; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];
/// Maximum surface variation of as many neighbours as the noise of a surface asks for.
const MAX_NOISE_VARIATION: f32 = 0.08;
/// Minimum number of points in crowns near a plane that tell noise by their heights.
const MIN_HEIGHTS: usize = 8;
/// Minimum fraction of them on either side of the plane of the neighbours: a crown is above the ground.
const MIN_ON_SIDE: f32 = 0.15;
/// Maximum vertical component of the normal of a noisy surface on land, where crowns side by side are as level as the ground.
const MAX_LEVEL: f32 = 0.7;
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

/// Points with what is known about the noise of each.
#[derive(Clone, Copy)]
pub struct NoisyPoints<'a> {
    /// Points near each other in memory.
    pub tree: &'a KdTree<'a>,
    /// Means of groups of them.
    pub groups: &'a KdTree<'a>,
    /// The planes through their nearest neighbours.
    pub fits: &'a [LocalFit],
    /// The noise at each point in spacings where it is known.
    pub noises: &'a [Option<f32>],
}

impl<'a> Plants<'a> {
    /// Finds the crowns among points. `noise` is that of the ground in spacings. There may be low plants if `cloud`, whose points
    /// they are, is land, and crowns if it states no normals, which only surfaces have.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn find(
        points: NoisyPoints<'a>,
        noise: f32,
        cloud: &PointCloud,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let NoisyPoints { tree, fits, .. } = points;
        let is_land = is_mostly_land(&cloud.positions);
        if cloud.normals.is_some() {
            return Ok(Self { tree, noise, is_land, in_crown: Vec::new() });
        }
        let positions = tree.positions();
        let min_rough_variation =
            MIN_ROUGH_VARIATION.max(MIN_ROUGH_RATIO * variation_by_noise(noise));
        let is_rough = |point: usize| min_rough_variation < fits[point].variation;
        let in_crown = |point: usize| {
            progress.check()?;
            if !is_rough(point) {
                return Ok(false);
            }
            let around = tree.nearest(positions[point], N_WIDE_NEIGHBORS, Some(point as u32));
            let near = &around[..N_NEIGHBORS.min(around.len())];
            let n_rough = near.iter().filter(|other| is_rough(other.index as usize)).count();
            Ok(MIN_ROUGH_FRACTION * (near.len() as f32) < n_rough as f32
                && MIN_WIDE_VARIATION < fit_plane(positions, point, &around).variation)
        };
        let mut in_crown =
            (0..positions.len()).into_par_iter().map(in_crown).collect::<Result<Vec<bool>>>()?;
        remove_noise(points, is_land, &mut in_crown, progress)?;
        let n_in_crowns = in_crown.iter().filter(|in_crown| **in_crown).count();
        let min_fraction = if is_land { MIN_IN_CROWNS_ON_LAND } else { MIN_IN_CROWNS };
        if (n_in_crowns as f32) < min_fraction * positions.len() as f32 {
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

/// Removes those points from crowns whose noise explains that their neighbours fill space.
fn remove_noise(
    noisy: NoisyPoints,
    is_land: bool,
    in_crown: &mut [bool],
    progress: &dyn Progress,
) -> Result<()> {
    let points: Vec<usize> = (0..in_crown.len()).filter(|point| in_crown[*point]).collect();
    let votes_for_noise = |point: usize| {
        let has_plane = |ratio: f32| noisy_plane(noisy, point, ratio * noisy.noises[point]?);
        let plane = NOISE_RATIOS.into_iter().find_map(has_plane);
        plane.is_some_and(|plane| {
            (!is_land || plane.normal.z.abs() < MAX_LEVEL)
                && plane.has_points_on_both_sides(|index| in_crown[index])
        })
    };
    let is_noise = |run: &&[usize]| {
        progress.check()?;
        let voters: Vec<&usize> = run.iter().step_by(run.len().div_ceil(N_VOTERS)).collect();
        let n_votes = voters.iter().filter(|point| votes_for_noise(***point)).count();
        Ok(voters.len() < 2 * n_votes)
    };
    let runs: Vec<&[usize]> = points.chunks(RUN_SIZE).collect();
    let are_noise = runs.par_iter().map(is_noise).collect::<Result<Vec<bool>>>()?;
    let noise = runs.iter().zip(are_noise).filter(|(_, is_noise)| *is_noise);
    noise.flat_map(|(run, _)| *run).for_each(|point| in_crown[*point] = false);
    Ok(())
}

/// A plane through noisy points.
struct NoisyPlane {
    normal: Vec3,
    /// Indices of the points, or those that the groups stand for, each range with the height above the plane.
    heights: Vec<(Range<usize>, f32)>,
}

/// Returns the plane through as many neighbours of a point as a noise in spacings asks for; `None` if they lie in no plane.
fn noisy_plane(noisy: NoisyPoints, point: usize, noise: f32) -> Option<NoisyPlane> {
    let NoisyPoints { tree, groups, .. } = noisy;
    let nearest = NearestPoints::by_noise(tree, groups, tree.positions()[point], noise)?;
    let PlaneFit { normal, variation, .. } = nearest.plane()?;
    if MAX_NOISE_VARIATION < variation {
        return None;
    }
    let NearestPoints { positions, neighbors, group_size } = nearest;
    let sum: Vec3 = neighbors.iter().map(|other| positions[other.index as usize]).sum();
    let center = sum / neighbors.len() as f32;
    let n_points = tree.positions().len();
    let height = |other: &Neighbor| {
        let index = other.index as usize;
        let points = group_size * index..n_points.min(group_size * (index + 1));
        (points, normal.dot(positions[index] - center))
    };
    Some(NoisyPlane { normal, heights: neighbors.iter().map(height).collect() })
}

impl NoisyPlane {
    /// True if those of the points that are in crowns are on both sides of the plane.
    fn has_points_on_both_sides(&self, is_in_crown: impl Fn(usize) -> bool) -> bool {
        let found = self.heights.iter().filter(|(points, _)| points.clone().any(&is_in_crown));
        let (n_found, n_above) = found.fold((0usize, 0usize), |(n_found, n_above), (_, height)| {
            (n_found + 1, n_above + usize::from(0.0 < *height))
        });
        let min_on_side = MIN_ON_SIDE * n_found as f32;
        MIN_HEIGHTS <= n_found && min_on_side <= n_above.min(n_found - n_above) as f32
    }
}

#[cfg(test)]
mod tests {
    //! A tree on noisy ground, and a noisy wall.

    use crate::math::{Random, Vec3};
    use crate::points::{Denoise, PointCloud, denoise};
    use crate::progress::NoProgress;

    #[test]
    fn the_points_of_crowns_stay_and_those_of_the_ground_below_move() {
        // A tree, which takes a tenth of the points, and a wood, which takes half of them.
        let of_wood = vec![[24.0, 24.0], [70.0, 24.0], [47.0, 70.0]];
        for (n_of_crowns, crowns, min_moved) in
            [(900, vec![[47.0, 47.0]], 8500), (9000, of_wood, 6750)]
        {
            let mut random = Random::new(8, 0);
            let ground = (0..9000).map(|_| {
                let height = 0.25 * random.next_gaussian() as f32;
                Vec3::new(95.0 * random.next_f32(), 95.0 * random.next_f32(), height)
            });
            let mut points: Vec<Vec3> = ground.collect();
            let n_ground = points.len();
            let size = 6.0 * (n_of_crowns as f32 / 900.0 / crowns.len() as f32).cbrt();
            let mut within = || 2.0 * random.next_f32() - 1.0;
            while points.len() < n_ground + n_of_crowns {
                let offset = Vec3::new(within(), within(), within());
                if offset.length() < 1.0 {
                    let [x, y] = crowns[points.len() % crowns.len()];
                    points.push(Vec3::new(x, y, 3.0 + 1.5 * size) + size * offset);
                }
            }
            let mut cloud = PointCloud::from_positions(points.clone());
            denoise(&mut cloud, Denoise::Auto, &NoProgress).unwrap().unwrap();
            let has_moved = |i: &usize| cloud.positions[*i] != points[*i];
            let n_of_ground = (0..n_ground).filter(has_moved).count();
            let n_moved = (n_ground..points.len()).filter(has_moved).count();
            assert!(
                min_moved < n_of_ground && 3 * n_moved < n_of_crowns,
                "{n_of_ground} {n_moved}"
            );
        }
    }

    #[test]
    fn a_wall_with_far_more_noise_than_the_floor_is_no_crown() {
        let mut random = Random::new(9, 0);
        let mut points: Vec<Vec3> = Vec::new();
        let side = |random: &mut Random| 95.0 * random.next_f32();
        for _ in 0..9000 {
            let height = 0.25 * random.next_gaussian() as f32;
            points.push(Vec3::new(side(&mut random), side(&mut random), height));
        }
        let n_floor = points.len();
        for _ in 0..4500 {
            let depth = 2.5 * random.next_gaussian() as f32;
            points.push(Vec3::new(side(&mut random), 95.0 + depth, 0.5 * side(&mut random)));
        }
        let mut cloud = PointCloud::from_positions(points);
        denoise(&mut cloud, Denoise::On, &NoProgress).unwrap().unwrap();
        let wall = &cloud.positions[n_floor..];
        // Above the floor, whose points are as near as those of the wall.
        let is_off = |p: &&Vec3| 10.0 < p.z && 1.5 < (p.y - 95.0).abs();
        let n_off = wall.iter().filter(is_off).count();
        assert!(20 * n_off < wall.len(), "{n_off} of {}", wall.len());
    }
}
