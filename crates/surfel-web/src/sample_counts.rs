//! How many samples a pixel of a page's picture gets: those of its settings, then more while the view is at rest.

use crate::scene_provider::PreparedScene;
use surfel_core::render::uses_rasterizer;

/// Numbers of samples at which a picture at rest that goes on after it was finished is sent again.
pub const REST_SAMPLES: [u32; 2] = [16, 64];

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
    if goes_on { REST_SAMPLES[1].max(of_samples) } else { of_samples }
}
