//! The noise of a cloud: the standard deviation of points from their surface, in spacings.
//!
//! The noise is measured at some points of each region.

use super::noise_at_point::{GROUP_SIZE, LocalFit, NoiseAtPoint, reach_at};
use crate::error::Result;
use crate::math::{Vec3, median, quantile};
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::planes::fit_plane;
use crate::progress::Progress;
use rayon::prelude::*;

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
/// Maximum fraction of points at which the noise can be told in a cloud with leaves. Forests have 0.3 to 0.75.
const MAX_KNOWN_WITH_LEAVES: f32 = 0.8;
/// Minimum fraction of points whose neighbours fill space, among those at which the noise cannot be told, in a cloud with
/// leaves. Forests have 0.2 to 0.8, noisy animals with claws and horns 0.13.
const MIN_FILLED_WITH_LEAVES: f32 = 0.15;
/// Minimum fraction of points at which the noise can be told in a cloud without leaves that is denoised.
const MIN_KNOWN_WITHOUT_LEAVES: f32 = 0.7;
/// Minimum fraction of points at which the noise can be told in a region of a surface amid leaves, or of a noisy part.
const MIN_KNOWN_OF_SURFACE: f32 = 0.8;
/// Minimum fraction of points at which the noise can be told in a region near a plane amid leaves, as of the ground.
const MIN_KNOWN_OF_SLAB: f32 = 0.5;
/// Maximum surface variation of points that lie near a plane.
const MAX_SLAB_VARIATION: f32 = 0.03;
/// Minimum fraction of regions of surfaces in a cloud with leaves that is denoised, and of noisy parts in a smooth one.
const MIN_SURFACE_REGIONS: f32 = 0.1;
/// Least median noise, in spacings, of a cloud that is denoised as a whole.
const MIN_NOISE: f32 = 0.15;
/// Least noise, in spacings, of a flat part that is denoised in a cloud with less noise elsewhere. Smoother stone would lose its
/// relief.
const MIN_NOISE_OF_PART: f32 = 0.25;
/// Minimum number of points in a region of such a part: small ones of a coarse figure have features that look like noise.
const MIN_PART_SIZE: usize = 1024;
/// Number of regions over which the noise is interpolated.
const N_BLENDED_REGIONS: usize = 4;

/// The noise by regions of a cloud.
pub struct Noise {
    /// Middles of the regions whose noise is known.
    centers: Vec<Vec3>,
    /// Their noise in spacings.
    noises: Vec<RegionNoise>,
    /// Typical noise of the regions at most of whose points it can be told, and which are noisy enough to be denoised.
    of_surfaces: Vec<f32>,
    /// True if these are enough for the cloud to be denoised unasked.
    is_noisy: bool,
    /// Least typical noise of a region whose points move: above zero if only flat parts of the cloud are noisy.
    min_noise: f32,
    /// True for each point, in the order of the regions, that stays: its region fills space, is no clear surface amid leaves,
    /// or is no noisy flat part where only such parts move.
    is_at_rest: Vec<bool>,
}

impl Noise {
    /// Measures the noise. `order` lists the points so that those near each other follow each other, and `groups` are the
    /// means of each [`GROUP_SIZE`] of them. If `is_auto`, only clearly noisy flat parts move where the median noise is small.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn new(
        tree: &KdTree,
        groups: &KdTree,
        order: &[u32],
        is_auto: bool,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let [least, most] = REGION_SIZES;
        let size = (order.len() / N_REGIONS).clamp(least, most);
        progress.begin("noise", order.len() as u64);
        let measure = |points: &[u32]| {
            progress.check()?;
            progress.advance(points.len() as u64);
            Ok(Region::new(tree, groups, points))
        };
        let regions = order.par_chunks(size).map(measure).collect::<Result<Vec<_>>>()?;
        let count = |of: fn(&Region) -> usize| regions.iter().map(of).sum::<usize>() as f32;
        let n_samples = count(|region| region.n_samples);
        let n_known = count(|region| region.noises.len());
        let n_filled = count(|region| region.n_filled);
        let is_amid_leaves = n_known <= MAX_KNOWN_WITH_LEAVES * n_samples
            && MIN_FILLED_WITH_LEAVES * (n_samples - n_known) <= n_filled;
        let typical = |region: &Region| region.noise().map(|noise| noise.typical);
        let min_known = if is_amid_leaves { MIN_KNOWN_OF_SURFACE } else { MIN_KNOWN };
        let of_surfaces = regions.iter().filter(|region| region.is_known(min_known));
        let median = median(of_surfaces.filter_map(typical));
        let is_smooth = median.is_some_and(|median| median < MIN_NOISE);
        // Noisy parts amid leaves are plants.
        let is_in_parts = is_auto && is_smooth && !is_amid_leaves && MIN_PART_SIZE <= size;
        let (min_known, min_noise) = match is_in_parts {
            true => (MIN_KNOWN_OF_SURFACE, MIN_NOISE_OF_PART),
            false => (min_known, 0.0),
        };
        let mut noise = Self {
            centers: Vec::new(),
            noises: Vec::new(),
            of_surfaces: Vec::new(),
            is_noisy: false,
            min_noise,
            is_at_rest: vec![false; order.len()],
        };
        for (region, is_at_rest) in regions.iter().zip(noise.is_at_rest.chunks_mut(size)) {
            let is_surface = region.is_known(min_known) && (!is_in_parts || region.lies_near_plane);
            let is_slab =
                is_amid_leaves && region.lies_near_plane && region.is_known(MIN_KNOWN_OF_SLAB);
            if let Some(found) = region.noise().filter(|_| is_surface || is_slab) {
                noise.centers.push(region.center);
                noise.noises.push(found);
                if found.typical < min_noise {
                    is_at_rest.fill(true);
                } else if is_surface {
                    noise.of_surfaces.push(found.typical);
                }
            } else if is_amid_leaves || is_in_parts || region.fills_space() {
                is_at_rest.fill(true);
            }
        }
        let n_surfaces = noise.of_surfaces.len() as f32;
        noise.is_noisy = if is_in_parts || is_amid_leaves && !is_smooth {
            (MIN_SURFACE_REGIONS * regions.len() as f32).max(1.0) <= n_surfaces
        } else {
            !is_smooth && MIN_KNOWN_WITHOUT_LEAVES * n_samples < n_known
        };
        Ok(noise)
    }

    /// Returns the median noise over the regions of surfaces that are noisy enough to be denoised.
    pub fn median(&self) -> f32 {
        let of_any = self.noises.iter().map(|noise| noise.typical);
        quantile(self.of_surfaces.iter().copied(), 0.5)
            .or_else(|| quantile(of_any, 0.5))
            .unwrap_or(0.0)
    }

    /// Returns the noise of the ground, which has less than most surfaces: the first quartile over the regions whose noise is
    /// known.
    pub fn of_ground(&self) -> f32 {
        quantile(self.noises.iter().map(|noise| noise.typical), 0.25).unwrap_or(0.0)
    }

    /// True if surfaces are so noisy that the cloud is denoised unasked.
    pub fn is_noisy(&self) -> bool {
        self.is_noisy
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

    /// Returns the noise at each point in spacings, or none where points are at rest. `points` and their `fits` are
    /// in the order of [`Self::new`], `groups` are those given there.
    pub fn at_points(
        &self,
        points: &KdTree,
        groups: &KdTree,
        fits: &[LocalFit],
        progress: &dyn Progress,
    ) -> Result<Vec<Option<f32>>> {
        let centers = KdTree::new(&self.centers, progress)?;
        let noise = |(point, is_at_rest): (usize, &bool)| {
            progress.check()?;
            if *is_at_rest || self.noises.is_empty() {
                return Ok(None);
            }
            let noise = self.at(&centers, points.positions()[point]);
            let own = fits[point];
            if SPARSE_RATIO * noise.reach < own.reach {
                if let NoiseAtPoint::Known(found) = NoiseAtPoint::new(points, groups, point as u32)
                    && self.min_noise <= found
                    && (found < MIN_OTHER || own.is_noisier_at(points, point, found))
                {
                    return Ok(Some(found));
                }
                if 0.0 < self.min_noise {
                    return Ok(None);
                }
            }
            let is_other = noise.is_mixed() && own.is_noisier_at(points, point, noise.other);
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
    lies_near_plane: bool,
}

impl Region {
    fn new(tree: &KdTree, groups: &KdTree, points: &[u32]) -> Self {
        let step = points.len().div_ceil(N_SAMPLES).max(1);
        let samples: Vec<NoiseAtPoint> = points
            .iter()
            .step_by(step)
            .map(|point| NoiseAtPoint::new(tree, groups, *point))
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
        let plane = fit_plane(tree.positions(), points[0] as usize, &others);
        let sum: Vec3 = points.iter().map(|point| tree.positions()[*point as usize]).sum();
        Self {
            center: sum / points.len() as f32,
            n_samples: samples.len(),
            n_filled: samples.iter().filter(fills).count(),
            reach: median(points.iter().step_by(step).map(|point| reach_at(tree, *point)))
                .unwrap_or_default(),
            lies_near_plane: plane.normal != Vec3::ZERO && plane.variation < MAX_SLAB_VARIATION,
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
        let noise = Noise::new(&tree, &tree, &order, false, &NoProgress).unwrap();
        let sorted: Vec<Vec3> = order.iter().map(|point| points[*point as usize]).collect();
        let tree = KdTree::new(&sorted, &NoProgress).unwrap();
        let fits = LocalFit::of_points(&tree, &NoProgress).unwrap();
        let noises = noise.at_points(&tree, &tree, &fits, &NoProgress).unwrap();
        let asked = sorted.iter().zip(noises).filter(|(point, _)| is_asked(point));
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
