//! Measures rays on a GPU: the CPU's rays, traced several times, without the transfers.

use super::rays::Rays;
use crate::report::Report;
use crate::stats::mrays_per_s;
use serde_json::{Value, json};
use std::sync::Arc;
use surfel::description::RunSettings;
use surfel::surfel_gpu::{GpuRenderer, TimedQuery, Timing};
use surfel_core::flat::FlatGeometry;
use surfel_core::math::Ray;

/// An opened GPU.
pub struct BenchGpu(GpuRenderer);

impl BenchGpu {
    /// Opens the GPU that the settings name, or the first one.
    pub fn open(settings: &RunSettings) -> anyhow::Result<Self> {
        let renderer = GpuRenderer::open(settings.device.as_deref())?;
        Ok(Self(renderer.with_memory_limit(settings.memory_limit)))
    }

    /// Returns the name of the device.
    pub fn name(&self) -> String {
        self.0.device().name.clone()
    }

    /// Measures a kind of rays; returns rays, hits, rates and transfers as JSON.
    pub fn measure(
        &self,
        geometry: &Arc<FlatGeometry>,
        rays: &[Ray],
        kind: Rays,
        n_runs: u32,
        report: &Report,
    ) -> surfel_core::Result<Value> {
        let query = match kind {
            Rays::Primary | Rays::Bounce => TimedQuery::Nearest,
            Rays::Shadow | Rays::BounceAny => TimedQuery::Any,
            Rays::Gather => TimedQuery::Gather,
            Rays::Surface => TimedQuery::Surface,
        };
        let times = self.0.time_rays(Timing { geometry, rays, query, n_runs }, report)?;
        let found = times.distances.iter().filter(|distance| distance.is_finite());
        let n_hits = found.clone().count();
        let mut secs = times.run_secs;
        secs.sort_unstable_by(f64::total_cmp);
        let speed = |secs: f64| mrays_per_s(rays.len() as u64, secs);
        let mut result = json!({
            "rays": rays.len(),
            "hits": n_hits,
            "median_mrays_per_s": speed(secs[secs.len() / 2]),
            "best_mrays_per_s": speed(secs[0]),
            "wall_mrays_per_s": speed(secs[0]),
            "geometry_upload_s": times.geometry_upload_secs,
            "ray_transfer_s": times.ray_transfer_secs,
        });
        if matches!(query, TimedQuery::Nearest | TimedQuery::Surface) {
            let sum: f64 = found.map(|distance| f64::from(*distance)).sum();
            result["mean_distance"] = json!(sum / n_hits as f64);
        }
        Ok(result)
    }
}
