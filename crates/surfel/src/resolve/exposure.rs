//! Automatic exposure: a small preview shows how bright the median and the highlights of the scene are.

use surfel_core::flat::FlatScene;
use surfel_core::math::{median, quantile};
use surfel_core::progress::Progress;
use surfel_core::render::{Renderer, Settings};

/// Linear value of the highlights: sRGB 91 %, which leaves white roofs and foreheads their shape.
const HIGHLIGHT_TARGET: f32 = 0.8;

/// Linear value below which the median is too dark: sRGB 42 %.
const MIN_MEDIAN: f32 = 0.15;

/// Greatest factor by which highlights exceed their target to brighten a dark median.
const MAX_EXCESS: f32 = 1.4;

/// Fraction of the covered pixels that stay below white where a dark median is brightened.
const UNCLIPPED_PERCENTILE: f64 = 0.98;

/// Fraction of the covered pixels that are darker than the highlights.
const HIGHLIGHT_PERCENTILE: f64 = 0.99;

/// Least and greatest number of stops: a black object must not turn white.
const LIMITS: (f32, f32) = (-1.0, 2.2);

/// Width of the preview in pixels.
const WIDTH: u32 = 200;

/// Returns the stops by which the lights of `scene` are too dark.
pub fn automatic_exposure(
    renderer: &dyn Renderer,
    scene: &FlatScene,
    settings: &Settings,
    progress: &dyn Progress,
) -> surfel_core::Result<f32> {
    let height = u64::from(WIDTH) * u64::from(settings.height) / u64::from(settings.width);
    let preview = Settings {
        width: WIDTH,
        height: height.clamp(1, 4 * u64::from(WIDTH)) as u32,
        samples_per_pixel: 1,
        with_aovs: false,
        ..*settings
    };
    let (image, _) = renderer.render(scene, &preview, progress)?;
    let covered = image.color.iter().zip(&image.coverage).filter(|(_, c)| 0.0 < **c);
    // The strongest channel, not luminance: a meadow whose green is cut off turns to neon.
    Ok(stops(covered.map(|([r, g, b, _], _)| r.max(*g).max(*b)).collect()))
}

fn stops(values: Vec<f32>) -> f32 {
    let Some(highlights) = quantile(values.iter().copied(), HIGHLIGHT_PERCENTILE) else {
        return 0.0;
    };
    let unclipped = quantile(values.iter().copied(), UNCLIPPED_PERCENTILE).unwrap_or(highlights);
    let for_highlights = HIGHLIGHT_TARGET / highlights.max(1e-6);
    let for_unclipped = 1.0 / unclipped.max(1e-6);
    let for_median = MIN_MEDIAN / median(values).map_or(1e-6, |median| median.max(1e-6));
    let gain = for_highlights.max(for_median.min(MAX_EXCESS * for_highlights).min(for_unclipped));
    gain.log2().clamp(LIMITS.0, LIMITS.1)
}

#[cfg(test)]
mod tests {
    //! The stops for known pictures.

    use super::*;

    #[test]
    fn stops_bring_the_highlights_to_the_target() {
        assert_eq!(stops(vec![]), 0.0);
        assert_eq!(stops(vec![HIGHLIGHT_TARGET / 2.0; 50]), 1.0);
        assert_eq!((stops(vec![0.0; 50]), stops(vec![9.0; 50])), (LIMITS.1, LIMITS.0));
        let mut with_glint = vec![HIGHLIGHT_TARGET / 2.0; 199];
        with_glint.push(100.0);
        assert_eq!(stops(with_glint), 1.0);
    }

    #[test]
    fn a_dark_median_brightens_the_picture_by_half_a_stop_at_most() {
        let stops_of = |median: f32| {
            let mut values = vec![median; 985];
            values.extend([HIGHLIGHT_TARGET; 15]);
            stops(values)
        };
        assert_eq!(stops_of(MIN_MEDIAN), 0.0);
        assert!((stops_of(MIN_MEDIAN / 1.2) - 1.2f32.log2()).abs() < 1e-4);
        assert!((stops_of(0.01) - MAX_EXCESS.log2()).abs() < 1e-4);
    }

    #[test]
    fn a_dark_median_does_not_turn_more_than_a_fiftieth_of_the_picture_white() {
        let mut values = vec![0.01; 900];
        values.extend([HIGHLIGHT_TARGET; 100]);
        assert!((stops(values) - (1.0 / HIGHLIGHT_TARGET).log2()).abs() < 1e-4);
    }
}
