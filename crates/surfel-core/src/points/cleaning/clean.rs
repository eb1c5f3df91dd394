//! Cleaning: drops points and marks entries that no later step can use, and counts them.

use super::clean_options::{CleanOptions, Duplicates, NoisePoints};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::{PointCloud, Values, WITHHELD, check_count, is_valid_position};
use crate::progress::Progress;
use crate::words::counted;
use rayon::prelude::*;

/// The repairs of [`clean`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CleanReport {
    /// Number of points before cleaning.
    pub n_points_before: usize,
    /// Number of points dropped because their position is not finite or beyond 1e15 from the cloud's origin.
    pub n_invalid_positions: usize,
    /// Number of points dropped because they lie at exactly zero, where scanners write rays that measured nothing.
    pub n_unmeasured: usize,
    /// Number of points dropped because they are of a class of noise.
    pub n_noise: usize,
    /// Number of points dropped because they are flagged withheld.
    pub n_withheld: usize,
    /// Number of points dropped because an earlier point has the same position, and a normal of about that direction.
    pub n_duplicates: usize,
    /// Number of zero or non-finite normals, set to zero, which `prepare` takes as missing.
    pub n_invalid_normals: usize,
    /// Number of normals scaled to unit length.
    pub n_scaled_normals: usize,
    /// Number of radii that are not positive and finite, set to zero, which `prepare` takes as missing.
    pub n_invalid_radii: usize,
}

/// Minimum cosine, of any sign, between the normals of duplicates.
const MIN_DUPLICATE_COSINE: f32 = 0.85;
/// Maximum number of points at one position that are compared with each other.
const MAX_COMPARED: usize = 64;

/// Minimum number of points at exactly zero at which they are rays that measured nothing.
const MIN_UNMEASURED: usize = 10;

/// ASPRS classes of noise: low points and high noise.
pub const NOISE_CLASSES: [u8; 2] = [7, 18];

/// Drops points with invalid positions and, if chosen, rays that measured nothing, points of classes of noise other than
/// those kept and points flagged withheld, unless there are no others, and duplicates; marks unusable normals and radii.
/// Duplicates of a cloud that deforms are kept, as they may part at another time; so are those of trained Gaussians, which
/// may have different sizes and colours.
///
/// A column of normals or radii without a usable entry, as trained splats have, is removed.
///
/// # Errors
///
/// Fails if there are too many points for 32-bit indices, or if `progress` is cancelled.
pub fn clean(
    cloud: PointCloud,
    options: &CleanOptions,
    progress: &dyn Progress,
) -> Result<(PointCloud, CleanReport)> {
    let mut report = CleanReport { n_points_before: cloud.len(), ..CleanReport::default() };
    let dropped = find_dropped(&cloud, options, progress, &mut report)?;
    let mut cloud = if dropped.is_empty() { cloud } else { without(&cloud, &dropped) };
    clean_normals(&mut cloud, &mut report);
    clean_radii(&mut cloud, &mut report);
    for line in report.lines(options.kept_noise) {
        progress.note(&line);
    }
    Ok((cloud, report))
}

impl CleanReport {
    /// Returns one line for each kind of repair that was made.
    fn lines(&self, kept_noise: &[u8]) -> Vec<String> {
        let is_dropped = |class: &&u8| !kept_noise.contains(class);
        let noise = match NOISE_CLASSES.iter().filter(is_dropped).collect::<Vec<_>>()[..] {
            [class] => format!("class of noise {class}"),
            _ => "classes of noise (7, 18)".to_owned(),
        };
        let counts = [
            (self.n_invalid_positions, "point", "dropped: no position, or beyond 1e15"),
            (self.n_unmeasured, "point", "dropped: at exactly 0, 0, 0, where nothing was measured"),
            (self.n_noise, "point", &format!("dropped: {noise}")),
            (self.n_withheld, "point", "dropped: flagged withheld"),
            (self.n_duplicates, "point", "dropped: at exactly the position of another"),
            (self.n_invalid_normals, "normal", "treated as missing: zero or not finite"),
            (self.n_scaled_normals, "normal", "scaled to unit length"),
            (self.n_invalid_radii, "radius value", "treated as missing: not positive and finite"),
        ];
        let found = counts.iter().filter(|(count, ..)| 0 < *count);
        found.map(|(n, thing, what)| format!("{} {what}", counted(*n, thing))).collect()
    }
}

/// The reason why a point is not shown, apart from its neighbours.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fault {
    InvalidPosition,
    Unmeasured,
    Noise,
    Withheld,
}

/// Returns the indices of the points to drop in ascending order.
fn find_dropped(
    cloud: &PointCloud,
    options: &CleanOptions,
    progress: &dyn Progress,
    report: &mut CleanReport,
) -> Result<Vec<u32>> {
    let positions = &cloud.positions;
    check_count(positions.len())?;
    progress.check()?;
    let may_part = !cloud.morphs.is_empty() || cloud.skin.is_some();
    // Points of a model may be at zero at rest.
    let unmeasured = if may_part { None } else { unmeasured_position(cloud) };
    let is_noise =
        |class: &u8| NOISE_CLASSES.contains(class) && !options.kept_noise.contains(class);
    let noise = cloud.classification.as_deref().filter(|classes| !classes.iter().all(is_noise));
    let fault_before_flags = |i: u32| match positions[i as usize] {
        position if !is_valid_position(position) => Some(Fault::InvalidPosition),
        position if unmeasured == Some(position) => Some(Fault::Unmeasured),
        _ if noise.is_some_and(|classes| is_noise(&classes[i as usize])) => Some(Fault::Noise),
        _ => None,
    };
    let withheld = withheld_points(cloud, |i| fault_before_flags(i).is_none());
    let is_withheld = |i: u32| withheld.is_some_and(|flags| flags.get(i as usize) != 0.0);
    let fault =
        |i: u32| fault_before_flags(i).or_else(|| is_withheld(i).then_some(Fault::Withheld));
    let drops =
        |fault: Fault| fault == Fault::InvalidPosition || options.noise_points == NoisePoints::Drop;
    let is_dropped = |i: u32| fault(i).is_some_and(drops);
    let indices = || (0..positions.len() as u32).into_par_iter();
    let mut dropped: Vec<u32> = indices().filter(|i| is_dropped(*i)).collect();
    let n_dropped_for = |of: Fault| dropped.par_iter().filter(|i| fault(**i) == Some(of)).count();
    report.n_invalid_positions = n_dropped_for(Fault::InvalidPosition);
    report.n_unmeasured = n_dropped_for(Fault::Unmeasured);
    report.n_noise = n_dropped_for(Fault::Noise);
    report.n_withheld = n_dropped_for(Fault::Withheld);
    let n_kept = match options.noise_points {
        NoisePoints::Drop => 0,
        NoisePoints::Keep => indices().filter(|i| fault(*i).is_some_and(|of| !drops(of))).count(),
    };
    if 0 < n_kept {
        let line = format!(
            "{} kept of classes of noise, flagged withheld or at exactly 0, 0, 0",
            counted(n_kept, "point")
        );
        progress.choice(&line, &["noise_points"]);
    }
    let n_dropped = dropped.len();
    if !may_part && !cloud.has_gaussians() {
        let found = find_duplicates(cloud, |i| !is_dropped(i), progress)?;
        match options.duplicates {
            Duplicates::Drop => dropped.extend(found),
            Duplicates::Keep if found.is_empty() => {}
            Duplicates::Keep => {
                let line = format!(
                    "{} kept at exactly the position of another",
                    counted(found.len(), "point")
                );
                progress.choice(&line, &["duplicates"]);
            }
        }
    }
    report.n_duplicates = dropped.len() - n_dropped;
    dropped.par_sort_unstable();
    Ok(dropped)
}

/// Returns the position of rays that measured nothing, which is the zero of the file, if there are such rays.
fn unmeasured_position(cloud: &PointCloud) -> Option<Vec3> {
    let zero = (-cloud.origin).as_vec3();
    let n_at_zero = cloud.positions.par_iter().filter(|position| **position == zero).count();
    (MIN_UNMEASURED..cloud.len()).contains(&n_at_zero).then_some(zero)
}

/// Returns the withheld flags, unless all points that would stay are withheld.
fn withheld_points(cloud: &PointCloud, stays: impl Fn(u32) -> bool + Sync) -> Option<&Values> {
    let flags = cloud.scalar(WITHHELD)?;
    let is_shown = |i: u32| stays(i) && flags.get(i as usize) == 0.0;
    (0..cloud.len() as u32).into_par_iter().any(is_shown).then_some(flags)
}

/// Returns all but the first index of each group of candidates at equal positions. Takes 8 bytes per point while it
/// runs.
fn find_duplicates(
    cloud: &PointCloud,
    is_candidate: impl Fn(u32) -> bool + Sync,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let mut keys: Vec<u64> = cloud
        .positions
        .par_iter()
        .enumerate()
        .filter(|(i, _)| is_candidate(*i as u32))
        .map(|(i, &position)| u64::from(position_hash(position)) << 32 | i as u64)
        .collect();
    progress.check()?;
    keys.par_sort_unstable();
    progress.check()?;
    let groups = keys.par_chunk_by_mut(|a, b| a >> 32 == b >> 32);
    Ok(groups.filter(|group| 1 < group.len()).flat_map_iter(|g| duplicates(g, cloud)).collect())
}

/// Returns the duplicates among points of one hash value, which rarely have different positions.
fn duplicates(group: &mut [u64], cloud: &PointCloud) -> Vec<u32> {
    let bits = |key: u64| position_bits(cloud.positions[key as u32 as usize]);
    group.sort_unstable_by_key(|&key| (bits(key), key as u32));
    let mut found = Vec::new();
    for points in group.chunk_by(|a, b| bits(*a) == bits(*b)) {
        let mut kept: Vec<u32> = Vec::new();
        for &key in points {
            let point = key as u32;
            let is_kept = kept.len() < MAX_COMPARED
                && !kept.iter().any(|other| have_similar_normals(cloud, *other, point));
            if is_kept { kept.push(point) } else { found.push(point) }
        }
    }
    found
}

/// True if two points have normals of about one direction, or if either has none.
fn have_similar_normals(cloud: &PointCloud, a: u32, b: u32) -> bool {
    let normal = |point: u32| cloud.normals.as_ref()?[point as usize].try_normalize();
    let (Some(a), Some(b)) = (normal(a), normal(b)) else { return true };
    MIN_DUPLICATE_COSINE < a.dot(b).abs()
}

/// Returns the bits of the coordinates, equal for equal coordinates: adding 0 turns -0 into 0.
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
    let (n_invalid, n_scaled) = normals
        .par_iter_mut()
        .map(|normal| {
            let length = normal.length();
            // NaN fails this test too; below this length the direction is lost to rounding.
            let is_valid = 1e-15 < length && length < f32::INFINITY;
            let is_scaled = is_valid && 1e-3 < (length - 1.0).abs();
            *normal = if is_valid { *normal / length } else { Vec3::ZERO };
            (usize::from(!is_valid), usize::from(is_scaled))
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    (report.n_invalid_normals, report.n_scaled_normals) = (n_invalid, n_scaled);
    if n_invalid == cloud.len() {
        cloud.normals = None;
    }
}

fn clean_radii(cloud: &mut PointCloud, report: &mut CleanReport) {
    let Some(radii) = &mut cloud.radii else { return };
    for radius in radii.iter_mut() {
        if !(0.0 < *radius && *radius < f32::INFINITY) {
            *radius = 0.0;
            report.n_invalid_radii += 1;
        }
    }
    if report.n_invalid_radii == cloud.len() {
        cloud.radii = None;
    }
}

#[cfg(test)]
mod tests {
    //! Dropped points and marked entries.

    use super::*;
    use crate::math::{DVec3, Random};
    use crate::points::{Morph, Scalar};
    use crate::progress::NoProgress;

    fn cleaned(cloud: PointCloud) -> (PointCloud, CleanReport) {
        clean(cloud, &CleanOptions::default(), &NoProgress).unwrap()
    }

    #[test]
    fn the_first_of_duplicates_stays() {
        let positions = [Vec3::X, Vec3::Y, Vec3::X, -Vec3::ZERO, Vec3::ZERO, Vec3::NAN, Vec3::Y];
        let mut cloud = PointCloud::from_positions(positions.to_vec());
        cloud.intensity = Some((0..7).map(|i| i as f32).collect());
        let (cloud, report) = cleaned(cloud);
        assert_eq!(cloud.intensity, Some(vec![0.0, 1.0, 3.0]));
        assert_eq!((report.n_invalid_positions, report.n_duplicates), (1, 3));
    }

    #[test]
    fn duplicates_stay_if_chosen() {
        let positions = vec![Vec3::X, Vec3::Y, Vec3::X, Vec3::NAN];
        let cloud = PointCloud::from_positions(positions.clone());
        let options = CleanOptions { duplicates: Duplicates::Keep, ..CleanOptions::default() };
        let (cloud, report) = clean(cloud, &options, &NoProgress).unwrap();
        assert_eq!(cloud.positions, positions[..3]);
        assert_eq!((report.n_invalid_positions, report.n_duplicates), (1, 0));
    }

    #[test]
    fn rays_that_measured_nothing_are_dropped() {
        let mut positions = vec![Vec3::ZERO; MIN_UNMEASURED];
        let all_equal = PointCloud::from_positions(positions.clone());
        positions.push(Vec3::X);
        let with_one = PointCloud::from_positions(positions);
        let (cloud, report) = cleaned(with_one.clone());
        assert_eq!((cloud.positions, report.n_unmeasured), (vec![Vec3::X], MIN_UNMEASURED));
        assert_eq!((report.n_invalid_positions, report.n_duplicates), (0, 0));
        let mut elsewhere = with_one.clone();
        elsewhere.origin = DVec3::X;
        let mut at_the_zero_of_its_file = with_one;
        at_the_zero_of_its_file.rebase(DVec3::new(100.0, 20.0, 0.0));
        assert_eq!(cleaned(elsewhere).1.n_duplicates, MIN_UNMEASURED - 1);
        assert_eq!(cleaned(at_the_zero_of_its_file).1.n_unmeasured, MIN_UNMEASURED);
        assert_eq!(cleaned(all_equal).0.len(), 1);
    }

    #[test]
    fn points_that_move_are_measured_wherever_they_are_at_rest() {
        let mut positions = vec![Vec3::ZERO; MIN_UNMEASURED];
        positions.push(Vec3::X);
        let offsets = (0..positions.len()).map(|i| i as f32 * Vec3::Y).collect();
        let morph = Morph { positions: offsets, ..Morph::default() };
        let cloud = PointCloud { morphs: vec![morph], ..PointCloud::from_positions(positions) };
        assert_eq!(cleaned(cloud.clone()).0, cloud);
    }

    #[test]
    fn points_beyond_the_coordinate_limit_are_dropped() {
        let far = [f32::MAX, -1e30, 1e15, f32::NEG_INFINITY].map(|x| Vec3::new(0.0, x, 1.0));
        let near = [Vec3::X, Vec3::new(-9e14, 0.0, 9e14)];
        let (cloud, report) = cleaned(PointCloud::from_positions([&far[..], &near].concat()));
        assert_eq!((cloud.positions, report.n_invalid_positions), (near.to_vec(), 4));
    }

    #[test]
    fn duplicates_equal_those_of_a_brute_force_search() {
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
    fn different_points_of_one_hash_are_no_duplicates() {
        let cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y, Vec3::X]);
        assert_eq!(duplicates(&mut [0, 1, 2], &cloud), [2]);
    }

    #[test]
    fn points_of_several_faces_keep_their_normals() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::ONE; 6]);
        cloud.normals =
            Some(vec![Vec3::X, Vec3::Y, Vec3::new(1.0, 0.1, 0.0), Vec3::Z, -Vec3::Y, Vec3::ZERO]);
        let (cloud, report) = cleaned(cloud);
        assert_eq!(cloud.normals, Some(vec![Vec3::X, Vec3::Y, Vec3::Z]));
        assert_eq!(report.n_duplicates, 3);
    }

    #[test]
    fn a_clean_cloud_is_unchanged() {
        let cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y]);
        let (cleaned, report) = cleaned(cloud.clone());
        assert_eq!(cleaned, cloud);
        assert_eq!(report, CleanReport { n_points_before: 2, ..CleanReport::default() });
    }

    #[test]
    fn invalid_normals_and_radii_are_set_to_zero() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE]);
        let infinite = Vec3::new(f32::INFINITY, 0.0, 0.0);
        cloud.normals = Some(vec![2.0 * Vec3::X, Vec3::NAN, infinite, Vec3::Z]);
        cloud.radii = Some(vec![1.0, -1.0, f32::NAN, 0.0]);
        let (cloud, report) = cleaned(cloud);
        assert_eq!(cloud.normals, Some(vec![Vec3::X, Vec3::ZERO, Vec3::ZERO, Vec3::Z]));
        assert_eq!(cloud.radii, Some(vec![1.0, 0.0, 0.0, 0.0]));
        assert_eq!((report.n_invalid_normals, report.n_scaled_normals), (2, 1));
        assert_eq!(report.n_invalid_radii, 3);
    }

    #[test]
    fn columns_of_zeros_are_removed() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y]);
        cloud.normals = Some(vec![Vec3::ZERO; 2]);
        cloud.radii = Some(vec![0.0; 2]);
        let (cloud, report) = cleaned(cloud);
        assert!(cloud.normals.is_none() && cloud.radii.is_none());
        assert_eq!((report.n_invalid_normals, report.n_invalid_radii), (2, 2));
        assert!(cleaned(PointCloud::default()).0.is_empty());
    }

    #[test]
    fn points_of_noise_are_dropped_unless_there_are_no_others() {
        let positions: Vec<Vec3> = [0.0, 1.0, 1.0, 2.0].map(|x| x * Vec3::X).to_vec();
        let classified = |classes: [u8; 4]| PointCloud {
            classification: Some(classes.to_vec()),
            ..PointCloud::from_positions(positions.clone())
        };
        let (cloud, report) = cleaned(classified([2, 7, 2, 18]));
        assert_eq!(cloud.positions, [Vec3::ZERO, Vec3::X]);
        assert_eq!((report.n_noise, report.n_duplicates), (2, 0));
        let (cloud, report) = cleaned(classified([7, 7, 7, 18]));
        assert_eq!((cloud.len(), report.n_noise, report.n_duplicates), (3, 0, 1));
        let positions = [Vec3::X, Vec3::Y, Vec3::Z].to_vec();
        let mut cloud = PointCloud::from_positions(positions);
        cloud.classification = Some(vec![5, 7, 18]);
        let options = CleanOptions { kept_noise: &[5, 7], ..CleanOptions::default() };
        let (cloud, report) = clean(cloud, &options, &NoProgress).unwrap();
        assert_eq!((cloud.classification, report.n_noise), (Some(vec![5, 7]), 1));
        assert_eq!(report.lines(&[5, 7]), ["1 point dropped: class of noise 18"]);
        assert_eq!(report.lines(&[]), ["1 point dropped: classes of noise (7, 18)"]);
    }

    #[test]
    fn withheld_points_are_dropped_unless_there_are_no_others() {
        let positions: Vec<Vec3> = [0.0, 1.0, 2.0].map(|x| x * Vec3::X).to_vec();
        let flagged = |flags: [u8; 3], classes: [u8; 3]| PointCloud {
            classification: Some(classes.to_vec()),
            scalars: vec![Scalar { name: "Withheld".into(), values: Values::U8(flags.to_vec()) }],
            ..PointCloud::from_positions(positions.clone())
        };
        let (cloud, report) = cleaned(flagged([0, 1, 0], [2, 2, 7]));
        assert_eq!(cloud.positions, [Vec3::ZERO]);
        assert_eq!((report.n_noise, report.n_withheld), (1, 1));
        let (cloud, report) = cleaned(flagged([1, 1, 0], [2, 2, 7]));
        assert_eq!((cloud.len(), report.n_noise, report.n_withheld), (2, 1, 0));
    }

    #[test]
    fn points_that_are_no_measurement_stay_if_asked() {
        let mut positions = vec![Vec3::ZERO; MIN_UNMEASURED];
        positions.extend([Vec3::X, Vec3::Y, Vec3::Z, Vec3::NAN]);
        let n = positions.len();
        let mut classes = vec![2; n];
        classes[n - 4] = 7;
        let mut flags = vec![0; n];
        flags[n - 3] = 1;
        let cloud = PointCloud {
            classification: Some(classes),
            scalars: vec![Scalar { name: WITHHELD.into(), values: Values::U8(flags) }],
            ..PointCloud::from_positions(positions.clone())
        };
        assert_eq!(cleaned(cloud.clone()).0.positions, [Vec3::Z]);
        let options = CleanOptions { noise_points: NoisePoints::Keep, ..CleanOptions::default() };
        let (kept, report) = clean(cloud.clone(), &options, &NoProgress).unwrap();
        assert_eq!(kept.positions, positions[MIN_UNMEASURED - 1..n - 1]);
        let n_duplicates = MIN_UNMEASURED - 1;
        assert_eq!((report.n_invalid_positions, report.n_duplicates), (1, n_duplicates));
        assert_eq!((report.n_unmeasured, report.n_noise, report.n_withheld), (0, 0, 0));
        let options = CleanOptions { duplicates: Duplicates::Keep, ..options };
        assert_eq!(clean(cloud, &options, &NoProgress).unwrap().0.positions, positions[..n - 1]);
    }
}
