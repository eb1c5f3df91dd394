//! Outlier removal: drops points that stand far from all others.

use crate::error::{Error, Result};
use crate::points::PointCloud;
use crate::points::neighbors::{KdTree, Neighbor, Neighborhood};
use crate::points::radii::radius::kth_distance;
use crate::progress::Progress;
use crate::words::counted;
use std::str::FromStr;

/// The points of a cloud that count as outliers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OutlierRemoval {
    /// Points whose mean distance to their k nearest neighbours exceeds the mean over all points by more than `ratio`
    /// standard deviations (Rusu et al., Towards 3D Point Cloud Based Object Maps for Household Environments, 2008).
    Statistical {
        /// Number of neighbours.
        k: usize,
        /// Number of standard deviations.
        ratio: f32,
    },
    /// Points with fewer than `count` others within `radius`.
    Radius {
        /// Distance in world units.
        radius: f32,
        /// Minimum number of neighbours.
        count: usize,
    },
}

impl OutlierRemoval {
    /// Number of neighbours of both methods if none is given.
    const DEFAULT_COUNT: usize = 16;
    /// Number of standard deviations if none is given.
    const DEFAULT_RATIO: f32 = 2.0;

    fn check(self) -> Result<()> {
        let is_count = |count: usize| (1..1 << 20).contains(&count);
        let (good, expected) = match self {
            Self::Statistical { k, ratio } => (
                is_count(k) && 0.0 < ratio && ratio.is_finite(),
                "statistical:K,RATIO with K from 1 to a million and a positive RATIO",
            ),
            Self::Radius { radius, count } => (
                is_count(count) && 0.0 < radius && radius.is_finite(),
                "radius:DISTANCE,COUNT with a positive DISTANCE and COUNT from 1 to a million",
            ),
        };
        if good {
            return Ok(());
        }
        Err(Error::Setting { name: "remove-outliers", found: self.to_string(), expected })
    }
}

/// Returns the points that are no outliers, with all their columns.
///
/// # Errors
///
/// Returns [`Error::Setting`] for a value out of range, [`Error::TooManyPoints`] beyond 32-bit indices and
/// [`Error::Cancelled`] if `progress` is cancelled.
pub fn remove_outliers(
    cloud: &PointCloud,
    removal: OutlierRemoval,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    removal.check()?;
    let tree = KdTree::new(&cloud.positions, progress)?;
    let (values, limit) = match removal {
        OutlierRemoval::Statistical { k, ratio } => {
            let mean = |_: usize, neighbors: &[Neighbor]| mean_distance(neighbors);
            let values = tree.map(Neighborhood::Nearest(k), progress, mean)?;
            let limit = mean_and_deviations(&values, ratio.into());
            (values, limit)
        }
        OutlierRemoval::Radius { radius, count } => {
            let distance = |_: usize, neighbors: &[Neighbor]| match neighbors.len() < count {
                true => f32::INFINITY,
                false => kth_distance(neighbors, count),
            };
            let values = tree.map(Neighborhood::Nearest(count), progress, distance)?;
            (values, radius.into())
        }
    };
    let is_kept = |point: &u32| f64::from(values[*point as usize]) <= limit;
    let kept: Vec<u32> = (0..cloud.len() as u32).filter(is_kept).collect();
    let n_outliers = cloud.len() - kept.len();
    let points = counted(cloud.len(), "point");
    progress.note(&format!("{n_outliers} of {points} removed as outliers, by {removal}"));
    Ok(cloud.subset(&kept))
}

fn mean_distance(neighbors: &[Neighbor]) -> f32 {
    let sum: f32 = neighbors.iter().map(|neighbor| neighbor.distance_squared.sqrt()).sum();
    sum / neighbors.len().max(1) as f32
}

/// Returns the mean of the values plus so many standard deviations.
fn mean_and_deviations(values: &[f32], ratio: f64) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (f64::from(*value) - mean).powi(2)).sum();
    // Rounding makes no outliers of equal distances.
    mean + ratio * (squares / n).sqrt() + 1e-6 * mean
}

impl std::fmt::Display for OutlierRemoval {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Statistical { k, ratio } => write!(f, "statistical:{k},{ratio}"),
            Self::Radius { radius, count } => write!(f, "radius:{radius},{count}"),
        }
    }
}

impl FromStr for OutlierRemoval {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, numbers) = text.split_once(':').unwrap_or((text, ""));
        let (first, second) = numbers.split_once(',').unwrap_or((numbers, ""));
        let removal = match name {
            "statistical" => parse_or(first, Self::DEFAULT_COUNT)
                .zip(parse_or(second, Self::DEFAULT_RATIO))
                .map(|(k, ratio)| Self::Statistical { k, ratio }),
            "radius" => first
                .parse()
                .ok()
                .zip(parse_or(second, Self::DEFAULT_COUNT))
                .map(|(radius, count)| Self::Radius { radius, count }),
            _ => None,
        };
        let removal = removal.ok_or_else(|| Error::Setting {
            name: "remove-outliers",
            found: text.to_owned(),
            expected: "statistical, statistical:K,RATIO, radius:DISTANCE or radius:DISTANCE,COUNT",
        })?;
        removal.check().map(|()| removal)
    }
}

/// Returns the number that a text says, the default if it is empty, and none if it is no number.
fn parse_or<T: FromStr>(text: &str, default: T) -> Option<T> {
    if text.is_empty() { Some(default) } else { text.parse().ok() }
}

#[cfg(test)]
mod tests {
    //! Removed points.

    use super::*;
    use crate::math::{Random, Vec3};
    use crate::progress::NoProgress;

    /// Returns 2000 points in a unit cube and, at the end, three far from it.
    fn cube_with_strays() -> PointCloud {
        let mut random = Random::new(4, 0);
        let mut point = |_| Vec3::new(random.next_f32(), random.next_f32(), random.next_f32());
        let mut points: Vec<Vec3> = (0..2000).map(&mut point).collect();
        points.extend([Vec3::splat(3.0), Vec3::new(-2.0, 0.5, 0.5), Vec3::new(0.5, 0.5, 4.0)]);
        PointCloud::from_positions(points)
    }

    fn kept(cloud: &PointCloud, text: &str) -> Vec<Vec3> {
        remove_outliers(cloud, text.parse().unwrap(), &NoProgress).unwrap().positions
    }

    /// Returns the distances from a point to all others in ascending order.
    fn distances(cloud: &PointCloud, point: Vec3) -> Vec<f32> {
        let mut distances: Vec<f32> =
            cloud.positions.iter().map(|other| other.distance(point)).collect();
        distances.sort_unstable_by(f32::total_cmp);
        // The first is that to the point itself.
        distances.split_off(1)
    }

    #[test]
    fn strays_are_removed_by_both_methods() {
        let cloud = cube_with_strays();
        for text in ["statistical:16,8", "radius:0.5", "radius:0.5,3"] {
            assert_eq!(kept(&cloud, text), cloud.positions[..2000], "{text}");
        }
    }

    #[test]
    fn statistical_removal_equals_its_definition() {
        let cloud = cube_with_strays();
        let mean_of = |point: &Vec3| distances(&cloud, *point)[..5].iter().sum::<f32>() / 5.0;
        let means: Vec<f32> = cloud.positions.iter().map(mean_of).collect();
        let n = means.len() as f32;
        let mean = means.iter().sum::<f32>() / n;
        let deviation = (means.iter().map(|own| (own - mean).powi(2)).sum::<f32>() / n).sqrt();
        let is_kept = |(_, own): &(&Vec3, &f32)| **own <= mean + 0.2 * deviation;
        let expected: Vec<Vec3> =
            cloud.positions.iter().zip(&means).filter(is_kept).map(|(point, _)| *point).collect();
        assert!(expected.len() < 2000);
        assert_eq!(kept(&cloud, "statistical:5,0.2"), expected);
    }

    #[test]
    fn radius_removal_equals_its_definition() {
        let cloud = cube_with_strays();
        let n_within = |point: &Vec3| {
            distances(&cloud, *point).iter().filter(|distance| **distance <= 0.08).count()
        };
        let expected: Vec<Vec3> =
            cloud.positions.iter().filter(|point| 4 <= n_within(point)).copied().collect();
        assert!(!expected.is_empty() && expected.len() < 1900, "{}", expected.len());
        assert_eq!(kept(&cloud, "radius:0.08,4"), expected);
    }

    #[test]
    fn few_and_equal_points_stay_by_statistics() {
        for points in [vec![], vec![Vec3::ONE], vec![Vec3::ONE; 100], vec![Vec3::X, Vec3::Y]] {
            let cloud = PointCloud::from_positions(points);
            assert_eq!(kept(&cloud, "statistical"), cloud.positions);
        }
        let lonely = PointCloud::from_positions(vec![Vec3::X, Vec3::Y]);
        assert!(kept(&lonely, "radius:9").is_empty());
    }

    #[test]
    fn columns_stay_with_their_points() {
        let mut cloud = cube_with_strays();
        cloud.normals = Some(cloud.positions.clone());
        let removal = OutlierRemoval::Radius { radius: 0.08, count: 4 };
        let left = remove_outliers(&cloud, removal, &NoProgress).unwrap();
        assert_eq!(left.normals.as_ref(), Some(&left.positions));
    }

    #[test]
    fn choices_are_written_as_they_are_read_and_errors_name_the_valid_ones() {
        for text in ["statistical:16,2", "radius:0.1,4"] {
            assert_eq!(text.parse::<OutlierRemoval>().unwrap().to_string(), text);
        }
        assert_eq!(
            "statistical".parse::<OutlierRemoval>().unwrap(),
            OutlierRemoval::Statistical { k: 16, ratio: 2.0 }
        );
        let invalid =
            ["", "radius", "radius:0", "radius:1,0", "statistical:0", "radius:NaN", "sor"];
        for text in invalid {
            let error = text.parse::<OutlierRemoval>().unwrap_err().to_string();
            assert!(error.starts_with("remove-outliers must be "), "{error}");
            assert!(
                error.contains("radius:DISTANCE") || error.contains("statistical:K"),
                "{error}"
            );
        }
    }
}
