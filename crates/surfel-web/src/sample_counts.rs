//! How many samples a pixel of a page's picture gets: those of its settings, then more while the view is at rest.

use crate::scene_provider::PreparedScene;
use surfel_core::render::uses_rasterizer;

/// Number of samples that a picture at rest goes on to after it was finished.
const REST_SAMPLES: u32 = 64;
/// Maximum number of samples that are rendered at once. Rays of one pixel share more work than those of its neighbours do;
/// beyond four samples a pass gains little.
const SAMPLES_AT_ONCE: u32 = 4;

/// How far a picture is refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// To the samples of the settings.
    Finish,
    /// To those of a picture at rest.
    Rest,
}

/// Returns the number of samples of a finished picture. All samples of rasterised points are equal.
pub fn of_samples(prepared: &PreparedScene) -> u32 {
    let is_rasterized = uses_rasterizer(&prepared.flat).unwrap_or(false);
    if is_rasterized { 1 } else { prepared.render_settings.samples_per_pixel }
}

/// Returns the number of samples that a picture at rest goes on to after it was finished.
pub fn rest_samples(prepared: &PreparedScene) -> u32 {
    let of_samples = of_samples(prepared);
    let goes_on =
        prepared.goes_on_at_rest && of_samples == prepared.render_settings.samples_per_pixel;
    if goes_on { REST_SAMPLES.max(of_samples) } else { of_samples }
}

/// Returns the number of samples that a picture of `n_samples` has after one more pass: the first one, then up to four at
/// once.
pub fn after_pass(n_samples: u32, target: u32) -> u32 {
    let end = match n_samples {
        0 => 1,
        _ => (n_samples / SAMPLES_AT_ONCE + 1) * SAMPLES_AT_ONCE,
    };
    end.min(target)
}

/// Returns whether a picture is sent at this number of samples: each has four times as many as the one before.
pub fn is_sent(n_samples: u32, of_samples: u32) -> bool {
    n_samples == of_samples || n_samples.is_power_of_two() && n_samples.ilog2().is_multiple_of(2)
}

#[cfg(test)]
mod tests {
    //! Passes and the pictures that are sent after them.

    use super::*;

    #[test]
    fn pictures_are_sent_after_one_four_and_sixteen_samples() {
        let passes = |target: u32| {
            let next = |n: &u32| (*n < target).then(|| after_pass(*n, target));
            std::iter::successors(Some(after_pass(0, target)), next).collect::<Vec<u32>>()
        };
        assert_eq!(passes(1), [1]);
        assert_eq!(passes(6), [1, 4, 6]);
        assert_eq!(passes(16), [1, 4, 8, 12, 16]);
        let sent: Vec<u32> = (1..=64).filter(|n| is_sent(*n, 6)).collect();
        assert_eq!(sent, [1, 4, 6, 16, 64]);
    }
}
