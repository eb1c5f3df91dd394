//! Radii of points, large enough that their discs close the surface.

use crate::error::{Error, Result};
use crate::math::{Random, Vec3, median};
use crate::points::neighbors::{KdTree, Neighbor, Neighborhood, nearest_by_brute_force};
use crate::progress::Progress;
use crate::words::{counted, format_length};
use rayon::prelude::*;
use std::str::FromStr;

/// Maximum ratio of a radius to the median of its neighbours' radii. It keeps outliers from getting giant discs.
const MAX_OUTLIER_RATIO: f32 = 4.0;

/// Number of points from which one radius for all points is estimated, unless another one is asked for.
pub const DEFAULT_RADIUS_SAMPLES: usize = 100;

/// Number of points in a neighbourhood of `Radius::Median`, unless another one is asked for: a point of a surface has
/// about as many direct neighbours.
const DEFAULT_MEDIAN_POINTS: usize = 6;

/// Rank of the neighbour whose distance is the radius, unless another one is asked for: the last one whose distance
/// `Radius::Median` takes. On a square lattice it is two spacings away, so that discs overlap.
const DEFAULT_RANK: usize = 2 * DEFAULT_MEDIAN_POINTS;

/// The choice of radii.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radius {
    /// One given radius for all points, in world units.
    Fixed(f32),
    /// One radius for all points, for `n` points in a neighbourhood: the median of the distances from `samples`
    /// random points to their 2n nearest, found by brute force (Wiesmeier 2011).
    Median {
        /// Number of points in a neighbourhood.
        n: usize,
        /// Number of sampled points.
        samples: usize,
    },
    /// The distance from each point to its k-th neighbour.
    Adaptive {
        /// Rank of the neighbour, from 1.
        k: usize,
    },
    /// The distance to the k-th neighbour, or less where the surface bends: as far as a disc stays close to it.
    Curvature {
        /// Rank of the neighbour, from 1.
        k: usize,
    },
}

impl Default for Radius {
    fn default() -> Self {
        Self::Adaptive { k: DEFAULT_RANK }
    }
}

/// Statistics of estimated radii.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RadiusReport {
    /// Minimum radius.
    pub min: f32,
    /// Median radius.
    pub median: f32,
    /// Maximum radius.
    pub max: f32,
    /// Number of adaptive radii clamped to four times the median of their neighbours' radii.
    pub n_clamped: usize,
    /// Number of radii replaced by the median, or by 1, as duplicates or a single point give no distance.
    pub n_replaced: usize,
    /// True if structures have changed radii: those of lines, scattered points, and discs at gaps.
    pub follows_structure: bool,
}

/// Estimates a radius for every point. `seed` selects the sample of `Radius::Median`.
///
/// # Errors
///
/// Returns [`Error::Setting`] for a radius out of range, [`Error::EmptyCloud`] if there are no points to sample,
/// [`Error::TooManyPoints`] beyond 32-bit indices, and [`Error::Cancelled`] if `progress` is cancelled.
pub(crate) fn estimate_radii(
    positions: &[Vec3],
    radius: Radius,
    seed: u64,
    progress: &dyn Progress,
) -> Result<(Vec<f32>, RadiusReport)> {
    radius.check()?;
    match radius {
        Radius::Fixed(radius) => Ok(with_report(vec![radius; positions.len()])),
        Radius::Median { n, samples } => {
            let sample = DistanceSample { k: 2 * n, samples, seed };
            let median = median_distance(positions, &sample, progress)?;
            Ok(with_report(vec![median; positions.len()]))
        }
        Radius::Adaptive { k } | Radius::Curvature { k } => {
            let tree = KdTree::new(positions, progress)?;
            let distance = |_: usize, neighbors: &[Neighbor]| kth_distance(neighbors, k);
            let distances = tree.map(Neighborhood::Nearest(k), progress, distance)?;
            clamp_outlier_radii(&tree, k, distances, progress)
        }
    }
}

impl Radius {
    /// Returns the rank of the neighbour whose distance is the radius, if radii differ.
    pub(crate) fn rank(self) -> Option<usize> {
        match self {
            Self::Adaptive { k } | Self::Curvature { k } => Some(k),
            _ => None,
        }
    }

    /// Checks the values.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a value out of range, as [`prepare`](crate::points::prepare) does.
    pub fn check(self) -> Result<()> {
        let (good, found) = match self {
            Self::Fixed(radius) => (0.0 < radius && radius < f32::INFINITY, radius.to_string()),
            Self::Median { n, samples } => {
                let is_count = |count: usize| (1..1 << 20).contains(&count);
                // The neighbours of all samples are in memory at once.
                let is_small = n.saturating_mul(samples) <= 1 << 26;
                let good = is_count(n) && is_count(samples) && is_small;
                (good, format!("median:{n} of {samples} samples"))
            }
            Self::Adaptive { k } => ((1..1 << 20).contains(&k), format!("adaptive:{k}")),
            Self::Curvature { k } => ((1..1 << 20).contains(&k), format!("curvature:{k}")),
        };
        let expected = "positive and finite, counts from 1 to a million, at most 67 million neighbours of all samples";
        if good { Ok(()) } else { Err(Error::Setting { name: "radius", found, expected }) }
    }
}

/// Returns the distance to the k-th or else the last neighbour, or zero without neighbours.
pub(crate) fn kth_distance(neighbors: &[Neighbor], k: usize) -> f32 {
    let kth = neighbors.get(k - 1).or(neighbors.last());
    kth.map_or(0.0, |neighbor| neighbor.distance_squared.sqrt())
}

/// Clamps the radii of outliers and replaces radii of zero.
///
/// Only radii beyond `MAX_OUTLIER_RATIO` times the median of all are compared with those of their neighbours. In a
/// scan whose spacing grows with distance, most of these stay.
pub(crate) fn clamp_outlier_radii(
    tree: &KdTree,
    k: usize,
    distances: Vec<f32>,
    progress: &dyn Progress,
) -> Result<(Vec<f32>, RadiusReport)> {
    // A sample of a million gives the median closely enough and takes little memory.
    let sample = distances.iter().copied().step_by((distances.len() >> 20) + 1);
    let typical = median(sample.filter(|r| is_valid_radius(*r)));
    let typical = typical.unwrap_or(1.0);
    let clamped = |(point, &distance): (usize, &f32)| {
        progress.check()?;
        if !is_valid_radius(distance) {
            return Ok((typical, Repair::Replaced));
        }
        if distance <= MAX_OUTLIER_RATIO * typical {
            return Ok((distance, Repair::None));
        }
        let neighbors = tree.nearest(tree.positions()[point], k, Some(point as u32));
        let around = neighbors.iter().map(|neighbor| distances[neighbor.index as usize]);
        let limit =
            MAX_OUTLIER_RATIO * median(around.filter(|r| is_valid_radius(*r))).unwrap_or(typical);
        let repair = if limit < distance { Repair::Clamped } else { Repair::None };
        Ok((distance.min(limit), repair))
    };
    let radii: Vec<(f32, Repair)> =
        distances.par_iter().enumerate().map(clamped).collect::<Result<_>>()?;
    let count = |repair| radii.iter().filter(|(_, found)| *found == repair).count();
    let (n_clamped, n_replaced) = (count(Repair::Clamped), count(Repair::Replaced));
    let (radii, report) = with_report(radii.into_iter().map(|(radius, _)| radius).collect());
    let report = RadiusReport { n_clamped, n_replaced, ..report };
    for line in report.lines() {
        progress.note(&line);
    }
    Ok((radii, report))
}

#[derive(Clone, Copy, PartialEq)]
enum Repair {
    None,
    Clamped,
    Replaced,
}

impl RadiusReport {
    /// Returns a line about the radii for the user.
    pub fn line(&self, radius: Radius) -> String {
        let [min, median, max] = [self.min, self.median, self.max].map(format_length);
        let by_structure =
            if self.follows_structure { ", other radii at lines, leaves and gaps" } else { "" };
        match radius {
            Radius::Fixed(_) => format!("radius {median}, as given"),
            Radius::Median { n, .. } => {
                format!("radius {median}, the median distance to the {} nearest points", 2 * n)
            }
            Radius::Adaptive { k } => format!(
                "radii {min} to {max}, median {median}: the distance to the {} neighbour{by_structure}",
                ordinal(k)
            ),
            Radius::Curvature { k } => format!(
                "radii {min} to {max}, median {median}: the distance to the {} neighbour, less where the surface \
                 bends{by_structure}",
                ordinal(k)
            ),
        }
    }

    /// Recomputes the statistics of radii that have changed.
    pub(crate) fn update(&mut self, radii: &[f32]) {
        let (_, Self { min, median, max, .. }) = with_report(radii.to_vec());
        *self = Self { min, median, max, ..*self };
    }

    fn lines(&self) -> Vec<String> {
        let clamped = format!(
            "{} far from all others: radii limited to {MAX_OUTLIER_RATIO} times those of the nearest points",
            counted(self.n_clamped, "point")
        );
        let replaced = format!(
            "zero radii of {} set to {}",
            counted(self.n_replaced, "point"),
            format_length(self.median)
        );
        let lines = [(self.n_clamped, clamped), (self.n_replaced, replaced)];
        lines.into_iter().filter(|(count, _)| 0 < *count).map(|(_, line)| line).collect()
    }
}

fn with_report(radii: Vec<f32>) -> (Vec<f32>, RadiusReport) {
    let min = radii.iter().copied().reduce(f32::min).unwrap_or(0.0);
    let max = radii.iter().copied().reduce(f32::max).unwrap_or(0.0);
    let median = if min == max { Some(max) } else { median(radii.iter().copied()) };
    let median = median.unwrap_or(0.0);
    (radii, RadiusReport { min, median, max, ..RadiusReport::default() })
}

/// Formats an ordinal number, as 1st, 2nd, 3rd, 4th, 11th or 21st.
fn ordinal(n: usize) -> String {
    let ending = match (n % 10, n % 100) {
        (1, last_two) if last_two != 11 => "st",
        (2, last_two) if last_two != 12 => "nd",
        (3, last_two) if last_two != 13 => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

fn is_valid_radius(radius: f32) -> bool {
    0.0 < radius && radius < f32::INFINITY
}

/// A sample of distances between points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DistanceSample {
    /// Number of nearest points of each sampled point.
    pub k: usize,
    /// Number of sampled points.
    pub samples: usize,
    /// Seed that selects the sampled points.
    pub seed: u64,
}

/// Returns the median of the distances from random points to their k nearest, found by brute force, or 1 if all are
/// zero.
///
/// # Errors
///
/// Returns [`Error::EmptyCloud`] without points and [`Error::Cancelled`] if `progress` is cancelled.
pub(crate) fn median_distance(
    positions: &[Vec3],
    sample: &DistanceSample,
    progress: &dyn Progress,
) -> Result<f32> {
    let points = sample_points(positions.len(), sample.samples, sample.seed)?;
    let distances = |&point: &usize| {
        progress.check()?;
        Ok(nearest_by_brute_force(positions, point, sample.k))
    };
    let distances = points.par_iter().map(distances).collect::<Result<Vec<_>>>()?;
    let lengths = distances.into_iter().flatten().map(|found| found.distance_squared.sqrt());
    Ok(median(lengths.filter(|d| is_valid_radius(*d))).unwrap_or(1.0))
}

/// Estimates the mean distance between neighbouring points on the surface that they sample: the median over a
/// thousand random points of rho = 2 sqrt(d_k^2 / k), k = 16 (ALGORITHMS.md A1).
///
/// # Errors
///
/// Returns [`Error::EmptyCloud`] without points, [`Error::TooManyPoints`] beyond 32-bit indices, and
/// [`Error::Cancelled`] if `progress` is cancelled.
pub fn spacing(positions: &[Vec3], progress: &dyn Progress) -> Result<f32> {
    let k = 16;
    let tree = KdTree::new(positions, progress)?;
    let spacings = sample_points(positions.len(), 1000, 0)?.into_iter().filter_map(|point| {
        let neighbors = tree.nearest(positions[point], k, Some(point as u32));
        let last = neighbors.last()?;
        Some(2.0 * (last.distance_squared / neighbors.len() as f32).sqrt())
    });
    Ok(median(spacings.filter(|s| is_valid_radius(*s))).unwrap_or(0.0))
}

/// Returns the indices of random points, or of all points if there are no more than `samples`.
fn sample_points(n_points: usize, samples: usize, seed: u64) -> Result<Vec<usize>> {
    if n_points == 0 {
        return Err(Error::EmptyCloud);
    }
    if n_points <= samples {
        return Ok((0..n_points).collect());
    }
    let mut random = Random::new(seed, 0);
    Ok((0..samples).map(|_| random.below(n_points as u64) as usize).collect())
}

impl FromStr for Radius {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, number) = text.split_once(':').unwrap_or((text, ""));
        let count = |default| if number.is_empty() { Some(default) } else { number.parse().ok() };
        let radius = match name {
            "auto" if number.is_empty() => Some(Self::default()),
            "adaptive" => count(DEFAULT_RANK).map(|k| Self::Adaptive { k }),
            "curvature" => count(DEFAULT_RANK).map(|k| Self::Curvature { k }),
            "median" => parse_median(number),
            _ => text.parse().ok().map(Self::Fixed),
        };
        let radius = radius.filter(|radius| radius.check().is_ok());
        radius.ok_or_else(|| Error::Setting {
            name: "radius",
            found: text.to_owned(),
            expected: "auto, adaptive[:K], curvature[:K], median[:N[,C]] or a positive number in world units",
        })
    }
}

/// Parses the number of points in a neighbourhood and that of samples, both of which may be missing.
fn parse_median(text: &str) -> Option<Radius> {
    let (n, samples) = match text.split_once(',') {
        Some((n, samples)) => (n, samples.parse().ok()?),
        None => (text, DEFAULT_RADIUS_SAMPLES),
    };
    let n = if text.is_empty() { DEFAULT_MEDIAN_POINTS } else { n.parse().ok()? };
    Some(Radius::Median { n, samples })
}

#[cfg(test)]
mod tests {
    //! Radii of known clouds.

    use super::*;
    use crate::progress::NoProgress;

    fn lattice(side: usize) -> Vec<Vec3> {
        (0..side * side).map(|i| Vec3::new((i % side) as f32, (i / side) as f32, 0.0)).collect()
    }

    fn radii(positions: &[Vec3], radius: Radius) -> (Vec<f32>, RadiusReport) {
        estimate_radii(positions, radius, 1, &NoProgress).unwrap()
    }

    #[test]
    fn a_lattice_has_known_radii() {
        let positions = lattice(60);
        let (adaptive, report) = radii(&positions, Radius::Adaptive { k: 12 });
        assert_eq!(adaptive[60 * 30 + 30], 2.0);
        assert_eq!((report.min, report.median, report.n_clamped), (2.0, 2.0, 0));
        // The 12 nearest lie at 1 (4), sqrt 2 (4) and 2 (4).
        let (median, report) = radii(&positions, Radius::Median { n: 6, samples: 100 });
        assert_eq!((median[7], report.min), (2f32.sqrt(), report.max));
        assert_eq!(radii(&positions, Radius::Fixed(3.5)).0[5], 3.5);
    }

    #[test]
    fn spacing_of_a_random_plane_follows_from_its_density() {
        let mut random = Random::new(2, 0);
        let positions: Vec<Vec3> =
            (0..10_000).map(|_| Vec3::new(random.next_f32(), random.next_f32(), 0.0)).collect();
        let spacing = spacing(&positions, &NoProgress).unwrap();
        // One point to each (1/100)^2; k points fill pi d^2, so that the estimate is 2 / sqrt(pi) of it.
        assert!((spacing - 0.0113).abs() < 0.001, "{spacing}");
    }

    #[test]
    fn the_radius_of_an_outlier_is_clamped() {
        let mut positions = lattice(60);
        positions.push(Vec3::new(30.0, 30.0, 500.0));
        let (radii, report) = radii(&positions, Radius::default());
        assert_eq!(report.n_clamped, 1);
        assert!(radii[3600] <= 4.0 * 2.0 + 1e-3, "{}", radii[3600]);
        assert!(report.max <= 8.0);
    }

    #[test]
    fn a_sparse_half_keeps_its_large_radii() {
        let mut positions = lattice(60);
        positions.extend(lattice(15).into_iter().map(|p| 20.0 * p + Vec3::new(300.0, 0.0, 0.0)));
        let (radii, report) = radii(&positions, Radius::default());
        assert_eq!(report.n_clamped, 0);
        assert_eq!(radii[3600 + 15 * 7 + 7], 40.0);
    }

    #[test]
    fn radii_of_zero_are_replaced() {
        for positions in [vec![Vec3::ONE], vec![Vec3::ONE; 30], vec![Vec3::ONE; 2]] {
            for radius in [Radius::default(), Radius::Median { n: 6, samples: 100 }] {
                let (radii, _) = radii(&positions, radius);
                assert!(radii.iter().all(|&radius| radius == 1.0));
            }
            spacing(&positions, &NoProgress).unwrap();
        }
        let (radii, report) = radii(&[Vec3::ZERO, Vec3::X * 3.0], Radius::default());
        assert_eq!((radii, report.n_replaced), (vec![3.0; 2], 0));
        assert_eq!(spacing(&[], &NoProgress), Err(Error::EmptyCloud));
    }

    #[test]
    fn lengths_have_three_digits() {
        let report = RadiusReport {
            min: 0.459_123,
            median: 0.701_4,
            max: 7.628_9,
            ..RadiusReport::default()
        };
        let line = report.line(Radius::Adaptive { k: 12 });
        assert_eq!(line, "radii 0.459 to 7.63, median 0.701: the distance to the 12th neighbour");
        let of_shapes = RadiusReport { follows_structure: true, ..report };
        let line = of_shapes.line(Radius::Adaptive { k: 12 });
        assert!(line.ends_with("12th neighbour, other radii at lines, leaves and gaps"), "{line}");
        assert_eq!([1, 2, 3, 11, 22].map(ordinal), ["1st", "2nd", "3rd", "11th", "22nd"]);
    }

    #[test]
    fn radii_are_parsed() {
        assert_eq!("auto".parse::<Radius>().unwrap(), Radius::Adaptive { k: 12 });
        assert_eq!("adaptive:20".parse::<Radius>().unwrap(), Radius::Adaptive { k: 20 });
        assert_eq!("median:4".parse::<Radius>().unwrap(), Radius::Median { n: 4, samples: 100 });
        assert_eq!("median:6,9".parse::<Radius>().unwrap(), Radius::Median { n: 6, samples: 9 });
        assert_eq!("0.25".parse::<Radius>().unwrap(), Radius::Fixed(0.25));
        for text in [
            "",
            "0",
            "-1",
            "inf",
            "adaptive:0",
            "median:x",
            "median:6,0",
            "median:6,20000000",
            "median:500000,1000",
            "median:6,",
            "auto:3",
            "mean",
        ] {
            assert!(text.parse::<Radius>().is_err(), "{text}");
        }
    }
}
