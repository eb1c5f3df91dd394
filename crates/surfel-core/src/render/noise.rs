//! Noise of blocks of pixels, estimated from the sums over two halves of their samples, and how many more they get.

use crate::math::{Vec3, Vec4};

/// Greatest factor by which a block's samples grow.
const MAX_FACTOR: u32 = 4;
/// Number of samples per pixel beyond which no block's samples grow.
const MAX_ADAPTIVE_SAMPLES: u32 = 32;
/// Factor by which half the difference of the halves exceeds the deviation of a pixel between seeds. For independent
/// samples it would be 1. These are stratified together, and their mean deviates less than that: medians of 1.2 to 1.8
/// were measured for two clouds, a scan and two meshes.
const STRATIFICATION: f32 = 1.5;

/// Share of the contrast between neighbouring pixels below which noise is not seen, as in leaves and gravel. Between
/// pixels that differ by nothing but noise the contrast is 1.4 times the noise.
const MASKED_SHARE: f32 = 0.3;

/// Returns the number of samples that follows `n_samples`, of which a pixel has at least `min_samples`; none if that is
/// the last.
///
/// Samples double, so that the two halves of the next estimate are equal.
pub fn next_n_samples(n_samples: u32, min_samples: u32) -> Option<u32> {
    let next = n_samples.checked_mul(2)?;
    let max = MAX_ADAPTIVE_SAMPLES.min(min_samples.saturating_mul(MAX_FACTOR));
    (next <= max).then_some(next)
}

/// Square of the median of the absolute value of a normally distributed number with a deviation of 1.
const MEDIAN_SQUARE: f32 = 0.455;

/// The sums of a pixel's premultiplied samples, and what is behind them.
#[derive(Clone, Copy)]
pub struct HalfSums {
    /// Sum over the first half.
    pub first: Vec4,
    /// Sum over all samples.
    pub all: Vec4,
    /// The background's colour.
    pub background: Vec3,
}

/// Returns the standard deviation of pixels between seeds, in steps of an 8-bit picture.
///
/// `n_first` of the `n_all` samples of each pixel are in the first half. The estimate is from the median of the pixels,
/// so that edges, which differ from sample to sample along a few of them, are not taken for grain.
pub fn standard_deviation(pixels: impl Iterator<Item = HalfSums>, n_first: u32, n_all: u32) -> f32 {
    let (n_first, n_second) = (n_first as f32, (n_all - n_first) as f32);
    let square = |HalfSums { first, all, background }| {
        let difference = displayed(first / n_first, background)
            - displayed((all - first) / n_second, background);
        difference.length_squared() / 3.0
    };
    let variance = median(pixels.map(square).collect()) / MEDIAN_SQUARE;
    (variance * n_first * n_second).sqrt() / (n_first + n_second) / STRATIFICATION
}

/// Returns the noise that is not seen beside the contrast between neighbouring pixels, in steps of an 8-bit picture.
///
/// Pixels are in Morton order: each pair are neighbours. Each has `n_all` samples.
pub fn masked_deviation(pixels: impl Iterator<Item = HalfSums>, n_all: u32) -> f32 {
    let shown =
        pixels.map(|HalfSums { all, background, .. }| displayed(all / n_all as f32, background));
    let shown: Vec<Vec3> = shown.collect();
    let (pairs, _) = shown.as_chunks::<2>();
    let squares = pairs.iter().map(|[a, b]| (*a - *b).length_squared() / 3.0);
    MASKED_SHARE * (median(squares.collect()) / MEDIAN_SQUARE).sqrt()
}

/// Returns the median, or 0 if there are no values.
fn median(mut values: Vec<f32>) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Returns a colour as an 8-bit picture shows it, in steps. The square root stands in for the sRGB curve, from which it
/// differs little, and takes less time.
fn displayed(color: Vec4, background: Vec3) -> Vec3 {
    let linear = color.truncate() + (1.0 - color.w) * background;
    255.0 * linear.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt)
}

#[cfg(test)]
mod tests {
    //! Estimates of known noise, and the numbers of samples.

    use super::*;
    use crate::math::Random;

    #[test]
    fn the_estimate_is_the_deviation_of_independent_samples_over_the_factor_of_stratification() {
        let mut random = Random::new(5, 0);
        let mut sample = || {
            let display = 128.0 + 20.0 * random.next_gaussian() as f32;
            Vec3::splat((display / 255.0).powi(2)).extend(1.0)
        };
        let mut pixel = || {
            let samples: [Vec4; 8] = std::array::from_fn(|_| sample());
            let sum = |samples: &[Vec4]| samples.iter().copied().sum();
            HalfSums { first: sum(&samples[..4]), all: sum(&samples), background: Vec3::ZERO }
        };
        let pixels: Vec<HalfSums> = (0..20_000).map(|_| pixel()).collect();
        let found = standard_deviation(pixels.into_iter(), 4, 8) * STRATIFICATION;
        let expected = 20.0 / 8.0f32.sqrt();
        assert!((found / expected - 1.0).abs() < 0.03, "{found} for {expected}");
    }

    #[test]
    fn halves_that_look_the_same_have_no_noise() {
        let white = Vec4::new(1.0, 1.0, 1.0, 1.0);
        let clipped = HalfSums { first: 2.0 * white, all: 8.0 * white, background: Vec3::ZERO };
        let hidden = HalfSums { first: white, all: white, background: Vec3::ONE };
        for pixel in [clipped, hidden] {
            assert_eq!(standard_deviation([pixel].into_iter(), 1, 2), 0.0);
        }
        assert_eq!(standard_deviation(std::iter::empty(), 1, 2), 0.0);
    }

    #[test]
    fn edges_through_a_few_pixels_are_no_noise() {
        let white = Vec4::new(1.0, 1.0, 1.0, 1.0);
        let smooth = HalfSums { first: white, all: 2.0 * white, background: Vec3::ZERO };
        let edge = HalfSums { all: white, ..smooth };
        let block = |n_edge| (0..64).map(move |i| if i < n_edge { edge } else { smooth });
        assert_eq!(standard_deviation(block(16), 1, 2), 0.0);
        assert!(50.0 < standard_deviation(block(48), 1, 2));
    }

    #[test]
    fn contrast_masks_noise() {
        let pixel = |display: f32| {
            let all = Vec3::splat((display / 255.0).powi(2)).extend(1.0);
            HalfSums { first: all, all: 2.0 * all, background: Vec3::ZERO }
        };
        let masked = |low: f32, high: f32| {
            let pixels = (0..64).map(|i| pixel(if i % 2 == 0 { low } else { high }));
            masked_deviation(pixels, 2)
        };
        assert_eq!(masked(100.0, 100.0), 0.0);
        let of_leaves = masked(80.0, 120.0);
        assert!((10.0..25.0).contains(&of_leaves), "{of_leaves}");
        assert_eq!(masked_deviation(std::iter::once(pixel(1.0)), 2), 0.0);
    }

    #[test]
    fn samples_double_up_to_four_times_and_32() {
        let counts = |min| {
            std::iter::successors(Some(min), |n| next_n_samples(*n, min)).collect::<Vec<u32>>()
        };
        assert_eq!(counts(2), [2, 4, 8]);
        assert_eq!(counts(4), [4, 8, 16]);
        assert_eq!(counts(5), [5, 10, 20]);
        assert_eq!(counts(12), [12, 24]);
        assert_eq!(counts(17), [17]);
        assert_eq!(counts(u32::MAX), [u32::MAX]);
    }
}
