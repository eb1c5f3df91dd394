//! Cleaning: what no later step could use is dropped or marked, and counted.

use super::PointCloud;
use super::cloud::is_somewhere;
use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::progress::Progress;
use rayon::prelude::*;

/// What `clean` found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CleanReport {
    pub n_before: usize,
    /// Positions that are not finite, or beyond 1e15 from the cloud's origin: dropped.
    pub n_nowhere: usize,
    /// Points at the position of an earlier one: dropped.
    pub n_duplicates: usize,
    /// Normals that are zero or not finite: set to zero, which `prepare` takes as missing.
    pub n_bad_normals: usize,
    /// Normals of another length than one: scaled.
    pub n_scaled_normals: usize,
    /// Radii that are not positive and finite: set to zero, which `prepare` takes as missing.
    pub n_bad_radii: usize,
}

/// Drops points that are nowhere or twice at one place (the first stays), and marks unusable entries. Points
/// that bend may part at another time: of these none is dropped for its place.
///
/// A column of normals or radii without a usable entry, as trained splats have, is removed.
pub fn clean(cloud: PointCloud, progress: &dyn Progress) -> Result<(PointCloud, CleanReport)> {
    let mut report = CleanReport { n_before: cloud.len(), ..CleanReport::default() };
    let dropped = find_dropped(&cloud, progress, &mut report)?;
    let mut cloud = if dropped.is_empty() { cloud } else { without(&cloud, &dropped) };
    clean_normals(&mut cloud, &mut report);
    clean_radii(&mut cloud, &mut report);
    for line in report.lines() {
        progress.note(&line);
    }
    Ok((cloud, report))
}

impl CleanReport {
    /// One line for each kind of repair that was needed.
    fn lines(&self) -> Vec<String> {
        let counts = [
            (self.n_nowhere, "points without a position, or beyond 1e15: dropped"),
            (self.n_duplicates, "exact duplicates: dropped"),
            (self.n_bad_normals, "normals that are zero or not finite: taken as missing"),
            (self.n_scaled_normals, "normals of another length than one: scaled"),
            (self.n_bad_radii, "radii that are not positive and finite: taken as missing"),
        ];
        let found = counts.iter().filter(|(count, _)| 0 < *count);
        found.map(|(count, what)| format!("{count} {what}")).collect()
    }
}

/// Indices of the points to drop, rising.
fn find_dropped(
    cloud: &PointCloud,
    progress: &dyn Progress,
    report: &mut CleanReport,
) -> Result<Vec<u32>> {
    let positions = &cloud.positions;
    let limit = u32::MAX as usize;
    if limit <= positions.len() {
        return Err(Error::TooManyPoints { found: positions.len(), limit: limit - 1 });
    }
    progress.check()?;
    let mut dropped: Vec<u32> = (0..positions.len() as u32)
        .into_par_iter()
        .filter(|&i| !is_somewhere(positions[i as usize]))
        .collect();
    report.n_nowhere = dropped.len();
    if cloud.morphs.is_empty() && cloud.skin.is_none() {
        dropped.extend(find_duplicates(positions, progress)?);
    }
    report.n_duplicates = dropped.len() - report.n_nowhere;
    dropped.par_sort_unstable();
    Ok(dropped)
}

/// All but the first of each group of equal positions, of points that are somewhere: 8 bytes a point while it runs.
fn find_duplicates(positions: &[Vec3], progress: &dyn Progress) -> Result<Vec<u32>> {
    let mut keys: Vec<u64> = positions
        .par_iter()
        .enumerate()
        .filter(|(_, position)| is_somewhere(**position))
        .map(|(i, &position)| u64::from(position_hash(position)) << 32 | i as u64)
        .collect();
    progress.check()?;
    keys.par_sort_unstable();
    progress.check()?;
    let groups = keys.par_chunk_by_mut(|a, b| a >> 32 == b >> 32);
    Ok(groups.filter(|group| 1 < group.len()).flat_map_iter(|g| repeats(g, positions)).collect())
}

/// Points of one hash value: equal, or rarely different ones that happen to share it.
fn repeats(group: &mut [u64], positions: &[Vec3]) -> Vec<u32> {
    let bits = |key: u64| position_bits(positions[key as u32 as usize]);
    group.sort_unstable_by_key(|&key| (bits(key), key as u32));
    let pairs = group.windows(2).filter(|pair| bits(pair[0]) == bits(pair[1]));
    pairs.map(|pair| pair[1] as u32).collect()
}

/// Bits that are equal where the coordinates are: adding 0 turns -0 into 0.
fn position_bits(position: Vec3) -> [u32; 3] {
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

fn position_hash(position: Vec3) -> u32 {
    let [x, y, z] = position_bits(position).map(u64::from);
    let mixed = (x << 32 | y).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ z;
    (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9).wrapping_shr(32) as u32
}

fn without(cloud: &PointCloud, dropped: &[u32]) -> PointCloud {
    let mut dropped = dropped.iter().copied().peekable();
    let kept = (0..cloud.len() as u32).filter(|&i| dropped.next_if_eq(&i).is_none());
    cloud.subset(&kept.collect::<Vec<u32>>())
}

fn clean_normals(cloud: &mut PointCloud, report: &mut CleanReport) {
    let Some(normals) = &mut cloud.normals else { return };
    let (n_bad, n_scaled) = normals
        .par_iter_mut()
        .map(|normal| {
            let length = normal.length();
            // Written so that NaN is bad; below this length the direction is lost to rounding.
            let good = 1e-15 < length && length < f32::INFINITY;
            let scaled = good && 1e-3 < (length - 1.0).abs();
            *normal = if good { *normal / length } else { Vec3::ZERO };
            (usize::from(!good), usize::from(scaled))
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    (report.n_bad_normals, report.n_scaled_normals) = (n_bad, n_scaled);
    if n_bad == cloud.len() {
        cloud.normals = None;
    }
}

fn clean_radii(cloud: &mut PointCloud, report: &mut CleanReport) {
    let Some(radii) = &mut cloud.radii else { return };
    for radius in radii.iter_mut() {
        if !(0.0 < *radius && *radius < f32::INFINITY) {
            *radius = 0.0;
            report.n_bad_radii += 1;
        }
    }
    if report.n_bad_radii == cloud.len() {
        cloud.radii = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::progress::Silent;

    fn cleaned(cloud: PointCloud) -> (PointCloud, CleanReport) {
        clean(cloud, &Silent).unwrap()
    }

    #[test]
    fn duplicates_go_and_the_first_stays() {
        let positions = [Vec3::X, Vec3::Y, Vec3::X, -Vec3::ZERO, Vec3::ZERO, Vec3::NAN, Vec3::Y];
        let mut cloud = PointCloud::from_positions(positions.to_vec());
        cloud.intensity = Some((0..7).map(|i| i as f32).collect());
        let (cloud, report) = cleaned(cloud);
        assert_eq!(cloud.intensity, Some(vec![0.0, 1.0, 3.0]));
        assert_eq!((report.n_nowhere, report.n_duplicates), (1, 3));
    }

    #[test]
    fn points_too_far_for_squares_go() {
        let far = [f32::MAX, -1e30, 1e15, f32::NEG_INFINITY].map(|x| Vec3::new(0.0, x, 1.0));
        let near = [Vec3::X, Vec3::new(-9e14, 0.0, 9e14)];
        let (cloud, report) = cleaned(PointCloud::from_positions([&far[..], &near].concat()));
        assert_eq!((cloud.positions, report.n_nowhere), (near.to_vec(), 4));
    }

    #[test]
    fn duplicates_equal_the_plain_loop() {
        let mut random = Random::new(5, 0);
        let mut next = || random.below(12) as f32 - 6.0;
        let positions: Vec<Vec3> = (0..2000).map(|_| Vec3::new(next(), next(), next())).collect();
        let mut expected: Vec<Vec3> = Vec::new();
        for &position in &positions {
            if !expected.contains(&position) {
                expected.push(position);
            }
        }
        assert_eq!(cleaned(PointCloud::from_positions(positions)).0.positions, expected);
    }

    #[test]
    fn points_that_share_a_hash_are_told_apart() {
        let positions = [Vec3::X, Vec3::Y, Vec3::X];
        assert_eq!(repeats(&mut [0, 1, 2], &positions), [2]);
    }

    #[test]
    fn a_clean_cloud_is_left_alone() {
        let cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y]);
        let (cleaned, report) = cleaned(cloud.clone());
        assert_eq!(cleaned, cloud);
        assert_eq!(report, CleanReport { n_before: 2, ..CleanReport::default() });
    }

    #[test]
    fn bad_normals_and_radii_are_marked() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE]);
        let infinite = Vec3::new(f32::INFINITY, 0.0, 0.0);
        cloud.normals = Some(vec![2.0 * Vec3::X, Vec3::NAN, infinite, Vec3::Z]);
        cloud.radii = Some(vec![1.0, -1.0, f32::NAN, 0.0]);
        let (cloud, report) = cleaned(cloud);
        assert_eq!(cloud.normals, Some(vec![Vec3::X, Vec3::ZERO, Vec3::ZERO, Vec3::Z]));
        assert_eq!(cloud.radii, Some(vec![1.0, 0.0, 0.0, 0.0]));
        assert_eq!((report.n_bad_normals, report.n_scaled_normals), (2, 1));
        assert_eq!(report.n_bad_radii, 3);
    }

    #[test]
    fn columns_of_nothing_but_zeros_are_removed() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y]);
        cloud.normals = Some(vec![Vec3::ZERO; 2]);
        cloud.radii = Some(vec![0.0; 2]);
        let (cloud, report) = cleaned(cloud);
        assert!(cloud.normals.is_none() && cloud.radii.is_none());
        assert_eq!((report.n_bad_normals, report.n_bad_radii), (2, 2));
        assert!(cleaned(PointCloud::default()).0.is_empty());
    }
}
