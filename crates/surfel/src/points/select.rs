//! Selection: fewer points, in the order of the file, always the same ones.

use super::PointCloud;
use crate::error::{Error, Result};
use crate::math::{Random, Vec3, hash};
use crate::progress::Progress;
use std::collections::HashMap;
use std::str::FromStr;

/// Which points of a cloud stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Select {
    /// The first so many.
    First(usize),
    /// Every s-th: the points floor(i * s), for real s of at least 1.
    Stride(f64),
    /// So many, each set of them equally likely.
    Random(usize),
    /// None closer to another than this, taken greedily in the file's order: none can be added.
    Spacing(f32),
}

/// The selected points with all their columns; `seed` decides what `Select::Random` takes.
pub fn select(
    cloud: &PointCloud,
    select: Select,
    seed: u64,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    select.check()?;
    let n_points = cloud.len();
    let indices = match select {
        Select::First(count) => (0..count.min(n_points) as u32).collect(),
        Select::Stride(stride) => by_stride(n_points, stride),
        Select::Random(count) => at_random(n_points, count, seed),
        Select::Spacing(distance) => by_spacing(&cloud.positions, distance, progress)?,
    };
    progress.note(&format!("{select} took {} of {n_points} points", indices.len()));
    Ok(cloud.subset(&indices))
}

impl Select {
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
        Err(Error::Setting { name: "select", found: self.to_string(), expected })
    }
}

fn by_stride(n_points: usize, stride: f64) -> Vec<u32> {
    let multiples = (0..n_points).map(|i| (i as f64 * stride).floor());
    multiples.take_while(|&x| x < n_points as f64).map(|x| x as u32).collect()
}

/// Goes through the points once and takes each with the chance that fills the count exactly (Knuth,
/// algorithm S).
fn at_random(n_points: usize, count: usize, seed: u64) -> Vec<u32> {
    let mut random = Random::new(seed, 0);
    let mut wanted = count.min(n_points) as u64;
    let mut taken = Vec::with_capacity(count.min(n_points));
    for point in 0..n_points {
        if random.below((n_points - point) as u64) < wanted {
            taken.push(point as u32);
            wanted -= 1;
        }
    }
    taken
}

/// Cells are twice as wide as the spacing: the points around any place then lie in eight of them.
fn by_spacing(positions: &[Vec3], distance: f32, progress: &dyn Progress) -> Result<Vec<u32>> {
    progress.begin("spacing", positions.len() as u64);
    let mut cells: HashMap<[i64; 3], Vec<u32>, CellHash> = HashMap::default();
    let mut taken = Vec::new();
    // Distances in f32 may round down; a cell a millionth wider still catches those.
    let cells_per_unit = 0.5 / (f64::from(distance) * (1.0 + 1e-6));
    for (point, &position) in positions.iter().enumerate() {
        if point % 4096 == 0 {
            progress.check()?;
            progress.advance(4096.min(positions.len() - point) as u64);
        }
        let place = position.as_dvec3() * cells_per_unit;
        let own = place.floor().to_array().map(|cell| cell as i64);
        // The side of the cell on which the place lies is the side on which a neighbour cell is near.
        let side = (place - place.floor()).to_array().map(|x| if x < 0.5 { -1 } else { 1 });
        let too_close = (0..8).any(|corner| {
            let step = |axis: usize| if corner >> axis & 1 == 1 { side[axis] } else { 0 };
            let cell = std::array::from_fn(|axis| own[axis].saturating_add(step(axis)));
            let others = cells.get(&cell).map_or(&[][..], Vec::as_slice);
            let squared = |other: u32| positions[other as usize].distance_squared(position);
            others.iter().any(|&other| squared(other) < distance * distance)
        });
        if !too_close {
            cells.entry(own).or_default().push(point as u32);
            taken.push(point as u32);
        }
    }
    Ok(taken)
}

/// Cells need a quick hash rather than one that is different in every run.
#[derive(Default)]
struct CellHasher(u64);

type CellHash = std::hash::BuildHasherDefault<CellHasher>;

impl std::hash::Hasher for CellHasher {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = hash(self.0 ^ u64::from(byte));
        }
    }

    fn write_i64(&mut self, cell: i64) {
        self.0 = hash(self.0 ^ cell as u64);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

impl std::fmt::Display for Select {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::First(count) => write!(f, "first:{count}"),
            Self::Stride(stride) => write!(f, "stride:{stride}"),
            Self::Random(count) => write!(f, "random:{count}"),
            Self::Spacing(distance) => write!(f, "spacing:{distance}"),
        }
    }
}

impl FromStr for Select {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, number) = text.split_once(':').unwrap_or((text, ""));
        let select = match name {
            "first" => number.parse().ok().map(Self::First),
            "stride" => number.parse().ok().map(Self::Stride),
            "random" => number.parse().ok().map(Self::Random),
            "spacing" => number.parse().ok().map(Self::Spacing),
            _ => None,
        };
        let select = select.ok_or_else(|| Error::Setting {
            name: "select",
            found: text.to_owned(),
            expected: "first:N, stride:S, random:N or spacing:D",
        })?;
        select.check().map(|()| select)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn cloud(n_points: usize) -> PointCloud {
        let mut random = Random::new(3, 0);
        let mut next = || 10.0 * random.next_f32() - 5.0;
        let positions = (0..n_points).map(|_| Vec3::new(next(), next(), 0.1 * next()));
        PointCloud::from_positions(positions.collect())
    }

    fn selected(cloud: &PointCloud, text: &str) -> Vec<Vec3> {
        select(cloud, text.parse().unwrap(), 1, &Silent).unwrap().positions
    }

    #[test]
    fn first_stops_at_the_end() {
        let cloud = cloud(10);
        assert_eq!(selected(&cloud, "first:3"), cloud.positions[..3]);
        assert_eq!(selected(&cloud, "first:30"), cloud.positions);
        assert!(selected(&cloud, "first:0").is_empty());
    }

    #[test]
    fn strides_may_be_fractions() {
        assert_eq!(by_stride(10, 2.5), [0, 2, 5, 7]);
        assert_eq!(by_stride(4, 1.0), [0, 1, 2, 3]);
        assert_eq!(by_stride(4, 1e30), [0]);
        assert!(by_stride(0, 2.0).is_empty());
    }

    #[test]
    fn random_takes_the_exact_number_in_order_and_evenly() {
        let mut counts = [0; 20];
        for seed in 0..2000 {
            let taken = at_random(20, 5, seed);
            assert_eq!(taken.len(), 5);
            assert!(taken.is_sorted());
            taken.iter().for_each(|&point| counts[point as usize] += 1);
        }
        // Each is taken 500 times on average, with a standard deviation below 20.
        assert!(counts.iter().all(|count| (400..600).contains(count)), "{counts:?}");
        assert_eq!(at_random(3, 9, 0), [0, 1, 2]);
    }

    #[test]
    fn spacing_equals_the_plain_loop() {
        let cloud = cloud(3000);
        for distance in [0.01, 0.3, 1.0, 20.0] {
            let mut expected: Vec<Vec3> = Vec::new();
            for &position in &cloud.positions {
                let far = |other: &Vec3| distance * distance <= other.distance_squared(position);
                if expected.iter().all(far) {
                    expected.push(position);
                }
            }
            assert_eq!(selected(&cloud, &format!("spacing:{distance}")), expected);
        }
    }

    #[test]
    fn a_wrong_text_tells_what_is_right() {
        for text in ["", "first", "first:-1", "stride:0.5", "stride:NaN", "spacing:0", "every:2"] {
            let error = text.parse::<Select>().unwrap_err().to_string();
            assert!(error.starts_with("select must be ") && error.contains(text), "{error}");
        }
        assert_eq!("stride:1.5".parse::<Select>().unwrap(), Select::Stride(1.5));
    }
}
