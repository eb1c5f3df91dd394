//! The noise around one point, by its neighbours or by means of groups of them.
//!
//! If a plane fits better the more neighbours it is fitted to, the distances from it are noise, not shape.

use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor, Neighborhood};
use crate::points::normals::planes::{PlaneFit, fit_plane};
use crate::progress::Progress;
use std::f32::consts::PI;

/// Number of neighbours per squared spacing of noise at which the surface variation falls below [`MAX_PLANE_VARIATION`].
const NEIGHBORS_PER_SQUARED_NOISE: f32 = 220.0;
/// Number of points of a group, whose mean stands for them in large neighbourhoods.
pub const GROUP_SIZE: usize = 8;
/// Numbers of neighbours between which the noise is searched.
pub const MIN_NOISE_NEIGHBORS: usize = 16;
const MAX_NOISE_NEIGHBORS: usize = 8192;
/// Number of neighbours above which groups of points stand for them in this search.
const MAX_UNGROUPED: usize = 1024;
/// Surface variation below which a plane fits well enough to tell noise by it.
const MAX_PLANE_VARIATION: f32 = 0.03;
/// Surface variation below which noise can be told where the surface begins to bend.
const MAX_BENT_VARIATION: f32 = 0.08;
/// Surface variation above which a neighbourhood fills space, as the noise is larger than the neighbourhood.
const MIN_SPACE_VARIATION: f32 = 0.12;
/// Ratio of the variation to that of half as many neighbours above which a shape bends, and noise cannot be told.
const MAX_BEND_RATIO: f32 = 0.75;

/// The noise around a point.
#[derive(Clone, Copy, PartialEq)]
pub enum NoiseAtPoint {
    /// The standard deviation, in spacings, from the plane through so many neighbours that a plane fits.
    Known(f32),
    /// The surface bends.
    Bent,
    /// The neighbours fill space, however many.
    FillsSpace,
}

impl NoiseAtPoint {
    /// Measures the noise around a point from its neighbours, then from groups of points around it.
    pub fn new(points: &KdTree, groups: &KdTree, point: u32) -> Self {
        let center = points.positions()[point as usize];
        let (mut last_variation, mut has_fallen, mut has_risen) = (f32::INFINITY, false, false);
        let mut k = MIN_NOISE_NEIGHBORS;
        while k <= MAX_NOISE_NEIGHBORS {
            let nearest = NearestPoints::new(points, groups, center, k);
            let Some(fit) = nearest.and_then(|nearest| nearest.plane()) else {
                return Self::Bent;
            };
            if fit.normal == Vec3::ZERO {
                return Self::Bent;
            }
            let variation = fit.variation;
            if variation < MAX_PLANE_VARIATION {
                return Self::Known(fit.residual(k));
            }
            if MAX_BEND_RATIO * last_variation < variation {
                if has_fallen && last_variation < MAX_BENT_VARIATION {
                    let last = PlaneFit { variation: last_variation, ..fit };
                    return Self::Known(last.residual(k / 2));
                }
                if has_risen && last_variation < MIN_SPACE_VARIATION {
                    return Self::Bent;
                }
                has_risen = true;
            } else if last_variation < f32::INFINITY {
                (has_fallen, has_risen) = (true, false);
            }
            last_variation = variation;
            k *= 2;
        }
        Self::FillsSpace
    }
}

/// The points nearest to a position, or the groups that stand for them.
pub struct NearestPoints<'a> {
    /// The points, or the means of groups, among which the neighbours are.
    pub positions: &'a [Vec3],
    /// Nearest first.
    pub neighbors: Vec<Neighbor>,
    /// Number of points that each neighbour stands for.
    pub group_size: usize,
}

impl<'a> NearestPoints<'a> {
    /// Finds the `k` nearest points, as groups if they are many; `None` if there are fewer.
    fn new(points: &'a KdTree, groups: &'a KdTree, position: Vec3, k: usize) -> Option<Self> {
        let (tree, group_size) = match MAX_UNGROUPED < k {
            true => (groups, GROUP_SIZE),
            false => (points, 1),
        };
        let neighbors = tree.nearest(position, k / group_size, None);
        let is_complete = neighbors.len() == k / group_size;
        is_complete.then_some(Self { positions: tree.positions(), neighbors, group_size })
    }

    /// Finds as many as a noise in spacings asks for.
    pub fn by_noise(
        points: &'a KdTree,
        groups: &'a KdTree,
        position: Vec3,
        noise: f32,
    ) -> Option<Self> {
        let k = (NEIGHBORS_PER_SQUARED_NOISE * noise * noise) as usize;
        Self::new(points, groups, position, k.clamp(MIN_NOISE_NEIGHBORS, MAX_NOISE_NEIGHBORS))
    }

    /// Returns the plane through them; `None` if there are none.
    pub fn plane(&self) -> Option<PlaneFit> {
        let [nearest, others @ ..] = &self.neighbors[..] else { return None };
        Some(fit_plane(self.positions, nearest.index as usize, others))
    }
}

/// Returns the distance from a point to the last of [`MIN_NOISE_NEIGHBORS`].
pub fn reach_at(tree: &KdTree, point: u32) -> f32 {
    reach(&tree.nearest(tree.positions()[point as usize], MIN_NOISE_NEIGHBORS, Some(point)))
}

/// Returns the distance to the last of neighbours.
fn reach(neighbors: &[Neighbor]) -> f32 {
    neighbors.last().map_or(0.0, |last| last.distance_squared.sqrt())
}

/// True if there are no more points as high above the plane of the neighbours as a point than half as high: noise thins
/// out with the height, another surface does not.
fn thins_out(positions: &[Vec3], point: usize, neighbors: &[Neighbor], normal: Vec3) -> bool {
    let heights = || neighbors.iter().map(|other| normal.dot(positions[other.index as usize]));
    let level = heights().sum::<f32>() / neighbors.len() as f32;
    let own = normal.dot(positions[point]) - level;
    let n_within = |low: f32, high: f32| {
        heights().filter(|height| (low..high).contains(&((height - level) / own))).count()
    };
    n_within(0.75, 1.25) <= n_within(0.25, 0.75)
}

/// The plane through a point and its [`MIN_NOISE_NEIGHBORS`] nearest points.
#[derive(Clone, Copy, Default)]
pub struct LocalFit {
    /// Distance to the last of these points.
    pub reach: f32,
    /// Surface variation of these points.
    pub variation: f32,
}

impl LocalFit {
    /// Fits the plane of each point.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn of_points(points: &KdTree, progress: &dyn Progress) -> Result<Vec<Self>> {
        let nearest = Neighborhood::Nearest(MIN_NOISE_NEIGHBORS);
        points.map(nearest, progress, |point, neighbors| Self {
            reach: reach(neighbors),
            variation: fit_plane(points.positions(), point, neighbors).variation,
        })
    }

    /// True if a plane fits the neighbours only if there are as many as a noise in spacings asks for, and the point is on no
    /// other surface.
    pub fn is_noisier_at(self, tree: &KdTree, point: usize, noise: f32) -> bool {
        if self.variation < MAX_PLANE_VARIATION {
            return false;
        }
        let positions = tree.positions();
        let n_neighbors = (NEIGHBORS_PER_SQUARED_NOISE * noise * noise) as usize;
        let n_neighbors = n_neighbors.clamp(MIN_NOISE_NEIGHBORS, MAX_UNGROUPED);
        let neighbors = tree.nearest(positions[point], n_neighbors, Some(point as u32));
        let fit = fit_plane(positions, point, &neighbors);
        fit.variation < MAX_BENT_VARIATION && thins_out(positions, point, &neighbors, fit.normal)
    }
}

/// Returns the surface variation of a point's nearest neighbours in a plane with a noise in spacings.
pub fn variation_by_noise(noise: f32) -> f32 {
    // The squared radius of a disc is four times the variance along each of its axes.
    noise * noise * 2.0 * PI / MIN_NOISE_NEIGHBORS as f32
}
