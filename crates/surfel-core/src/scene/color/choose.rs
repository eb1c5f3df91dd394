//! The automatic choice of a source of colours: one that shows the surface, not noise.

use super::source::ColorSource;
use crate::math::{Random, Vec3, sample_indices};
use crate::points::PointCloud;
use crate::points::neighbors::nearest_by_brute_force;
use crate::scene::inlier_bounds;
use rayon::prelude::*;

/// sRGB-encoded colour of clouds without colours: light stone, for white objects glare and a cold grey looks
/// lifeless.
const DEFAULT_COLOR: [u8; 3] = [0xd6, 0xd2, 0xca];

/// Returns the source of colours that suits `cloud`, and the reason for the choice.
pub fn choose_source(cloud: &PointCloud) -> (ColorSource, String) {
    let colors = match &cloud.colors {
        Some(colors) if are_mostly_black(colors) => "most colours in the file are black",
        Some(colors) if are_white(colors) => "all colours in the file are white",
        Some(_) => return (ColorSource::Rgb, "the colours of the file".into()),
        None => "no colours in the file",
    };
    if is_georeferenced_land(cloud) {
        return (ColorSource::Elevation, format!("{colors}; wide, flat and georeferenced land"));
    }
    let constant = ColorSource::Constant(DEFAULT_COLOR);
    match &cloud.intensity {
        Some(values) if shows_surface(&cloud.positions, values) => {
            (ColorSource::Intensity, colors.into())
        }
        Some(_) => (constant, format!("{colors}; its intensity looks like noise")),
        None => (constant, format!("{colors}, and no intensity")),
    }
}

/// True if most colours are black, as programs write them for points that no photograph shows.
fn are_mostly_black(colors: &[[u16; 3]]) -> bool {
    colors.len() < 2 * colors.iter().filter(|color| **color == [0; 3]).count()
}

/// True if all colours are white, as programs write them without a measurement.
fn are_white(colors: &[[u16; 3]]) -> bool {
    colors.iter().all(|color| *color == [u16::MAX; 3])
}

/// True if the cloud is a georeferenced piece of land, whose forms elevation shows better than intensity does: a good
/// deal wider than it is high, and with coordinates far from zero.
fn is_georeferenced_land(cloud: &PointCloud) -> bool {
    /// Coordinates of maps are larger; those of scanners and objects are not.
    const MIN_MAP_COORDINATE: f64 = 10_000.0;
    const MIN_WIDTH_PER_HEIGHT: f32 = 2.5;
    if cloud.origin.abs().max_element() < MIN_MAP_COORDINATE {
        return false;
    }
    let size = inlier_bounds(cloud).size();
    MIN_WIDTH_PER_HEIGHT * size.z <= size.x.min(size.y)
}

/// Number of patches that are examined.
const N_PATCHES: usize = 64;
/// Maximum number of points in which patches are sought.
const MAX_SAMPLES: usize = 500_000;
/// Number of points in a patch.
const PATCH_SIZE: usize = 24;
/// Minimum intraclass correlation of the patches. It is 0.76 in a laser scan of a pump, and 0.11 in the
/// Stanford bunny, whose reconstruction left intensities that appear as spots.
const MIN_CORRELATION: f64 = 0.3;

/// True if neighbouring points have similar values, as they do if the values show the surface.
///
/// The measure is the intraclass correlation: the fraction of the variance that lies between patches, not
/// within them.
fn shows_surface(positions: &[Vec3], values: &[f32]) -> bool {
    if positions.is_empty() {
        return false;
    }
    let indices: Vec<usize> = sample_indices(positions.len(), MAX_SAMPLES).collect();
    let positions: Vec<Vec3> = indices.iter().map(|i| positions[*i]).collect();
    // Equal steps could fall in with the regular pattern of a scan, random ones cannot.
    let mut random = Random::new(0, 0);
    let centers: Vec<usize> =
        (0..N_PATCHES).map(|_| random.below(positions.len() as u64) as usize).collect();
    let patches: Vec<(f64, f64)> = centers
        .into_par_iter()
        .map(|center| {
            let neighbors = nearest_by_brute_force(&positions, center, PATCH_SIZE - 1);
            let others = neighbors.iter().map(|neighbor| neighbor.index as usize);
            mean_and_variance(others.chain([center]).map(|i| f64::from(values[indices[i]])))
        })
        .filter(|(mean, variance)| mean.is_finite() && variance.is_finite())
        .collect();
    let (_, between) = mean_and_variance(patches.iter().map(|(mean, _)| *mean));
    let (within, _) = mean_and_variance(patches.iter().map(|(_, variance)| *variance));
    MIN_CORRELATION * (between + within) < between
}

fn mean_and_variance(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        n += 1.0;
        sum += value;
        squares += value * value;
    }
    let mean = sum / n;
    (mean, (squares / n - mean * mean).max(0.0))
}

#[cfg(test)]
mod tests {
    //! The chosen source is one that shows the surface.

    use super::*;
    use crate::math::DVec3;

    fn lattice() -> PointCloud {
        let position = |i: usize| Vec3::new((i % 50) as f32, (i / 50) as f32, 0.0);
        PointCloud::from_positions((0..2500).map(position).collect())
    }

    #[test]
    fn the_chosen_source_shows_the_surface() {
        let mut cloud = lattice();
        assert_eq!(choose_source(&cloud).0, ColorSource::Constant(DEFAULT_COLOR));
        let mut random = Random::new(1, 0);
        cloud.intensity = Some((0..2500).map(|_| random.next_f32()).collect());
        assert_eq!(choose_source(&cloud).0, ColorSource::Constant(DEFAULT_COLOR));
        cloud.intensity = Some((0..2500).map(|i| ((i % 50) / 10 % 2) as f32).collect());
        assert_eq!(choose_source(&cloud).0, ColorSource::Intensity);
        cloud.colors = Some(vec![[0; 3]; 2500]);
        assert_eq!(choose_source(&cloud).0, ColorSource::Intensity);
        cloud.colors = Some(vec![[0x8080; 3]; 2500]);
        assert_eq!(choose_source(&cloud).0, ColorSource::Rgb);
        cloud.colors = Some((0..2500).map(|i| [i, 0, 0]).collect());
        assert_eq!(choose_source(&cloud).0, ColorSource::Rgb);
        cloud.colors = Some((0..2500).map(|i| if i % 3 == 0 { [i; 3] } else { [0; 3] }).collect());
        assert_eq!(choose_source(&cloud).0, ColorSource::Intensity);
        cloud.colors = Some(vec![[u16::MAX; 3]; 2500]);
        assert_eq!(choose_source(&cloud).0, ColorSource::Intensity);
        cloud.intensity = Some(vec![0.5; 2500]);
        cloud.colors = None;
        assert_eq!(choose_source(&cloud).0, ColorSource::Constant(DEFAULT_COLOR));
        assert_eq!(choose_source(&PointCloud::default()).0, ColorSource::Constant(DEFAULT_COLOR));
    }

    #[test]
    fn georeferenced_land_shows_elevation() {
        let mut cloud = lattice();
        cloud.intensity = Some((0..2500).map(|i| ((i % 50) / 10 % 2) as f32).collect());
        cloud.origin = DVec3::new(562_000.0, 4_183_000.0, 150.0);
        assert_eq!(choose_source(&cloud).0, ColorSource::Elevation);
        // One stray point makes no land steep.
        cloud.positions[0].z = 4000.0;
        assert_eq!(choose_source(&cloud).0, ColorSource::Elevation);
        let is_tower = |i: usize| i % 50 == 7;
        (0..2500).filter(|i| is_tower(*i)).for_each(|i| cloud.positions[i].z = 40.0);
        assert_eq!(choose_source(&cloud).0, ColorSource::Intensity);
        cloud.colors = Some(vec![[0x8080; 3]; 2500]);
        assert_eq!(choose_source(&cloud).0, ColorSource::Rgb);
    }
}
