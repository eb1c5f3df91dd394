//! Radii: how far each point's piece of surface reaches so that the pieces close.

use super::neighbors::{Neighbor, Query, Tree};
use crate::error::{Error, Result};
use crate::math::{Random, Vec3};
use crate::progress::Progress;
use rayon::prelude::*;
use std::str::FromStr;

/// A radius may be this many times the median of its neighbours' radii: a stray point gets no giant disc.
const STRAY: f32 = 4.0;

/// How radii are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radius {
    /// One for all, by hand, in world units.
    Fixed(f32),
    /// One for all, for `n` points in a neighbourhood: the median of the distances from `samples`
    /// random points to their 2n nearest, found by brute force (Wiesmeier 2011).
    Median { n: usize, samples: usize },
    /// The distance from each point to its k-th neighbour.
    Adaptive { k: usize },
}

impl Default for Radius {
    fn default() -> Self {
        Self::Adaptive { k: 12 }
    }
}

/// How radii came out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RadiusReport {
    pub smallest: f32,
    pub median: f32,
    pub largest: f32,
    /// Adaptive radii cut to four times the median of their neighbours' radii.
    pub n_cut: usize,
    /// Radii that duplicates or a lone point left without a size; they got the median, or 1.
    pub n_without_size: usize,
}

/// A radius for every point; `seed` picks the sample of `Radius::Median`.
pub fn estimate_radii(
    positions: &[Vec3],
    radius: Radius,
    seed: u64,
    progress: &dyn Progress,
) -> Result<(Vec<f32>, RadiusReport)> {
    radius.check()?;
    match radius {
        Radius::Fixed(radius) => Ok(with_report(vec![radius; positions.len()])),
        Radius::Median { n, samples } => {
            let sample = Sample { k: 2 * n, samples, seed };
            let median = median_distance(positions, &sample, progress)?;
            progress.note(&format!("radius {median}, the median distance to {} nearest", 2 * n));
            Ok(with_report(vec![median; positions.len()]))
        }
        Radius::Adaptive { k } => {
            let tree = Tree::new(positions, progress)?;
            let reach = |_: usize, neighbors: &[Neighbor]| kth_distance(neighbors, k);
            let distances = tree.map(Query::Nearest(k), progress, reach)?;
            limit_strays(&tree, k, distances, progress)
        }
    }
}

impl Radius {
    /// The error that `estimate_radii` would give for a value out of range.
    pub fn check(self) -> Result<()> {
        let (good, found) = match self {
            Self::Fixed(radius) => (0.0 < radius && radius < f32::INFINITY, radius.to_string()),
            Self::Median { n, samples } => {
                (0 < n && 0 < samples && n < 1 << 20, format!("median:{n} of {samples} samples"))
            }
            Self::Adaptive { k } => ((1..1 << 20).contains(&k), format!("adaptive:{k}")),
        };
        let expected = "positive and finite, counts from 1 to a million";
        if good { Ok(()) } else { Err(Error::Setting { name: "radius", found, expected }) }
    }
}

/// Distance to the k-th neighbour, or the last one there is; zero without neighbours.
pub(super) fn kth_distance(neighbors: &[Neighbor], k: usize) -> f32 {
    let kth = neighbors.get(k - 1).or(neighbors.last());
    kth.map_or(0.0, |neighbor| neighbor.distance_squared.sqrt())
}

/// Cuts the radii of stray points and replaces those without a size.
///
/// Only radii beyond the limit about the median of all are looked at again, with their neighbours': on
/// a scan whose spacing grows with distance most of those are in order and stay.
pub(super) fn limit_strays(
    tree: &Tree,
    k: usize,
    distances: Vec<f32>,
    progress: &dyn Progress,
) -> Result<(Vec<f32>, RadiusReport)> {
    let typical = median(distances.iter().copied().filter(|r| usable(*r)).collect());
    let typical = typical.unwrap_or(1.0);
    let limited = |(point, &distance): (usize, &f32)| {
        progress.check()?;
        if !usable(distance) {
            return Ok((typical, Repair::WithoutSize));
        }
        if distance <= STRAY * typical {
            return Ok((distance, Repair::None));
        }
        let neighbors = tree.nearest(tree.positions()[point], k, Some(point as u32));
        let around = neighbors.iter().map(|neighbor| distances[neighbor.index as usize]);
        let limit = STRAY * median(around.filter(|r| usable(*r)).collect()).unwrap_or(typical);
        let repair = if limit < distance { Repair::Cut } else { Repair::None };
        Ok((distance.min(limit), repair))
    };
    let radii: Vec<(f32, Repair)> =
        distances.par_iter().enumerate().map(limited).collect::<Result<_>>()?;
    let count = |repair| radii.iter().filter(|(_, found)| *found == repair).count();
    let (n_cut, n_without_size) = (count(Repair::Cut), count(Repair::WithoutSize));
    let (radii, report) = with_report(radii.into_iter().map(|(radius, _)| radius).collect());
    let report = RadiusReport { n_cut, n_without_size, ..report };
    for line in report.lines() {
        progress.note(&line);
    }
    Ok((radii, report))
}

#[derive(Clone, Copy, PartialEq)]
enum Repair {
    None,
    Cut,
    WithoutSize,
}

impl RadiusReport {
    fn lines(&self) -> Vec<String> {
        let cut =
            format!("{} radii of stray points cut to {STRAY} times their neighbours'", self.n_cut);
        let sizeless =
            format!("{} radii without a size set to {}", self.n_without_size, self.median);
        let lines = [(self.n_cut, cut), (self.n_without_size, sizeless)];
        lines.into_iter().filter(|(count, _)| 0 < *count).map(|(_, line)| line).collect()
    }
}

fn with_report(radii: Vec<f32>) -> (Vec<f32>, RadiusReport) {
    let smallest = radii.iter().copied().reduce(f32::min).unwrap_or(0.0);
    let largest = radii.iter().copied().reduce(f32::max).unwrap_or(0.0);
    let middle = if smallest == largest { Some(largest) } else { median(radii.clone()) };
    let median = middle.unwrap_or(0.0);
    (radii, RadiusReport { smallest, median, largest, ..RadiusReport::default() })
}

fn usable(radius: f32) -> bool {
    0.0 < radius && radius < f32::INFINITY
}

/// Which distances a median is taken of.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Nearest points of each sampled one.
    pub k: usize,
    pub samples: usize,
    pub seed: u64,
}

/// Median of the distances from random points to their k nearest, by brute force.
pub fn median_distance(
    positions: &[Vec3],
    sample: &Sample,
    progress: &dyn Progress,
) -> Result<f32> {
    let points = pick(positions.len(), sample.samples, sample.seed)?;
    let distances = |&point: &usize| {
        progress.check()?;
        Ok(nearest_by_brute_force(positions, point, sample.k))
    };
    let distances = points.par_iter().map(distances).collect::<Result<Vec<_>>>()?;
    let lengths = distances.into_iter().flatten().map(f32::sqrt).filter(|d| usable(*d));
    Ok(median(lengths.collect()).unwrap_or(1.0))
}

/// Mean distance between points on the surface that they sample: rho = 2 sqrt(d_k^2 / k), k = 16, of
/// which a thousand random points give the median (ALGORITHMS.md A1).
pub fn spacing(positions: &[Vec3], progress: &dyn Progress) -> Result<f32> {
    let k = 16;
    let tree = Tree::new(positions, progress)?;
    let spacings = pick(positions.len(), 1000, 0)?.into_iter().filter_map(|point| {
        let neighbors = tree.nearest(positions[point], k, Some(point as u32));
        let last = neighbors.last()?;
        Some(2.0 * (last.distance_squared / neighbors.len() as f32).sqrt())
    });
    Ok(median(spacings.filter(|s| usable(*s)).collect()).unwrap_or(0.0))
}

/// Random points; all, if no more are there than asked for.
fn pick(n_points: usize, samples: usize, seed: u64) -> Result<Vec<usize>> {
    if n_points == 0 {
        return Err(Error::EmptyCloud);
    }
    if n_points <= samples {
        return Ok((0..n_points).collect());
    }
    let mut random = Random::new(seed, 0);
    Ok((0..samples).map(|_| random.below(n_points as u64) as usize).collect())
}

/// Squared distances to the k nearest other points, in no order.
fn nearest_by_brute_force(positions: &[Vec3], point: usize, k: usize) -> Vec<f32> {
    let mut nearest: Vec<f32> = Vec::with_capacity(2 * k);
    let mut bound = f32::INFINITY;
    for (other, position) in positions.iter().enumerate() {
        let squared = position.distance_squared(positions[point]);
        if squared < bound && other != point {
            nearest.push(squared);
            if nearest.len() == 2 * k {
                bound = *nearest.select_nth_unstable_by(k - 1, f32::total_cmp).1;
                nearest.truncate(k);
            }
        }
    }
    nearest.sort_unstable_by(f32::total_cmp);
    nearest.truncate(k);
    nearest
}

fn median(mut values: Vec<f32>) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

impl FromStr for Radius {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, number) = text.split_once(':').unwrap_or((text, ""));
        let count = |default| if number.is_empty() { Some(default) } else { number.parse().ok() };
        let radius = match name {
            "auto" if number.is_empty() => Some(Self::default()),
            "adaptive" => count(12).map(|k| Self::Adaptive { k }),
            "median" => count(6).map(|n| Self::Median { n, samples: 100 }),
            _ => text.parse().ok().map(Self::Fixed),
        };
        let radius = radius.filter(|radius| radius.check().is_ok());
        radius.ok_or_else(|| Error::Setting {
            name: "radius",
            found: text.to_owned(),
            expected: "auto, adaptive[:K], median[:N] or a positive number in world units",
        })
    }
}
