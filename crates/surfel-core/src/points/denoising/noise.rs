//! The noise of a cloud: the standard deviation of points from their surface, in spacings.
//!
//! If a plane fits better the more neighbours it is fitted to, the distances from it are noise, not shape. The noise is
//! measured at some points of each region.

use super::depth_steps::DepthSteps;
use crate::error::Result;
use crate::math::{Vec3, median, quantile};
use crate::points::neighbors::{KdTree, Neighbor, spacing_per_reach};
use crate::points::normals::planes::{PlaneFit, fit_plane};
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours per squared spacing of noise at which the surface variation falls below [`MAX_PLANE_VARIATION`].
const NEIGHBORS_PER_SQUARED_NOISE: f32 = 220.0;
/// Number of points of a group, whose mean stands for them in large neighbourhoods.
pub const GROUP_SIZE: usize = 8;
/// Numbers of neighbours between which the noise is searched.
const MIN_NOISE_NEIGHBORS: usize = 16;
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
/// Number of points in a region of one noise: a fraction of the cloud, between two limits.
const REGION_SIZES: [usize; 2] = [256, 4096];
const N_REGIONS: usize = 256;
/// Number of points that are asked for the noise of a region.
const N_SAMPLES: usize = 16;
/// Minimum fraction of them at which the noise can be told.
const MIN_KNOWN: f32 = 0.25;
/// Ratio of noises to the median of their region from which they are those of points that another scanner measured farther
/// away.
const OTHER_RATIO: f32 = 2.0;
/// Minimum of such noises in spacings: with less, points lie in the surface rather than above it.
const MIN_OTHER: f32 = 1.0;
/// Minimum number of such noises in a region.
const MIN_OTHERS: usize = 2;
/// Ratio of the distance between neighbours to that of the region from which a point is asked for its own noise: regions of
/// many points in a small place reach far where points are sparse.
const SPARSE_RATIO: f32 = 2.0;
/// Fraction of points up to which the noise can be told in a cloud with leaves, and from which in its regions of surfaces.
/// Forests have 0.3 to 0.75.
const MIN_SURFACES: f32 = 0.8;
/// Minimum fraction of points whose neighbours fill space, among those at which the noise cannot be told, in a cloud with
/// leaves. Forests have 0.2 to 0.8, noisy animals with claws and horns 0.13.
const MIN_FILLED: f32 = 0.15;
/// Minimum fraction of points at which the noise can be told in other clouds.
const MIN_KNOWN_OF_BENT: f32 = 0.7;
/// Minimum fraction in a region of a cloud with leaves whose points lie near a plane, as those of the ground do.
const MIN_KNOWN_OF_SLAB: f32 = 0.5;
/// Maximum surface variation of these points.
const MAX_SLAB_VARIATION: f32 = 0.03;
/// Minimum fraction of regions of surfaces in a cloud with leaves that is denoised.
const MIN_SURFACE_REGIONS: f32 = 0.1;
/// Noise in steps of a depth camera. Evenly spread errors have 1 / sqrt(12), but neighbouring points err together, so
/// that a plane must reach over several steps: at half a step, walls across the view stayed in patches.
const NOISE_PER_STEP: f32 = 1.0;
/// Number of regions over which the noise is interpolated.
const N_BLENDED_REGIONS: usize = 4;

/// The noise by regions of a cloud.
pub struct Noise {
    /// Middles of the regions whose noise is known.
    centers: Vec<Vec3>,
    /// Their noise in spacings.
    noises: Vec<RegionNoise>,
    /// Typical noise of those that are surfaces beyond doubt.
    of_surfaces: Vec<f32>,
    has_surfaces: bool,
    /// True for each point of a region that has no noise, as it fills space like leaves.
    is_at_rest: Vec<bool>,
}

impl Noise {
    /// Measures the noise. `order` lists the points so that those near each other follow each other, and `groups` are the
    /// means of each [`GROUP_SIZE`] of them. `steps` are those of a depth camera.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn new(
        tree: &KdTree,
        groups: &KdTree,
        order: &[u32],
        steps: Option<&DepthSteps>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let [least, most] = REGION_SIZES;
        let size = (order.len() / N_REGIONS).clamp(least, most);
        progress.begin("noise", order.len() as u64);
        let measure = |points: &[u32]| {
            progress.check()?;
            progress.advance(points.len() as u64);
            Ok(Region::new(tree, groups, points, steps))
        };
        let regions = order.par_chunks(size).map(measure).collect::<Result<Vec<_>>>()?;
        let count = |of: fn(&Region) -> usize| regions.iter().map(of).sum::<usize>() as f32;
        let n_samples = count(|region| region.n_samples);
        let n_known = count(|region| region.noises.len());
        let n_filled = count(|region| region.n_filled);
        let has_leaves =
            n_known <= MIN_SURFACES * n_samples && MIN_FILLED * (n_samples - n_known) <= n_filled;
        let mut noise = Self {
            centers: Vec::new(),
            noises: Vec::new(),
            of_surfaces: Vec::new(),
            has_surfaces: false,
            is_at_rest: vec![false; tree.positions().len()],
        };
        for (points, region) in order.chunks(size).zip(&regions) {
            let is_surface = region.is_known(if has_leaves { MIN_SURFACES } else { MIN_KNOWN });
            let is_slab =
                || region.variation < MAX_SLAB_VARIATION && region.is_known(MIN_KNOWN_OF_SLAB);
            if let Some(found) = region.noise().filter(|_| is_surface || is_slab()) {
                noise.centers.push(region.center);
                noise.noises.push(found);
                if is_surface {
                    noise.of_surfaces.push(found.typical);
                }
            } else if has_leaves || region.fills_space() {
                points.iter().for_each(|point| noise.is_at_rest[*point as usize] = true);
            }
        }
        noise.has_surfaces = match has_leaves {
            true => MIN_SURFACE_REGIONS * regions.len() as f32 <= noise.of_surfaces.len() as f32,
            false => MIN_KNOWN_OF_BENT * n_samples < n_known,
        };
        Ok(noise)
    }

    /// Returns the median noise over the regions of surfaces.
    pub fn median(&self) -> f32 {
        self.quantile(0.5)
    }

    /// Returns the noise that this fraction of these regions does not exceed.
    pub fn quantile(&self, fraction: f64) -> f32 {
        quantile(self.of_surfaces.iter().copied(), fraction).unwrap_or(0.0)
    }

    /// True if the cloud has surfaces, not only leaves.
    pub fn has_surfaces(&self) -> bool {
        self.has_surfaces
    }

    /// Returns the noise at a position, interpolated between the nearest regions.
    fn at(&self, centers: &KdTree, position: Vec3) -> RegionNoise {
        let (mut typical, mut other, mut reach, mut weight) = (0.0, 0.0, 0.0, 0.0);
        for region in centers.nearest(position, N_BLENDED_REGIONS, None) {
            let nearness = 1.0 / region.distance_squared.max(f32::MIN_POSITIVE.sqrt());
            let noise = self.noises[region.index as usize];
            typical += nearness * noise.typical;
            other += nearness * noise.other;
            reach += nearness * noise.reach;
            weight += nearness;
        }
        RegionNoise { typical: typical / weight, other: other / weight, reach: reach / weight }
    }

    /// Returns the noise at each point in spacings, or none where points are at rest.
    /// `groups` are those of [`Self::new`].
    pub fn at_points(
        &self,
        points: &KdTree,
        groups: &KdTree,
        progress: &dyn Progress,
    ) -> Result<Vec<Option<f32>>> {
        let centers = KdTree::new(&self.centers, progress)?;
        let noise = |(point, is_at_rest): (usize, &bool)| {
            progress.check()?;
            if *is_at_rest || self.noises.is_empty() {
                return Ok(None);
            }
            let noise = self.at(&centers, points.positions()[point]);
            if SPARSE_RATIO * noise.reach < reach_at(points, point as u32)
                && let NoiseAtPoint::Known(own) = NoiseAtPoint::new(points, groups, point as u32)
                && (own < MIN_OTHER || is_noisier(points, point, own))
            {
                return Ok(Some(own));
            }
            let is_other = noise.is_mixed() && is_noisier(points, point, noise.other);
            Ok(Some(if is_other { noise.other } else { noise.typical }))
        };
        self.is_at_rest.par_iter().enumerate().map(noise).collect()
    }
}

/// The noise of a region in spacings.
#[derive(Clone, Copy)]
struct RegionNoise {
    /// The noise of most points.
    typical: f32,
    /// The noise of those with far more; the typical one if there are none.
    other: f32,
    /// Distance from a point to the last of [`MIN_NOISE_NEIGHBORS`].
    reach: f32,
}

impl RegionNoise {
    fn is_mixed(&self) -> bool {
        OTHER_RATIO * self.typical < self.other
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
fn reach_at(tree: &KdTree, point: u32) -> f32 {
    let neighbors =
        tree.nearest(tree.positions()[point as usize], MIN_NOISE_NEIGHBORS, Some(point));
    neighbors.last().map_or(0.0, |last| last.distance_squared.sqrt())
}

/// True if a plane fits the neighbours of a point only if there are as many as a noise in spacings asks for, and the point
/// is on no other surface.
fn is_noisier(tree: &KdTree, point: usize, noise: f32) -> bool {
    let positions = tree.positions();
    let neighbors = |count| tree.nearest(positions[point], count, Some(point as u32));
    let few = neighbors(MIN_NOISE_NEIGHBORS);
    if fit_plane(positions, point, &few).variation < MAX_PLANE_VARIATION {
        return false;
    }
    let n_neighbors = (NEIGHBORS_PER_SQUARED_NOISE * noise * noise) as usize;
    let neighbors = neighbors(n_neighbors.clamp(MIN_NOISE_NEIGHBORS, MAX_UNGROUPED));
    let fit = fit_plane(positions, point, &neighbors);
    fit.variation < MAX_BENT_VARIATION && thins_out(positions, point, &neighbors, fit.normal)
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

/// Points near each other, some of which were asked for their noise.
struct Region {
    /// Mean of the points.
    center: Vec3,
    n_samples: usize,
    /// The known noises in ascending order.
    noises: Vec<f32>,
    /// Number of samples whose neighbours fill space.
    n_filled: usize,
    /// Median distance from a sample to the last of [`MIN_NOISE_NEIGHBORS`].
    reach: f32,
    /// Surface variation of the points.
    variation: f32,
}

impl Region {
    fn new(tree: &KdTree, groups: &KdTree, points: &[u32], steps: Option<&DepthSteps>) -> Self {
        let step = points.len().div_ceil(N_SAMPLES).max(1);
        let samples: Vec<NoiseAtPoint> = points
            .iter()
            .step_by(step)
            .map(|point| match NoiseAtPoint::new(tree, groups, *point) {
                NoiseAtPoint::Known(noise) => {
                    NoiseAtPoint::Known(noise.max(noise_by_steps(tree, *point, steps)))
                }
                unknown => unknown,
            })
            .collect();
        let noise = |sample: &NoiseAtPoint| match sample {
            NoiseAtPoint::Known(noise) => Some(*noise),
            _ => None,
        };
        let mut noises: Vec<f32> = samples.iter().filter_map(noise).collect();
        noises.sort_unstable_by(f32::total_cmp);
        let fills = |sample: &&NoiseAtPoint| **sample == NoiseAtPoint::FillsSpace;
        let neighbor = |point: &u32| Neighbor { index: *point, distance_squared: 0.0 };
        let others: Vec<Neighbor> = points[1..].iter().step_by(GROUP_SIZE).map(neighbor).collect();
        let sum: Vec3 = points.iter().map(|point| tree.positions()[*point as usize]).sum();
        Self {
            center: sum / points.len() as f32,
            n_samples: samples.len(),
            n_filled: samples.iter().filter(fills).count(),
            reach: median(points.iter().step_by(step).map(|point| reach_at(tree, *point)))
                .unwrap_or_default(),
            variation: fit_plane(tree.positions(), points[0] as usize, &others).variation,
            noises,
        }
    }

    /// True if the noise is known at this fraction of the samples.
    fn is_known(&self, min_fraction: f32) -> bool {
        min_fraction * self.n_samples as f32 <= self.noises.len() as f32
    }

    /// Returns the noise if any of the samples knows it.
    fn noise(&self) -> Option<RegionNoise> {
        let typical = *self.noises.get(self.noises.len() / 2)?;
        let min_other = MIN_OTHER.max(OTHER_RATIO * typical);
        let n_typical = self.noises.partition_point(|noise| *noise < min_other);
        let others = &self.noises[n_typical..];
        let other = if others.len() < MIN_OTHERS { typical } else { others[others.len() / 2] };
        Some(RegionNoise { typical, other, reach: self.reach })
    }

    fn fills_space(&self) -> bool {
        self.n_samples <= 2 * self.n_filled
    }
}

/// Returns the noise that the steps of a depth camera stand for, in spacings. They are terraces wider than the
/// neighbourhoods in which the noise is told, so that they do not count there.
fn noise_by_steps(tree: &KdTree, point: u32, steps: Option<&DepthSteps>) -> f32 {
    let Some(steps) = steps else { return 0.0 };
    let position = tree.positions()[point as usize];
    let reach = reach_at(tree, point);
    let spacing = spacing_per_reach(MIN_NOISE_NEIGHBORS as f32) * reach;
    NOISE_PER_STEP * steps.at(position) / spacing.max(f32::MIN_POSITIVE)
}

/// The noise around a point.
#[derive(Clone, Copy, PartialEq)]
enum NoiseAtPoint {
    /// The standard deviation, in spacings, from the plane through so many neighbours that a plane fits.
    Known(f32),
    /// The surface bends.
    Bent,
    /// The neighbours fill space, however many.
    FillsSpace,
}

impl NoiseAtPoint {
    /// Measures the noise around a point from its neighbours, then from groups of points around it.
    fn new(points: &KdTree, groups: &KdTree, point: u32) -> Self {
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

#[cfg(test)]
mod tests {
    //! Points of different noise on one plane.

    use super::*;
    use crate::math::{DVec3, Random};
    use crate::progress::NoProgress;

    const N_SIDE: usize = 100;

    /// Returns points of a plane with a spacing of 1 and a noise of 0.2; `height` adds to every fourth.
    fn plane(mut height: impl FnMut(&mut Random) -> f64) -> Vec<Vec3> {
        let mut random = Random::new(5, 0);
        let point = |i: usize| {
            let added = if i.is_multiple_of(4) { height(&mut random) } else { 0.0 };
            let z = added + 0.2 * random.next_gaussian();
            let [x, y] =
                [(i % N_SIDE) as f64, (i / N_SIDE) as f64].map(|at| at + random.next_f64());
            DVec3::new(x, y, z).as_vec3()
        };
        (0..N_SIDE * N_SIDE).map(point).collect()
    }

    /// Returns the fraction of the points with a noise of more than a spacing.
    fn noisy_fraction(points: &[Vec3], is_asked: impl Fn(&Vec3) -> bool) -> f64 {
        let tree = KdTree::new(points, &NoProgress).unwrap();
        let order = tree.order();
        let noise = Noise::new(&tree, &tree, &order, None, &NoProgress).unwrap();
        let noises = noise.at_points(&tree, &tree, &NoProgress).unwrap();
        let asked = points.iter().zip(noises).filter(|(point, _)| is_asked(point));
        let (n_asked, n_noisy) = asked.fold((0u32, 0usize), |(n_asked, n_noisy), (_, noise)| {
            (n_asked + 1, n_noisy + usize::from(noise.is_some_and(|noise| 1.0 < noise)))
        });
        n_noisy as f64 / f64::from(n_asked)
    }

    #[test]
    fn points_that_another_scanner_measured_farther_away_have_noise_of_their_own() {
        let points = plane(|random| 4.0 * random.next_gaussian());
        let fraction = |low: f32, high: f32| {
            noisy_fraction(&points, |point| (low..high).contains(&point.z.abs()))
        };
        let (far, near) = (fraction(3.0, 8.0), fraction(0.0, 0.5));
        assert!(0.7 < far && near < 0.5 * far, "{far} {near}");
    }

    #[test]
    fn points_of_another_sheet_have_no_more_noise() {
        let points = plane(|_| 8.0);
        let fraction = noisy_fraction(&points, |point| 4.0 < point.z);
        assert!(fraction < 0.02, "{fraction}");
    }
}
