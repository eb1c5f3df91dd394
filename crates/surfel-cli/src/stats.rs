//! Numbers about a run, as JSON.

use crate::report;
use anyhow::Context;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use surfel_core::flat::{FlatCloud, FlatMesh, FlatScene};
use surfel_core::render::RenderStats;
use surfel_core::trace::Simd;

/// Seconds that the steps took.
#[derive(Clone, Copy, Default)]
pub struct Seconds {
    /// Reading of all files.
    pub load: f64,
    /// Preparation and colouring of points.
    pub prepare: f64,
    /// Building of the trees.
    pub build: f64,
    /// The whole run.
    pub total: f64,
}

/// A finished run of `render`.
pub struct RunStats<'a> {
    /// The scene as it was traced.
    pub flat: &'a FlatScene,
    /// Points and triangles of the graph.
    pub counts: (usize, usize),
    /// Durations of the steps.
    pub seconds: Seconds,
    /// Rays and times of the renderer.
    pub rendered: RenderStats,
    /// Width and height of the picture.
    pub resolution: (u32, u32),
    /// The SIMD level of the kernels.
    pub simd: Simd,
    /// Name of the GPU; none if the CPU rendered.
    pub gpu: Option<&'a str>,
}

impl RunStats<'_> {
    /// Returns the numbers as JSON.
    pub fn json(&self) -> Value {
        let Seconds { load, prepare, build, total } = self.seconds;
        let (n_points, n_triangles) = self.counts;
        let RenderStats { rays, trace_secs, transfer_secs, frame_secs } = self.rendered;
        json!({
            "points": n_points,
            "triangles": n_triangles,
            "instances": self.flat.instances.len(),
            "seconds": {
                "load": load, "prepare": prepare, "build": build,
                "trace": trace_secs, "transfer": transfer_secs, "frame": frame_secs,
                "total": total,
            },
            "rays": {
                "primary": rays.primary, "shadow": rays.shadow, "sky": rays.sky,
                "secondary": rays.secondary,
            },
            "mrays_per_s": {
                "primary": mrays_per_s(rays.primary, trace_secs),
                "all": mrays_per_s(rays.total(), frame_secs),
            },
            "bytes_per_point": bytes_per_point(self.flat.clouds(), n_points),
            "bytes_per_triangle": bytes_per_triangle(self.flat.meshes(), n_triangles),
            "peak_rss_bytes": peak_rss_bytes(),
            "backend": if self.gpu.is_some() { "gpu" } else { "cpu" },
            "device": self.gpu.map_or_else(device, str::to_owned),
            "threads": rayon::current_num_threads(),
            "simd": self.simd.name(),
            "resolution": [self.resolution.0, self.resolution.1],
        })
    }
}

/// Bytes that tree and points take in the flat form, for each of `n_points`.
pub fn bytes_per_point<'c>(clouds: impl Iterator<Item = &'c FlatCloud>, n_points: usize) -> Value {
    let (tree, points) = sum(clouds.map(|cloud| cloud.bytes()));
    let [tree, points] = [tree, points].map(|bytes| bytes as f64 / n_points.max(1) as f64);
    json!({ "tree": tree, "points": points, "total": tree + points })
}

/// Bytes that tree and triangles take in the flat form, for each of `n_triangles`.
pub fn bytes_per_triangle<'m>(
    meshes: impl Iterator<Item = &'m FlatMesh>,
    n_triangles: usize,
) -> Value {
    let (tree, triangles) = sum(meshes.map(|mesh| mesh.triangles.bytes()));
    let [tree, triangles] = [tree, triangles].map(|bytes| bytes as f64 / n_triangles.max(1) as f64);
    json!({ "tree": tree, "triangles": triangles, "total": tree + triangles })
}

fn sum(pairs: impl Iterator<Item = (usize, usize)>) -> (usize, usize) {
    pairs.fold((0, 0), |(a, b), (c, d)| (a + c, b + d))
}

/// Most memory ever held, where the system tells it.
pub fn peak_rss_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kilobytes)
}

/// Name of the processor.
pub fn device() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find(|line| line.starts_with("model name"));
    let model = model.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim().to_owned());
    model.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// Million a second; none took no time.
pub fn mrays_per_s(n_rays: u64, secs: f64) -> Option<f64> {
    (0.0 < secs && 0 < n_rays).then(|| n_rays as f64 / secs / 1e6)
}

/// Writes numbers to a file, or to stdout for `-`.
pub fn write(path: &Path, stats: &Value) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(stats)?;
    if path == Path::new("-") {
        return report::print(&text).context("stdout cannot be written");
    }
    Ok(surfel_formats::save_text(path, &(text + "\n"))?)
}
