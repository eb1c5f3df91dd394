//! Pools of threads: those of all work, and others beside them.

use crate::description::RunSettings;
use crate::error::{Error, Result};
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
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
    let builder = ThreadPoolBuilder::new().num_threads(n_threads).start_handler(start);
    builder.build().map_err(denied)
}

/// Starts the threads of all work to come: as many as the settings ask for, or else as there are processors.
///
/// # Errors
///
/// Fails if the system denies them, and if those of all work run already.
pub fn start_global_threads(settings: &RunSettings) -> Result<()> {
    let n_threads = settings.threads.unwrap_or(0) as usize;
    ThreadPoolBuilder::new().num_threads(n_threads).build_global().map_err(denied)
}

fn denied(error: ThreadPoolBuildError) -> Error {
    Error::Threads(error.to_string())
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
