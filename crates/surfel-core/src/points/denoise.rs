//! Moves noisy points onto the surface that their neighbours describe.
//!
//! The noise is measured in regions of the cloud: where a plane fits better the more neighbours it is fitted to, the
//! distances from it are noise, not shape. The more noise, the more neighbours take part. Normals are averaged over
//! neighbours of similar normals, which keeps edges (bilateral filter), and each point moves along its normal onto the
//! weighted mean of its neighbours' planes (after Huang et al., Edge-Aware Point Set Resampling, 2013).

use super::neighbors::{KdTree, Neighbor};
use super::normals::fit_plane;
use super::radius::format_length;
use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::progress::Progress;
use rayon::prelude::*;
use std::str::FromStr;

/// Least noise, in spacings, from which a cloud is denoised unasked.
const MIN_NOISE: f32 = 0.15;
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
/// Minimum share of them at which the noise can be told.
const MIN_KNOWN: f32 = 0.25;
/// Ratio of the third quartile of a region's noises to the median above which surfaces of different noise are mixed.
const MIXED_RATIO: f32 = 2.0;
/// Minimum share of points at which the noise can be told in a cloud of surfaces. Forests have 0.3 to 0.7.
const MIN_SURFACES: f32 = 0.8;
/// Number of regions over which the noise is interpolated.
const N_BLENDED_REGIONS: usize = 4;
/// Number of neighbours per spacing of noise: the fitted normals err by some two degrees.
const NEIGHBORS_PER_NOISE: f32 = 80.0;
/// Numbers of neighbours that take part: the least and the most.
const MIN_NEIGHBORS: f32 = 12.0;
const MAX_NEIGHBORS: f32 = 2048.0;
/// Number of neighbours from which means of groups of points stand for them.
const MIN_GROUPED: u32 = 96;
/// Number of points of a group.
const GROUP_SIZE: usize = 8;
/// Number of rounds in which normals are averaged.
const N_NORMAL_ROUNDS: usize = 2;
/// Number of times that a point moves.
const N_MOVES: usize = 2;
/// Difference of two unit normals at which the weight has fallen to 1 / e.
const NORMAL_WIDTH: f32 = 0.4;
/// Height above a neighbour's plane, in standard deviations of the noise, from which it belongs to another surface.
const MAX_HEIGHT: f32 = 6.0;

/// The choice whether points are moved onto their surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Denoise {
    /// Noisy surfaces without normals are denoised.
    #[default]
    Auto,
    /// All points are moved.
    On,
    /// All points stay where they are.
    Off,
}

impl FromStr for Denoise {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            "on" => Ok(Self::On),
            "off" => Ok(Self::Off),
            _ => Err(Error::Setting {
                name: "denoise",
                found: text.to_owned(),
                expected: "auto, on or off",
            }),
        }
    }
}

impl std::fmt::Display for Denoise {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::On => "on",
            Self::Off => "off",
        })
    }
}

/// Effect of denoising.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DenoiseReport {
    /// Median noise over the regions of surfaces: the standard deviation of points from their surface, in spacings.
    pub noise: f32,
    /// Number of points that were moved.
    pub n_moved: usize,
    /// Mean distance by which these were moved.
    pub mean_distance: f32,
}

impl DenoiseReport {
    /// Returns a line about the moved points for the user.
    pub fn line(&self) -> String {
        format!(
            "noise of {:.2} spacings: {} points moved onto their surface, by {} on average",
            self.noise,
            self.n_moved,
            format_length(self.mean_distance)
        )
    }
}

/// Moves the points onto their surface, and returns what was done; none if the points stay.
///
/// # Errors
///
/// Returns [`Error::TooManyPoints`] beyond 32-bit indices and [`Error::Cancelled`] if `progress` is cancelled.
pub fn denoise(
    positions: &mut [Vec3],
    choice: Denoise,
    progress: &dyn Progress,
) -> Result<Option<DenoiseReport>> {
    if choice == Denoise::Off {
        return Ok(None);
    }
    let tree = KdTree::new(positions, progress)?;
    let order = tree.order();
    let means = means_of_groups(positions, &order);
    let groups = KdTree::new(&means, progress)?;
    let regions = Regions::new(&tree, &groups, &order, progress)?;
    let noise = regions.median();
    let is_noisy_surface = MIN_NOISE <= noise && MIN_SURFACES < regions.known_share;
    if choice == Denoise::Auto && !is_noisy_surface {
        return Ok(None);
    }
    let counts = regions.neighbors_of_points(&tree, progress)?;
    let moved = moved(&tree, &groups, &order, &counts, progress)?;
    let distances = positions.iter().zip(&moved).map(|(from, to)| f64::from(from.distance(*to)));
    let sum: f64 = distances.sum();
    let n_moved = positions.iter().zip(&moved).filter(|(from, to)| from != to).count();
    positions.copy_from_slice(&moved);
    let mean_distance = (sum / n_moved.max(1) as f64) as f32;
    Ok(Some(DenoiseReport { noise, n_moved, mean_distance }))
}

/// The noise by regions.
struct Regions {
    /// Middles of the regions whose noise is known, and their noise in spacings.
    centers: Vec<Vec3>,
    noises: Vec<f32>,
    /// True for each point of a region that fills space, as leaves do.
    fills_space: Vec<bool>,
    /// Share of the samples whose noise is known.
    known_share: f32,
}

impl Regions {
    fn new(tree: &KdTree, groups: &KdTree, order: &[u32], progress: &dyn Progress) -> Result<Self> {
        let [least, most] = REGION_SIZES;
        let size = (order.len() / N_REGIONS).clamp(least, most);
        progress.begin("noise", order.len() as u64);
        let measure = |points: &[u32]| {
            progress.check()?;
            progress.advance(points.len() as u64);
            Ok(Region::new(tree, groups, points))
        };
        let regions = order.par_chunks(size).map(measure).collect::<Result<Vec<_>>>()?;
        let mut fills_space = vec![false; tree.positions().len()];
        let (mut centers, mut noises) = (Vec::new(), Vec::new());
        let (mut n_known, mut n_samples) = (0, 0);
        for (points, region) in order.chunks(size).zip(&regions) {
            n_known += region.noises.len();
            n_samples += region.n_samples;
            if let Some(noise) = region.noise() {
                centers.push(region.center);
                noises.push(noise);
            } else if region.fills_space() {
                points.iter().for_each(|point| fills_space[*point as usize] = true);
            }
        }
        let known_share = n_known as f32 / n_samples.max(1) as f32;
        Ok(Self { centers, noises, fills_space, known_share })
    }

    /// Returns the median noise.
    fn median(&self) -> f32 {
        let mut noises = self.noises.clone();
        noises.sort_unstable_by(f32::total_cmp);
        noises.get(noises.len() / 2).copied().unwrap_or(0.0)
    }

    /// Returns for each point how many neighbours take part in its move, zero where the noise is not known.
    fn neighbors_of_points(&self, tree: &KdTree, progress: &dyn Progress) -> Result<Vec<u32>> {
        let centers = KdTree::new(&self.centers, progress)?;
        let count = |(position, fills_space): (&Vec3, &bool)| {
            if *fills_space || self.noises.is_empty() {
                return 0;
            }
            let (mut sum, mut weight) = (0.0, 0.0);
            for region in centers.nearest(*position, N_BLENDED_REGIONS, None) {
                let nearness = 1.0 / region.distance_squared.max(f32::MIN_POSITIVE.sqrt());
                sum += nearness * self.noises[region.index as usize];
                weight += nearness;
            }
            (NEIGHBORS_PER_NOISE * sum / weight).clamp(MIN_NEIGHBORS, MAX_NEIGHBORS) as u32
        };
        Ok(tree.positions().par_iter().zip(&self.fills_space).map(count).collect())
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
        let sum: Vec3 = points.iter().map(|point| tree.positions()[*point as usize]).sum();
        Self {
            center: sum / points.len() as f32,
            n_samples: samples.len(),
            n_filled: samples.iter().filter(fills).count(),
            noises,
        }
    }

    /// Returns the noise if enough of the samples know it: the median, or the third quartile where surfaces of very
    /// different noise lie upon each other.
    fn noise(&self) -> Option<f32> {
        if (self.noises.len() as f32) < MIN_KNOWN * self.n_samples as f32 {
            return None;
        }
        let median = *self.noises.get(self.noises.len() / 2)?;
        let third_quartile = self.noises[3 * self.noises.len() / 4];
        Some(if MIXED_RATIO * median < third_quartile { third_quartile } else { median })
    }

    fn fills_space(&self) -> bool {
        self.n_samples <= 2 * self.n_filled
    }
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
            let (tree, n_nearest) = match MAX_UNGROUPED < k {
                true => (groups, k / GROUP_SIZE),
                false => (points, k),
            };
            let neighbors = tree.nearest(center, n_nearest, None);
            let fit = fit_plane(
                tree.positions(),
                neighbors.first().map_or(0, |nearest| nearest.index as usize),
                neighbors.get(1..).unwrap_or_default(),
            );
            if neighbors.len() < n_nearest || fit.normal == Vec3::ZERO {
                return Self::Bent;
            }
            let variation = fit.variation;
            if variation < MAX_PLANE_VARIATION {
                return Self::of_plane(variation, k);
            }
            if MAX_BEND_RATIO * last_variation < variation {
                if has_fallen && last_variation < MAX_BENT_VARIATION {
                    return Self::of_plane(last_variation, k / 2);
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

    /// Returns the noise by the surface variation of `k` neighbours.
    fn of_plane(variation: f32, k: usize) -> Self {
        // The points of a round, even neighbourhood of radius r have a variance of r^2 / 4 along both axes.
        let per_radius = (0.5 * variation / (1.0 - variation)).sqrt();
        Self::Known(per_radius * ((k + 1) as f32 / std::f32::consts::PI).sqrt())
    }
}

/// Returns the means of groups of points that follow each other in `order`.
fn means_of_groups(positions: &[Vec3], order: &[u32]) -> Vec<Vec3> {
    let mean = |group: &[u32]| {
        let sum: Vec3 = group.iter().map(|point| positions[*point as usize]).sum();
        sum / group.len() as f32
    };
    order.par_chunks(GROUP_SIZE).map(mean).collect()
}

/// Returns the points moved onto their surface. `groups` are the means of groups of points in `order`, and `counts` the
/// numbers of neighbours that take part, zero for points that stay.
fn moved(
    tree: &KdTree,
    groups: &KdTree,
    order: &[u32],
    counts: &[u32],
    progress: &dyn Progress,
) -> Result<Vec<Vec3>> {
    let positions = tree.positions();
    let of_group = |group: &[u32]| {
        let most = group.iter().map(|point| counts[*point as usize]).max().unwrap_or(0);
        // Groups beside those that are used take part in the normals of these.
        if 2 * most < MIN_GROUPED { 0 } else { most.div_ceil(GROUP_SIZE as u32) }
    };
    let counts_of_groups = order.par_chunks(GROUP_SIZE).map(of_group).collect();
    let counts_of_points = counts.iter().map(|count| (*count).min(MIN_GROUPED)).collect();
    let points = Layer::new(tree, counts_of_points, progress)?;
    let groups = Layer::new(groups, counts_of_groups, progress)?;
    progress.begin("denoise", positions.len() as u64);
    let moved = |(point, position): (usize, &Vec3)| {
        progress.check()?;
        progress.advance(1);
        let count = counts[point];
        Ok(match count {
            0 => *position,
            _ if count < MIN_GROUPED => points.moved(*position, count, 1.0),
            _ => groups.moved(*position, count.div_ceil(GROUP_SIZE as u32), GROUP_SIZE as f32),
        })
    };
    positions.par_iter().enumerate().map(moved).collect()
}

/// Points, or means of points, with normals that are averaged over neighbours of similar normals.
struct Layer<'a> {
    tree: &'a KdTree<'a>,
    /// Number of neighbours that take part in the normal of each point.
    counts: Vec<u32>,
    /// Unit normals of either sign, zero if unknown.
    normals: Vec<Vec3>,
}

impl<'a> Layer<'a> {
    fn new(tree: &'a KdTree<'a>, counts: Vec<u32>, progress: &dyn Progress) -> Result<Self> {
        let positions = tree.positions();
        let normal = |(point, count): (usize, &u32)| {
            progress.check()?;
            let neighbors = tree.nearest(positions[point], *count as usize, Some(point as u32));
            Ok(fit_plane(positions, point, &neighbors).normal)
        };
        let normals = counts.par_iter().enumerate().map(normal).collect::<Result<_>>()?;
        let mut layer = Self { tree, counts, normals };
        for _ in 0..N_NORMAL_ROUNDS {
            layer.normals = layer.averaged_normals(progress)?;
        }
        Ok(layer)
    }

    fn averaged_normals(&self, progress: &dyn Progress) -> Result<Vec<Vec3>> {
        let averaged = |(point, position): (usize, &Vec3)| {
            progress.check()?;
            let normal = self.normals[point];
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

    /// Returns a position moved onto the surface along the normal of the nearest point. Each neighbour stands for
    /// `group_size` points.
    fn moved(&self, position: Vec3, count: u32, group_size: f32) -> Vec3 {
        let neighbors = self.neighbors(position, count);
        let Some(nearest) = neighbors.points.first() else { return position };
        let normal = self.normals[nearest.index as usize];
        let n_points = group_size * count as f32;
        let noise = n_points / NEIGHBORS_PER_NOISE * (std::f32::consts::PI / n_points).sqrt();
        let max_height = MAX_HEIGHT * MAX_HEIGHT * noise * noise;
        let mut moved = position;
        for _ in 0..N_MOVES {
            let (mut sum, mut weight) = (0.0, 0.0);
            for neighbor in &neighbors.points {
                let offset = moved - self.tree.positions()[neighbor.index as usize];
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
                moved -= normal * (sum / weight);
            }
        }
        moved
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

#[cfg(test)]
mod tests {
    //! Noise that is known, and points that must stay.

    use super::*;
    use crate::math::Random;
    use crate::progress::NoProgress;

    /// Returns points of a grid in the plane z = 0 with a spacing of 1, moved by noise along each axis.
    fn noisy_plane(noise: f64) -> Vec<Vec3> {
        let mut random = Random::new(1, 0);
        let mut offset = || (noise * random.next_gaussian()) as f32;
        let grid = (0..10_000).map(|i| Vec3::new((i % 100) as f32, (i / 100) as f32, 0.0));
        grid.map(|point| point + Vec3::new(offset(), offset(), offset())).collect()
    }

    /// Returns the root mean square height over z = 0 of the points away from the border.
    fn roughness(points: &[Vec3]) -> f32 {
        let is_inside =
            |point: &&Vec3| (10.0..90.0).contains(&point.x) && (10.0..90.0).contains(&point.y);
        let inside: Vec<&Vec3> = points.iter().filter(is_inside).collect();
        (inside.iter().map(|point| point.z * point.z).sum::<f32>() / inside.len() as f32).sqrt()
    }

    #[test]
    fn noise_is_measured_and_most_of_it_removed() {
        for noise in [0.3, 1.0, 2.0] {
            let mut points = noisy_plane(noise);
            let report = denoise(&mut points, Denoise::Auto, &NoProgress).unwrap().unwrap();
            let measured = report.noise / noise as f32;
            assert!((0.7..1.3).contains(&measured), "{noise}: {report:?}");
            assert_eq!(report.n_moved, points.len());
            let left = roughness(&points) / noise as f32;
            assert!(left < 0.4, "{noise}: {left} of it is left");
        }
    }

    #[test]
    fn a_sphere_keeps_its_radius() {
        let mut random = Random::new(2, 0);
        // A spacing of 1.
        let radius = (10_000.0 / (4.0 * std::f32::consts::PI)).sqrt();
        let mut gaussian = || random.next_gaussian() as f32;
        let mut points: Vec<Vec3> = (0..10_000)
            .map(|_| {
                let direction = Vec3::new(gaussian(), gaussian(), gaussian()).normalize();
                (radius + 0.3 * gaussian()) * direction
            })
            .collect();
        denoise(&mut points, Denoise::On, &NoProgress).unwrap().unwrap();
        let mean = points.iter().map(|point| point.length()).sum::<f32>() / points.len() as f32;
        assert!((mean - radius).abs() < 0.03, "{mean} instead of {radius}");
    }

    #[test]
    fn clean_surfaces_and_clouds_that_fill_space_stay() {
        let mut random = Random::new(3, 0);
        let mut coordinate = || random.next_f32();
        let filled = (0..20_000).map(|_| Vec3::new(coordinate(), coordinate(), coordinate()));
        for points in [noisy_plane(0.05), filled.collect()] {
            let mut moved = points.clone();
            assert_eq!(denoise(&mut moved, Denoise::Auto, &NoProgress).unwrap(), None);
            assert_eq!(moved, points);
        }
    }

    #[test]
    fn few_equal_and_collinear_points_stay() {
        let line = (0..100).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect();
        let few = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        for points in [Vec::new(), vec![Vec3::ONE], vec![Vec3::ONE; 1000], line, few] {
            let mut moved = points.clone();
            let report = denoise(&mut moved, Denoise::On, &NoProgress).unwrap().unwrap();
            assert_eq!((report.n_moved, &moved), (0, &points));
        }
    }

    #[test]
    fn choices_are_written_as_they_are_read() {
        for choice in [Denoise::Auto, Denoise::On, Denoise::Off] {
            assert_eq!(choice.to_string().parse::<Denoise>().unwrap(), choice);
        }
        let error = "yes".parse::<Denoise>().unwrap_err().to_string();
        assert!(error.contains("auto, on or off"), "{error}");
    }
}
