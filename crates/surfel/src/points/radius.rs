//! Radii: how far each point's piece of surface reaches so that the pieces close.

use super::neighbors::{Neighbor, Query, Tree, nearest_by_brute_force};
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
    // A million of them are enough to tell, and take no memory to speak of.
    let sample = distances.iter().copied().step_by((distances.len() >> 20) + 1);
    let typical = median(sample.filter(|r| usable(*r)).collect());
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
    /// What was chosen, for people.
    pub fn line(&self, radius: Radius) -> String {
        let [smallest, median, largest] =
            [self.smallest, self.median, self.largest].map(three_digits);
        match radius {
            Radius::Fixed(_) => format!("radius {median}, as asked"),
            Radius::Median { n, .. } => {
                format!("radius {median}, the median distance to the {} nearest points", 2 * n)
            }
            Radius::Adaptive { k } => format!(
                "radii {smallest} to {largest}, median {median}, to the {} neighbour",
                ordinal(k)
            ),
        }
    }

    fn lines(&self) -> Vec<String> {
        let cut =
            format!("{} radii of stray points cut to {STRAY} times their neighbours'", self.n_cut);
        let sizeless = format!(
            "{} radii without a size set to {}",
            self.n_without_size,
            three_digits(self.median)
        );
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

/// A length as people read it: 0.459, 7.63, 4120.
pub(super) fn three_digits(length: f32) -> String {
    if !(1e-6..1e9).contains(&length) {
        return format!("{length:.2e}");
    }
    let digits = (2 - length.log10().floor() as i32).max(0) as usize;
    format!("{length:.digits$}")
}

/// 1st, 2nd, 3rd, 4th, 11th, 21st.
fn ordinal(n: usize) -> String {
    let ending = match (n % 10, n % 100) {
        (1, last_two) if last_two != 11 => "st",
        (2, last_two) if last_two != 12 => "nd",
        (3, last_two) if last_two != 13 => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
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
    let lengths = distances.into_iter().flatten().map(|found| found.distance_squared.sqrt());
    Ok(median(lengths.filter(|d| usable(*d)).collect()).unwrap_or(1.0))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn lattice(side: usize) -> Vec<Vec3> {
        (0..side * side).map(|i| Vec3::new((i % side) as f32, (i / side) as f32, 0.0)).collect()
    }

    fn radii(positions: &[Vec3], radius: Radius) -> (Vec<f32>, RadiusReport) {
        estimate_radii(positions, radius, 1, &Silent).unwrap()
    }

    #[test]
    fn a_lattice_has_known_radii() {
        let positions = lattice(60);
        let (adaptive, report) = radii(&positions, Radius::Adaptive { k: 12 });
        assert_eq!(adaptive[60 * 30 + 30], 2.0);
        assert_eq!((report.smallest, report.median, report.n_cut), (2.0, 2.0, 0));
        // The 12 nearest lie at 1 (4), sqrt 2 (4) and 2 (4).
        let (median, report) = radii(&positions, Radius::Median { n: 6, samples: 100 });
        assert_eq!((median[7], report.smallest), (2f32.sqrt(), report.largest));
        assert_eq!(radii(&positions, Radius::Fixed(3.5)).0[5], 3.5);
    }

    #[test]
    fn spacing_of_a_random_plane_is_about_that_of_its_density() {
        let mut random = Random::new(2, 0);
        let positions: Vec<Vec3> =
            (0..10_000).map(|_| Vec3::new(random.next_f32(), random.next_f32(), 0.0)).collect();
        let spacing = spacing(&positions, &Silent).unwrap();
        // One point to each (1/100)^2; k points fill pi d^2, so that the estimate is 2 / sqrt(pi) of it.
        assert!((spacing - 0.0113).abs() < 0.001, "{spacing}");
    }

    #[test]
    fn a_stray_point_gets_no_giant_radius() {
        let mut positions = lattice(60);
        positions.push(Vec3::new(30.0, 30.0, 500.0));
        let (radii, report) = radii(&positions, Radius::default());
        assert_eq!(report.n_cut, 1);
        assert!(radii[3600] <= 4.0 * 2.0 + 1e-3, "{}", radii[3600]);
        assert!(report.largest <= 8.0);
    }

    #[test]
    fn a_sparse_half_keeps_its_wide_radii() {
        let mut positions = lattice(60);
        positions.extend(lattice(15).into_iter().map(|p| 20.0 * p + Vec3::new(300.0, 0.0, 0.0)));
        let (radii, report) = radii(&positions, Radius::default());
        assert_eq!(report.n_cut, 0);
        assert_eq!(radii[3600 + 15 * 7 + 7], 40.0);
    }

    #[test]
    fn points_without_a_size_get_one() {
        for positions in [vec![Vec3::ONE], vec![Vec3::ONE; 30], vec![Vec3::ONE; 2]] {
            for radius in [Radius::default(), Radius::Median { n: 6, samples: 100 }] {
                let (radii, _) = radii(&positions, radius);
                assert!(radii.iter().all(|&radius| radius == 1.0));
            }
            spacing(&positions, &Silent).unwrap();
        }
        let (radii, report) = radii(&[Vec3::ZERO, Vec3::X * 3.0], Radius::default());
        assert_eq!((radii, report.n_without_size), (vec![3.0; 2], 0));
        assert_eq!(spacing(&[], &Silent), Err(Error::EmptyCloud));
    }

    #[test]
    fn people_are_told_three_digits() {
        let report = RadiusReport {
            smallest: 0.459_123,
            median: 0.701_4,
            largest: 7.628_9,
            ..RadiusReport::default()
        };
        let line = report.line(Radius::Adaptive { k: 12 });
        assert_eq!(line, "radii 0.459 to 7.63, median 0.701, to the 12th neighbour");
        let lengths = [4123.4, 0.095_432_76, 1e-12].map(three_digits);
        assert_eq!(lengths, ["4123", "0.0954", "1.00e-12"]);
        assert_eq!([1, 2, 3, 11, 22].map(ordinal), ["1st", "2nd", "3rd", "11th", "22nd"]);
    }

    #[test]
    fn texts() {
        assert_eq!("auto".parse::<Radius>().unwrap(), Radius::Adaptive { k: 12 });
        assert_eq!("adaptive:20".parse::<Radius>().unwrap(), Radius::Adaptive { k: 20 });
        assert_eq!("median:4".parse::<Radius>().unwrap(), Radius::Median { n: 4, samples: 100 });
        assert_eq!("0.25".parse::<Radius>().unwrap(), Radius::Fixed(0.25));
        for text in ["", "0", "-1", "inf", "adaptive:0", "median:x", "auto:3", "mean"] {
            assert!(text.parse::<Radius>().is_err(), "{text}");
        }
    }
}
