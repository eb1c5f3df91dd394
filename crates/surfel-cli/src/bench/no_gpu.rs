//! The place of the measurements on a GPU in builds without it.

use super::rays::Rays;
use crate::report::Report;
use serde_json::Value;
use std::sync::Arc;
use surfel::description::RunSettings;
use surfel_core::flat::FlatGeometry;
use surfel_core::math::Ray;

/// The GPU that builds without GPU support lack.
pub(crate) enum BenchGpu {}

impl BenchGpu {
    /// Fails, as there is no support of GPUs.
    pub fn open(_: &RunSettings) -> anyhow::Result<Self> {
        anyhow::bail!(
            "this build has no GPU support; use --backend cpu, or build with the feature gpu"
        )
    }

    /// Returns the name of the device.
    pub fn name(&self) -> String {
        match *self {}
    }

    /// Measures a kind of rays.
    pub fn measure(
        &self,
        _: &Arc<FlatGeometry>,
        _: &[Ray],
        _: Rays,
        _: u32,
        _: &Report,
    ) -> surfel_core::Result<Value> {
        match *self {}
    }
}
