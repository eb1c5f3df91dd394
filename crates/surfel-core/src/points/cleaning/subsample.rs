//! Subsampling: keeps some points of a cloud, in the order of the file and reproducibly.

use crate::error::{Error, Result};
use crate::math::{Random, Vec3, hash};
use crate::points::PointCloud;
use crate::progress::Progress;
use crate::words::counted;
use std::collections::HashMap;
use std::str::FromStr;

/// The points of a cloud to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Subsample {
    /// The first points, up to this number.
    First(usize),
    /// Every s-th point: those with index floor(i * s), for real s of at least 1.
    Stride(f64),
    /// This number of random points; each set of them is equally likely.
    Random(usize),
    /// A maximal set of points at least this far apart, chosen greedily in the order of the file.
    Spacing(f32),
}

/// Returns the kept points with all their columns. `seed` decides the points of `Subsample::Random`.
///
/// # Errors
///
/// Returns [`Error::Setting`] for a value out of range and [`Error::Cancelled`] if `progress` is cancelled.
pub fn subsample(
    cloud: &PointCloud,
    subsample: Subsample,
    seed: u64,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    subsample.check()?;
    let n_points = cloud.len();
    let indices = match subsample {
        Subsample::First(count) => (0..count.min(n_points) as u32).collect(),
        Subsample::Stride(stride) => indices_by_stride(n_points, stride),
        Subsample::Random(count) => random_indices(n_points, count, seed),
        Subsample::Spacing(distance) => indices_by_spacing(&cloud.positions, distance, progress)?,
    };
    progress.note(&format!("{subsample} kept {} of {}", indices.len(), counted(n_points, "point")));
    Ok(cloud.subset(&indices))
}

impl Subsample {
    fn check(self) -> Result<()> {
        let (good, expected) = match self {
            Self::First(_) | Self::Random(_) => (true, ""),
            Self::Stride(stride) => (1.0 <= stride && stride.is_finite(), "a stride of at least 1"),
            Self::Spacing(distance) => {
                (0.0 < distance && distance.is_finite(), "a positive spacing in world units")
            }
        };
        if good {
            return Ok(());
        }
        Err(Error::Setting { name: "subsample", found: self.to_string(), expected })
    }
}

fn indices_by_stride(n_points: usize, stride: f64) -> Vec<u32> {
    let multiples = (0..n_points).map(|i| (i as f64 * stride).floor());
    multiples.take_while(|&x| x < n_points as f64).map(|x| x as u32).collect()
}

/// Keeps each point in turn with the probability that gives exactly `count` points (Knuth, algorithm S).
fn random_indices(n_points: usize, count: usize, seed: u64) -> Vec<u32> {
    let mut random = Random::new(seed, 0);
    let mut n_missing = count.min(n_points) as u64;
    let mut kept = Vec::with_capacity(count.min(n_points));
    for point in 0..n_points {
        if random.below((n_points - point) as u64) < n_missing {
            kept.push(point as u32);
            n_missing -= 1;
        }
    }
    kept
}

/// Keeps points in a hashed grid. Cells are twice as wide as the spacing, so the points near any position lie in eight
/// of them.
pub(crate) fn indices_by_spacing(
    positions: &[Vec3],
    distance: f32,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    progress.begin("spacing", positions.len() as u64);
    // The index in `kept` of the last point of each cell, and of the point of the same cell before each point.
    let mut cells: HashMap<[i64; 3], usize, CellHash> = HashMap::default();
    let mut before: Vec<Option<usize>> = Vec::new();
    let mut kept: Vec<u32> = Vec::new();
    // Distances in f32 may round down; cells wider by a millionth still find such points.
    let cells_per_unit = 0.5 / (f64::from(distance) * (1.0 + 1e-6));
    for (point, &position) in positions.iter().enumerate() {
        if point % 4096 == 0 {
            progress.check()?;
            progress.advance(4096.min(positions.len() - point) as u64);
        }
        let coordinates = position.as_dvec3() * cells_per_unit;
        let own: [i64; 3] =
            std::array::from_fn(|axis| cell_along(coordinates[axis], position[axis]));
        // The neighbour cells to search lie on the side of the cell's half that the point is in.
        let side =
            (coordinates - coordinates.floor()).to_array().map(|x| if x < 0.5 { -1i64 } else { 1 });
        let is_too_close = (0..8).any(|corner| {
            let step = |axis: usize| if corner >> axis & 1 == 1 { side[axis] } else { 0 };
            let cell = std::array::from_fn(|axis| own[axis] + step(axis));
            std::iter::successors(cells.get(&cell).copied(), |kept_idx| before[*kept_idx])
                .any(|kept_idx| is_closer(positions[kept[kept_idx] as usize], position, distance))
        });
        if !is_too_close {
            before.push(cells.insert(own, kept.len()));
            kept.push(point as u32);
        }
    }
    Ok(kept)
}

/// Returns the index of a cell along an axis. Where cells are smaller than the steps between values of f32, each value has
/// a cell of its own, as the indices would not fit.
fn cell_along(coordinate: f64, value: f32) -> i64 {
    /// Coordinate from which on at least 2^28 cells lie between two values of f32. Indices below it are exact.
    const MAX_INDEX: f64 = (1u64 << 52) as f64;
    if coordinate.abs() < MAX_INDEX {
        coordinate.floor() as i64
    } else {
        i64::from(value.to_bits())
    }
}

/// True if two positions are closer than a distance. The squares of tiny distances vanish; then only equal positions are.
fn is_closer(a: Vec3, b: Vec3, distance: f32) -> bool {
    a == b || a.distance_squared(b) < distance * distance
}

/// A fast hasher of cells, the same in every run.
#[derive(Default)]
struct CellHasher(u64);

type CellHash = std::hash::BuildHasherDefault<CellHasher>;

impl std::hash::Hasher for CellHasher {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.0 = hash(self.0 ^ u64::from_le_bytes(word));
        }
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

impl std::fmt::Display for Subsample {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::First(count) => write!(f, "first:{count}"),
            Self::Stride(stride) => write!(f, "stride:{stride}"),
            Self::Random(count) => write!(f, "random:{count}"),
            Self::Spacing(distance) => write!(f, "spacing:{distance}"),
        }
    }
}

impl FromStr for Subsample {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, number) = text.split_once(':').unwrap_or((text, ""));
        let subsample = match name {
            "first" => number.parse().ok().map(Self::First),
            "stride" => number.parse().ok().map(Self::Stride),
            "random" => number.parse().ok().map(Self::Random),
            "spacing" => number.parse().ok().map(Self::Spacing),
            _ => None,
        };
        let subsample = subsample.ok_or_else(|| Error::Setting {
            name: "subsample",
            found: text.to_owned(),
            expected: "first:N, stride:S, random:N or spacing:D",
        })?;
        subsample.check().map(|()| subsample)
    }
}

#[cfg(test)]
mod tests {
    //! Kept points.

    use super::*;
    use crate::progress::NoProgress;

    fn cloud(n_points: usize) -> PointCloud {
        let mut random = Random::new(3, 0);
        let mut next = || 10.0 * random.next_f32() - 5.0;
        let positions = (0..n_points).map(|_| Vec3::new(next(), next(), 0.1 * next()));
        PointCloud::from_positions(positions.collect())
    }

    fn subsampled(cloud: &PointCloud, text: &str) -> Vec<Vec3> {
        subsample(cloud, text.parse().unwrap(), 1, &NoProgress).unwrap().positions
    }

    #[test]
    fn first_stops_at_the_end() {
        let cloud = cloud(10);
        assert_eq!(subsampled(&cloud, "first:3"), cloud.positions[..3]);
        assert_eq!(subsampled(&cloud, "first:30"), cloud.positions);
        assert!(subsampled(&cloud, "first:0").is_empty());
    }

    #[test]
    fn strides_may_be_fractions() {
        assert_eq!(indices_by_stride(10, 2.5), [0, 2, 5, 7]);
        assert_eq!(indices_by_stride(4, 1.0), [0, 1, 2, 3]);
        assert_eq!(indices_by_stride(4, 1e30), [0]);
        assert!(indices_by_stride(0, 2.0).is_empty());
    }

    #[test]
    fn random_keeps_the_exact_number_in_order_and_evenly() {
        let mut counts = [0; 20];
        for seed in 0..2000 {
            let kept = random_indices(20, 5, seed);
            assert_eq!(kept.len(), 5);
            assert!(kept.is_sorted());
            kept.iter().for_each(|&point| counts[point as usize] += 1);
        }
        // Each is kept 500 times on average, with a standard deviation below 20.
        assert!(counts.iter().all(|count| (400..600).contains(count)), "{counts:?}");
        assert_eq!(random_indices(3, 9, 0), [0, 1, 2]);
    }

    #[test]
    fn spacing_equals_a_brute_force_search() {
        let cloud = cloud(3000);
        for distance in [0.01, 0.3, 1.0, 20.0] {
            let mut expected: Vec<Vec3> = Vec::new();
            for &position in &cloud.positions {
                let far = |other: &Vec3| distance * distance <= other.distance_squared(position);
                if expected.iter().all(far) {
                    expected.push(position);
                }
            }
            assert_eq!(subsampled(&cloud, &format!("spacing:{distance}")), expected);
        }
    }

    #[test]
    fn a_tiny_spacing_drops_duplicates_only_and_takes_no_quadratic_time() {
        let mut cloud = cloud(100_000);
        let distinct = subsampled(&cloud, "spacing:1e-12");
        assert_eq!(distinct, cloud.positions);
        cloud.positions.extend_from_within(..);
        for spacing in ["1e-12", "1e-20", "1e-30"] {
            assert_eq!(subsampled(&cloud, &format!("spacing:{spacing}")), distinct, "{spacing}");
        }
    }

    #[test]
    fn errors_name_the_valid_choices() {
        for text in ["", "first", "first:-1", "stride:0.5", "stride:NaN", "spacing:0", "every:2"] {
            let error = text.parse::<Subsample>().unwrap_err().to_string();
            assert!(error.starts_with("subsample must be ") && error.contains(text), "{error}");
        }
        assert_eq!("stride:1.5".parse::<Subsample>().unwrap(), Subsample::Stride(1.5));
    }
}
