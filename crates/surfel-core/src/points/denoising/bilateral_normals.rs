//! Normals that keep edges, and the projection along them: normals are averaged over neighbours of similar normals (bilateral
//! filter), and a point moves along its normal onto the weighted mean of its neighbours' planes (after Huang et al.,
//! Edge-Aware Point Set Resampling, 2013).

use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor, spacing_per_reach};
use crate::points::normals::planes::fit_plane;
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours per spacing of noise: the fitted normals err by some two degrees.
pub const NEIGHBORS_PER_NOISE: f32 = 80.0;
/// Surface variation above which the neighbours may be on both faces of a thin wall.
const MIN_UNEVEN: f32 = 0.06;
/// Number of rounds in which normals are averaged.
const N_NORMAL_ROUNDS: usize = 2;
/// Number of times that a point moves.
const N_MOVES: usize = 2;
/// Difference of two unit normals at which the weight has fallen to 1 / e.
const NORMAL_WIDTH: f32 = 0.4;
/// Height above a neighbour's plane, in standard deviations of the noise, from which it belongs to another surface.
const MAX_HEIGHT: f32 = 6.0;

/// Points, or means of points, with normals that are averaged over neighbours of similar normals.
pub struct BilateralNormals<'a> {
    tree: &'a KdTree<'a>,
    /// Number of neighbours that take part in the normal of each point.
    counts: Vec<u32>,
    /// Unit normals of either sign, zero if unknown.
    pub normals: Vec<Vec3>,
    /// True if no plane fits the neighbours.
    pub is_uneven: Vec<bool>,
}

impl<'a> BilateralNormals<'a> {
    /// Fits a plane to the neighbours of each point, and averages the normals. `counts` are the numbers of neighbours that take part,
    /// zero for points whose normal is not wanted.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn new(tree: &'a KdTree<'a>, counts: Vec<u32>, progress: &dyn Progress) -> Result<Self> {
        let positions = tree.positions();
        let normal = |(point, count): (usize, &u32)| {
            progress.check()?;
            if *count == 0 {
                return Ok((Vec3::ZERO, false));
            }
            let neighbors = tree.nearest(positions[point], *count as usize, Some(point as u32));
            let fit = fit_plane(positions, point, &neighbors);
            Ok((fit.normal, MIN_UNEVEN < fit.variation))
        };
        let fits = counts.par_iter().enumerate().map(normal).collect::<Result<Vec<_>>>()?;
        let (normals, is_uneven) = fits.into_iter().unzip();
        let mut found = Self { tree, counts, normals, is_uneven };
        for _ in 0..N_NORMAL_ROUNDS {
            found.normals = found.averaged_normals(progress)?;
        }
        Ok(found)
    }

    /// True if no plane fits the neighbours of the nearest point.
    pub fn is_uneven_at(&self, position: Vec3) -> bool {
        let nearest = self.tree.nearest(position, 1, None);
        nearest.first().is_some_and(|nearest| self.is_uneven[nearest.index as usize])
    }

    /// Returns the normal of the nearest point, or zero if there is none.
    pub fn normal_near(&self, position: Vec3) -> Vec3 {
        let nearest = self.tree.nearest(position, 1, None);
        nearest.first().map_or(Vec3::ZERO, |nearest| self.normals[nearest.index as usize])
    }

    fn averaged_normals(&self, progress: &dyn Progress) -> Result<Vec<Vec3>> {
        let averaged = |(point, position): (usize, &Vec3)| {
            progress.check()?;
            let normal = self.normals[point];
            if normal == Vec3::ZERO {
                return Ok(normal);
            }
            let neighbors = self.neighbors(*position, self.counts[point]);
            let weighted = neighbors.points.iter().map(|neighbor| {
                let (other, similarity) = self.similar_normal(neighbor, normal);
                let offset = self.tree.positions()[neighbor.index as usize] - position;
                neighbors.closeness(offset, normal) * similarity * other
            });
            Ok(weighted.sum::<Vec3>().normalize_or(normal))
        };
        self.tree.positions().par_iter().enumerate().map(averaged).collect()
    }

    /// Returns the neighbours of a position.
    fn neighbors(&self, position: Vec3, count: u32) -> Neighbors {
        // A point is the nearest to itself.
        let points = self.tree.nearest(position, count as usize + 1, None);
        let reach = points.last().map_or(0.0, |last| last.distance_squared);
        Neighbors { points, per_reach: 1.0 / reach.max(f32::MIN_POSITIVE) }
    }

    /// Returns the normal of a neighbour on the side of `normal`, and its weight by the angle in between.
    fn similar_normal(&self, neighbor: &Neighbor, normal: Vec3) -> (Vec3, f32) {
        let other = self.normals[neighbor.index as usize];
        let cosine = normal.dot(other);
        let difference = (2.0 - 2.0 * cosine.abs()) / (NORMAL_WIDTH * NORMAL_WIDTH);
        // About exp(-difference).
        let similarity = (1.0 - difference / 8.0).max(0.0).powi(8);
        (if cosine < 0.0 { -other } else { other }, similarity)
    }

    /// Projects a position onto the surface along the normal of the nearest point. Each neighbour stands for
    /// `group_size` points.
    pub fn project(&self, position: Vec3, count: u32, group_size: f32) -> Vec3 {
        let neighbors = self.neighbors(position, count);
        let Some(nearest) = neighbors.points.first() else { return position };
        let normal = self.normals[nearest.index as usize];
        let n_points = group_size * count as f32;
        let noise = n_points / NEIGHBORS_PER_NOISE * spacing_per_reach(n_points);
        let max_height = MAX_HEIGHT * MAX_HEIGHT * noise * noise;
        let mut projected = position;
        for _ in 0..N_MOVES {
            let (mut sum, mut weight) = (0.0, 0.0);
            for neighbor in &neighbors.points {
                let offset = projected - self.tree.positions()[neighbor.index as usize];
                let (other, similarity) = self.similar_normal(neighbor, normal);
                // The mean of both normals: this height is zero for any two points of a sphere.
                let height = 0.5 * (normal + other).dot(offset);
                let squared = height * height * neighbors.per_reach;
                let closeness = neighbors.closeness(offset, normal);
                let flatness = (1.0 - squared / max_height).max(0.0);
                let own = closeness * closeness * similarity * flatness;
                sum += own * height;
                weight += own;
            }
            if 0.0 < weight {
                projected -= normal * (sum / weight);
            }
        }
        projected
    }
}

/// The neighbours of a position, nearest first.
struct Neighbors {
    points: Vec<Neighbor>,
    /// Reciprocal of the squared distance of the last one.
    per_reach: f32,
}

impl Neighbors {
    /// Returns the weight of a neighbour at `offset` by its distance in the plane of the normal.
    fn closeness(&self, offset: Vec3, normal: Vec3) -> f32 {
        let height = offset.dot(normal);
        let inside = (1.0 - (offset.length_squared() - height * height) * self.per_reach).max(0.0);
        inside * inside
    }
}
