//! The place of the crate `surfel_gpu` in builds without it.

use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, RenderStats, Renderer, Settings};

/// The renderer that builds without GPU support lack.
#[derive(Debug)]
pub(crate) enum GpuRenderer {}

/// The kind of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DeviceKind {
    /// A driver that runs kernels on the processor.
    Software,
}

/// A device on which pictures can be rendered.
#[derive(Clone, Debug)]
pub(crate) struct DeviceInfo {
    /// Name of the device.
    pub name: String,
    /// The kind of device.
    pub kind: DeviceKind,
}

impl GpuRenderer {
    /// Fails, as there is no support of GPUs.
    pub fn open(_: Option<&str>) -> surfel_core::Result<Self> {
        let reason =
            "this build has no GPU support; use the CPU, or build with the feature gpu [backend]";
        Err(surfel_core::Error::Renderer(reason.into()))
    }

    /// Does nothing.
    pub fn with_memory_limit(self, _: Option<u64>) -> Self {
        self
    }

    /// Returns the device.
    pub fn device(&self) -> &DeviceInfo {
        match *self {}
    }
}

impl Renderer for GpuRenderer {
    fn render_region(
        &self,
        _: &FlatScene,
        _: &Settings,
        _: RenderRegion,
        _: &dyn Progress,
    ) -> surfel_core::Result<(Image, RenderStats)> {
        match *self {}
    }
}

/// Returns nothing: there is no device that could lack support for anything.
pub(crate) fn unsupported(_: &FlatScene) -> Vec<String> {
    Vec::new()
}
