//! The automatic choice of colours: what shows something, and no noise.

use super::ColorSource;
use crate::math::Random;
use crate::math::Vec3;
use crate::points::PointCloud;
use crate::points::neighbors::nearest_by_brute_force;
use rayon::prelude::*;

/// Light stone: white objects glare, and a grey without warmth looks dead.
pub const PLAIN: [u8; 3] = [0xd6, 0xd2, 0xca];

/// What to show when nothing was asked for, and why.
pub fn choose(cloud: &PointCloud) -> (ColorSource, &'static str) {
    if cloud.colors.as_ref().is_some_and(|colors| are_meant(colors)) {
        return (ColorSource::Rgb, "the colours of the file");
    }
    match &cloud.intensity {
        Some(values) if is_picture(&cloud.positions, values) => {
            (ColorSource::Intensity, "no colours in the file")
        }
        Some(_) => {
            (ColorSource::Constant(PLAIN), "no colours in the file; its intensity looks like noise")
        }
        None => (ColorSource::Constant(PLAIN), "no colours and no intensity in the file"),
    }
}

/// Programs fill columns of colours that nobody measured with black or white.
fn are_meant(colors: &[[u16; 3]]) -> bool {
    let filler = [[0; 3], [u16::MAX; 3]].into_iter().find(|filler| Some(filler) == colors.first());
    colors.iter().any(|color| Some(*color) != filler)
}

/// Patches looked at to tell a picture from noise.
const N_PATCHES: usize = 64;
/// Points of a patch.
const PATCH: usize = 24;
/// Share of the variance that points of one patch must have in common: 0.76 in a laser scan of a pump, 0.11
/// in the Stanford bunny, whose reconstruction left intensities that show as spots.
const IN_COMMON: f64 = 0.3;

/// Whether neighbouring points have similar values, as where the values show the surface.
///
/// The share of the variance that lies between patches, not within them (the intraclass correlation).
fn is_picture(positions: &[Vec3], values: &[f32]) -> bool {
    if positions.is_empty() {
        return false;
    }
    // Drawn at random, for scans have a rhythm that equal steps could fall in with.
    let mut random = Random::new(0, 0);
    let centers: Vec<usize> =
        (0..N_PATCHES).map(|_| random.below(positions.len() as u64) as usize).collect();
    let patches: Vec<(f64, f64)> = centers
        .into_par_iter()
        .map(|center| {
            let around = nearest_by_brute_force(positions, center, PATCH - 1);
            let others = around.iter().map(|neighbor| neighbor.index as usize);
            mean_and_variance(others.chain([center]).map(|i| f64::from(values[i])))
        })
        .filter(|(mean, variance)| mean.is_finite() && variance.is_finite())
        .collect();
    let (_, between) = mean_and_variance(patches.iter().map(|(mean, _)| *mean));
    let (within, _) = mean_and_variance(patches.iter().map(|(_, variance)| *variance));
    IN_COMMON * (between + within) < between
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
    use super::*;

    fn lattice() -> PointCloud {
        let place = |i: usize| Vec3::new((i % 50) as f32, (i / 50) as f32, 0.0);
        PointCloud::from_positions((0..2500).map(place).collect())
    }

    #[test]
    fn the_choice_falls_on_what_shows_something() {
        let mut cloud = lattice();
        assert_eq!(choose(&cloud).0, ColorSource::Constant(PLAIN));
        let mut random = Random::new(1, 0);
        cloud.intensity = Some((0..2500).map(|_| random.next_f32()).collect());
        assert_eq!(choose(&cloud).0, ColorSource::Constant(PLAIN));
        cloud.intensity = Some((0..2500).map(|i| ((i % 50) / 10 % 2) as f32).collect());
        assert_eq!(choose(&cloud).0, ColorSource::Intensity);
        cloud.colors = Some(vec![[0; 3]; 2500]);
        assert_eq!(choose(&cloud).0, ColorSource::Intensity);
        cloud.colors = Some(vec![[0x8080; 3]; 2500]);
        assert_eq!(choose(&cloud).0, ColorSource::Rgb);
        cloud.colors = Some((0..2500).map(|i| [i, 0, 0]).collect());
        assert_eq!(choose(&cloud).0, ColorSource::Rgb);
        cloud.intensity = Some(vec![0.5; 2500]);
        cloud.colors = None;
        assert_eq!(choose(&cloud).0, ColorSource::Constant(PLAIN));
        assert_eq!(choose(&PointCloud::default()).0, ColorSource::Constant(PLAIN));
    }
}
