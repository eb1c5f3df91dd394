//! Adaptive sampling: blocks of pixels whose error is below a threshold take no further samples (Dammertz et al., A
//! Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination, 2010).
//!
//! Errors are estimated after fixed numbers of samples, in blocks at fixed places of the picture, so that pictures depend
//! neither on threads nor on regions.

use super::region::RenderRegion;
use super::settings::Settings;
use crate::math::Vec4;
use std::ops::Range;

/// Side of a block in pixels.
const BLOCK_SIZE: u32 = 8;
/// Number of samples per pixel before the first estimate; the next ones follow whenever it has doubled.
pub const MIN_ADAPTIVE_SAMPLES: u32 = 8;
/// Least brightness by which errors are divided: noise below it is not seen.
const MIN_BRIGHTNESS: f32 = 0.01;

/// Returns true if some blocks of a region may take fewer samples than others: not in a part of the samples.
pub fn is_adaptive(settings: &Settings, region: RenderRegion) -> bool {
    let is_whole = region.samples == RenderRegion::whole(settings).samples;
    0.0 < settings.noise_threshold && is_whole && MIN_ADAPTIVE_SAMPLES < settings.samples_per_pixel
}

/// Returns the region with all pixels of its blocks.
pub fn with_whole_blocks(region: RenderRegion, settings: &Settings) -> RenderRegion {
    let widened = |(first, end): (u32, u32), size: u32| {
        (first - first % BLOCK_SIZE, end.next_multiple_of(BLOCK_SIZE).min(size))
    };
    RenderRegion {
        rows: widened(region.rows, settings.height),
        columns: widened(region.columns, settings.width),
        ..region
    }
}

/// Returns the indices of the samples after the first `MIN_ADAPTIVE_SAMPLES / 2`: as many as before each time, to the last.
pub fn parts(n_samples: u32) -> impl Iterator<Item = Range<u32>> {
    let starts = std::iter::successors(Some(MIN_ADAPTIVE_SAMPLES / 2), |n| n.checked_mul(2));
    let starts = starts.take_while(move |start| *start < n_samples);
    starts.map(move |start| start..start.saturating_mul(2).min(n_samples))
}

/// Returns the number of the block of a pixel, which its neighbours of the same block share.
pub fn block(x: u32, y: u32) -> (u32, u32) {
    (x / BLOCK_SIZE, y / BLOCK_SIZE)
}

/// Returns the square of a pixel's standard error: of its alpha, or of its brightness relative to the square root of that,
/// which the eye perceives alike in light and shade, if it is greater. It follows from the means over all samples and over
/// their first half. 0.01 is about one of 255 steps.
pub fn squared_error(mean: Vec4, mean_of_half: Vec4) -> f32 {
    let difference = (mean - mean_of_half).abs();
    let of_color = difference.truncate().element_sum() / 3.0;
    let brightness = mean.truncate().element_sum() / 3.0;
    let of_color = of_color * of_color / brightness.max(MIN_BRIGHTNESS);
    of_color.max(difference.w * difference.w)
}

#[cfg(test)]
mod tests {
    //! Fixed numbers of samples, and blocks of the whole picture.

    use super::*;

    #[test]
    fn each_part_has_as_many_samples_as_all_before() {
        let ranges = |n| parts(n).collect::<Vec<_>>();
        assert_eq!(ranges(64), [4..8, 8..16, 16..32, 32..64]);
        assert_eq!(ranges(40), [4..8, 8..16, 16..32, 32..40]);
        assert_eq!(ranges(9), [4..8, 8..9]);
    }

    #[test]
    fn regions_are_widened_to_blocks_of_the_picture() {
        let settings = Settings { width: 70, height: 50, ..Settings::default() };
        let region = RenderRegion { rows: (7, 41), columns: (8, 69), samples: (0, 4) };
        let RenderRegion { rows, columns, .. } = with_whole_blocks(region, &settings);
        assert_eq!((rows, columns), ((0, 48), (8, 70)));
    }

    #[test]
    fn errors_of_a_constant_are_zero_and_relative_to_brightness() {
        let gray = |brightness: f32| Vec4::new(brightness, brightness, brightness, 1.0);
        assert_eq!(squared_error(gray(0.5), gray(0.5)), 0.0);
        let error = squared_error(gray(0.25), gray(0.26)).sqrt();
        assert!((error - 0.02).abs() < 1e-5, "{error}");
        assert!(squared_error(gray(0.0), gray(0.001)).is_finite());
        let black = |alpha: f32| Vec4::new(0.0, 0.0, 0.0, alpha);
        assert_eq!(squared_error(black(0.75), black(0.25)), 0.25);
    }
}
