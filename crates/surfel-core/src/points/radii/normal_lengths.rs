//! Radii stored as the lengths of normals (Wiesmeier, Ray Tracing Point Clouds, 2011).

use super::radius::spacing;
use crate::error::Result;
use crate::math::{Vec3, median};
use crate::points::PointCloud;
use crate::progress::Progress;
use crate::words::format_length;
use rayon::prelude::*;

/// Minimum difference between 1 and the length of a normal that may be a radius.
const MIN_DIFFERENCE: f32 = 1e-2;
/// Minimum ratio of the greatest to the least length, beyond which lengths vary.
const MIN_VARIATION: f32 = 1.05;
/// Least and greatest median length, in spacings, of lengths that are radii.
const TYPICAL_RADII: std::ops::RangeInclusive<f32> = 0.3..=10.0;

/// Takes the lengths of normals for radii if the cloud has no radii and its normals say so: hardly any has unit length,
/// lengths vary, and they are such as radii of points in these distances.
///
/// # Errors
///
/// Fails if there are too many points for 32-bit indices, or if `progress` is cancelled.
pub fn take_radii_from_normals(cloud: &mut PointCloud, progress: &dyn Progress) -> Result<()> {
    let Some(normals) = cloud.normals.as_ref().filter(|_| cloud.radii.is_none()) else {
        return Ok(());
    };
    let lengths: Vec<f32> = normals.par_iter().map(|normal| normal.length()).collect();
    let valid: Vec<f32> =
        lengths.iter().copied().filter(|length| 0.0 < *length && length.is_finite()).collect();
    let n_units = valid.iter().filter(|length| (**length - 1.0).abs() < MIN_DIFFERENCE).count();
    let min = valid.iter().copied().fold(f32::INFINITY, f32::min);
    let max = valid.iter().copied().fold(0.0, f32::max);
    let n_valid = valid.len();
    let Some(median) = median(valid) else { return Ok(()) };
    if n_valid < 10 * n_units || max < MIN_VARIATION * min {
        return Ok(());
    }
    let finite: Vec<Vec3> = cloud.positions.iter().copied().filter(|p| p.is_finite()).collect();
    if finite.is_empty() || !TYPICAL_RADII.contains(&(median / spacing(&finite, progress)?)) {
        return Ok(());
    }
    let [min, max] = [min, max].map(format_length);
    let line = format!("radii {min} to {max}: the lengths of the file's normals");
    progress.choice(&line, &["radius"]);
    cloud.radii = Some(lengths);
    Ok(())
}

#[cfg(test)]
mod tests {
    //! Lengths that are radii, and lengths that are not.

    use super::*;
    use crate::points::{Preparation, prepare};
    use crate::progress::NoProgress;

    /// Returns the radii of a lattice of spacing 1 whose normals have these lengths.
    fn radii(length: impl Fn(usize) -> f32) -> Option<Vec<f32>> {
        let positions =
            (0..900).map(|i| Vec3::new((i % 30) as f32, (i / 30) as f32, 0.0)).collect();
        let mut cloud = PointCloud::from_positions(positions);
        cloud.normals = Some((0..900).map(|i| length(i) * Vec3::Z).collect());
        take_radii_from_normals(&mut cloud, &NoProgress).unwrap();
        cloud.radii
    }

    #[test]
    fn lengths_that_vary_like_radii_are_radii() {
        let found = radii(|i| 1.5 + 0.1 * (i % 5) as f32).unwrap();
        assert_eq!((found[0], found[4]), (1.5, 1.9));
    }

    #[test]
    fn unit_equal_and_odd_lengths_are_no_radii() {
        assert_eq!(radii(|_| 1.0), None);
        assert_eq!(radii(|_| 1.7), None);
        assert_eq!(radii(|i| 1.0 + 0.001 * (i % 5) as f32), None);
        assert_eq!(radii(|i| 1e-4 * (1 + i % 5) as f32), None);
        assert_eq!(radii(|i| if i % 3 == 0 { 1.5 } else { 1.0 }), None);
    }

    #[test]
    fn preparation_keeps_the_lengths_and_makes_units_of_the_normals() {
        let positions =
            (0..900).map(|i| Vec3::new((i % 30) as f32, (i / 30) as f32, 0.0)).collect();
        let mut cloud = PointCloud::from_positions(positions);
        cloud.normals = Some((0..900).map(|i| (1.5 + 0.1 * (i % 5) as f32) * Vec3::Z).collect());
        let (prepared, _) = prepare(cloud.clone(), &Preparation::default(), &NoProgress).unwrap();
        assert_eq!((prepared.radii()[4], prepared.normals()[4]), (1.9, Vec3::Z));
        let ignored = Preparation { radii_from_normals: false, ..Preparation::default() };
        let (prepared, _) = prepare(cloud, &ignored, &NoProgress).unwrap();
        assert_ne!(prepared.radii()[4], 1.9);
    }
}
