//! Automatic exposure: a small preview shows how bright the brightest parts of the scene are.

use surfel_core::flat::FlatScene;
use surfel_core::progress::Progress;
use surfel_core::render::{Renderer, Settings};

/// Linear value that the brightest parts get: below white, which leaves highlights their shape.
const TARGET: f32 = 0.74;

/// Fraction of the covered pixels that are darker.
const PERCENTILE: f32 = 0.95;

/// Least and greatest number of stops: a black object must not turn white.
const LIMITS: (f32, f32) = (-1.0, 1.5);

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

fn stops(mut values: Vec<f32>) -> f32 {
    let rank = (PERCENTILE * values.len() as f32) as usize;
    if values.len() <= rank {
        return 0.0;
    }
    let bright = *values.select_nth_unstable_by(rank, f32::total_cmp).1;
    (TARGET / bright.max(1e-6)).log2().clamp(LIMITS.0, LIMITS.1)
}

#[cfg(test)]
mod tests {
    //! The stops for known pictures.

    use super::*;

    #[test]
    fn stops_bring_the_bright_parts_to_the_target() {
        assert_eq!(stops(vec![]), 0.0);
        assert_eq!(stops(vec![TARGET / 2.0; 50]), 1.0);
        assert_eq!((stops(vec![0.0; 50]), stops(vec![9.0; 50])), (LIMITS.1, LIMITS.0));
        let mut mostly_dark = vec![TARGET / 2.0; 99];
        mostly_dark.push(100.0);
        assert_eq!(stops(mostly_dark), 1.0);
    }
}
