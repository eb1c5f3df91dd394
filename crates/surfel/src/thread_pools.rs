//! Pools of threads beside those of all work.

use crate::description::RunSettings;
use crate::error::{Error, Result};
use rayon::ThreadPool;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, RenderStats, Renderer, Settings};
use thread_priority::ThreadPriority;

/// Starts as many threads as the settings ask for, or else as the current pool has; each begins with `start`.
///
/// # Errors
///
/// Fails if the system denies them.
pub fn start_threads(settings: &RunSettings, start: fn(usize)) -> Result<ThreadPool> {
    let n_threads = settings.threads.map_or_else(rayon::current_num_threads, |n| n as usize);
    let threads =
        rayon::ThreadPoolBuilder::new().num_threads(n_threads).start_handler(start).build();
    let advice = "the threads cannot be started; ask for fewer with --threads";
    threads.map_err(|error| Error::Unfit(format!("{advice}: {error}")))
}

/// Gives the current thread the processor time that others leave. A system that denies this shares time evenly.
pub fn lower_priority() {
    let _ = ThreadPriority::Min.set_for_current();
}

/// A renderer that works on threads of its own.
pub struct RendererOnThreads<R> {
    renderer: R,
    threads: ThreadPool,
}

impl<R> RendererOnThreads<R> {
    /// Starts as many threads as the settings ask for, or else as the current pool has.
    ///
    /// # Errors
    ///
    /// Fails if the system denies them.
    pub fn new(renderer: R, settings: &RunSettings) -> Result<Self> {
        Ok(Self { renderer, threads: start_threads(settings, |_| ())? })
    }
}

impl<R: Renderer> Renderer for RendererOnThreads<R> {
    fn render_region(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> surfel_core::Result<(Image, RenderStats)> {
        self.threads.install(|| self.renderer.render_region(scene, settings, region, progress))
    }
}
