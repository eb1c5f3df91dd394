//! The trait of all renderers, and the statistics that they return.

use super::region::RenderRegion;
use super::settings::Settings;
use crate::error::Result;
use crate::flat::FlatScene;
use crate::image::Image;
use crate::integrator::RayCounts;
use crate::progress::Progress;

/// Numbers of rays and times of one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderStats {
    /// Numbers of rays traced.
    pub rays: RayCounts,
    /// Seconds spent in the search for the nearest hits of primary rays: the sum over all threads, divided
    /// by their number. 0 on a device that does not measure it.
    pub trace_secs: f64,
    /// Seconds in which the last finished pixels came back from a device; 0 on the CPU.
    pub transfer_secs: f64,
    /// Seconds for the whole picture, from a flat scene.
    pub frame_secs: f64,
}

/// A renderer of flat scenes.
pub trait Renderer: Sync {
    /// Renders the pixels of `region`, each as the mean of the region's samples alone.
    ///
    /// # Errors
    ///
    /// Fails if `settings` or `region` are out of range, if the scene cannot be rendered (see
    /// [`check`](super::check)), or once `progress` is cancelled.
    fn render_region(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> Result<(Image, RenderStats)>;

    /// Renders the whole picture.
    ///
    /// # Errors
    ///
    /// Fails as [`Renderer::render_region`] does.
    fn render(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<(Image, RenderStats)> {
        self.render_region(scene, settings, RenderRegion::whole(settings), progress)
    }
}
