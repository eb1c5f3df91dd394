//! Measures a kind of ray: all rays traced several times by all threads, chunk by chunk.

use super::BenchGpu;
use super::BenchScene;
use super::clock::{Elapsed, timed};
use super::rays::{Rays, bounce_rays, shadow_rays};
use super::search::{self, CHUNK, Nearest, Shaded};
use crate::report::Report;
use crate::stats::mrays_per_s;
use serde_json::{Value, json};
use std::sync::{Mutex, PoisonError};
use surfel_core::flat::FlatGeometry;
use surfel_core::math::{Ray, Vec3};
use surfel_core::progress::Progress;
use surfel_core::trace::{Hit, Simd};

/// Data that all measurements share.
pub struct Bench<'a> {
    /// The scene.
    pub scene: &'a BenchScene,
    /// The SIMD level of the kernels.
    pub simd: Simd,
    /// The GPU that is measured; none for the CPU.
    pub gpu: Option<&'a BenchGpu>,
    /// Number of timed runs.
    pub runs: u32,
    /// Position of the light relative to the scene's origin, as all rays are.
    pub light: Vec3,
    /// Camera rays.
    pub primary: Vec<Ray>,
    /// Hits of the camera rays, where all other rays start.
    pub hits: Vec<Hit>,
    /// Cancels the work.
    pub report: &'a Report<'a>,
}

/// Returns the nearest hits, untimed.
pub fn closest_hits(scene: &BenchScene, simd: Simd, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    let find = |rays: &[Ray], hits: &mut [Hit]| search::closest(&scene.geometry, simd, rays, hits);
    for_each_chunk(rays, &mut hits, &find);
    hits
}

impl Bench<'_> {
    /// Measures a kind of rays; returns rays, hits and rates as JSON.
    pub fn measure(&self, kind: Rays) -> surfel_core::Result<Value> {
        let (primary, hits) = (&self.primary, &self.hits);
        let bounces = || bounce_rays(self.scene, primary, hits);
        let shadows = || shadow_rays(self.scene, primary, hits, self.light);
        if let Some(gpu) = self.gpu {
            let rays = match kind {
                Rays::Primary | Rays::Surface | Rays::Gather => primary.clone(),
                Rays::Bounce | Rays::BounceAny => bounces(),
                Rays::Shadow => shadows(),
            };
            return gpu.measure(&self.scene.geometry, &rays, kind, self.runs, self.report);
        }
        match kind {
            Rays::Primary => self.nearest(primary, search::nearest),
            Rays::Surface => self.nearest(primary, search::surface),
            Rays::Bounce => self.nearest(&bounces(), search::nearest),
            Rays::BounceAny => self.any(&bounces()),
            Rays::Shadow => self.any(&shadows()),
            Rays::Gather => self.gather(primary),
        }
    }

    fn nearest(&self, rays: &[Ray], search: Search<Nearest>) -> surfel_core::Result<Value> {
        let (times, found) = self.time(rays, Nearest::MISS, search)?;
        let distances = found.iter().filter(|found| !found.is_miss()).map(|found| found.distance);
        let n_hits = distances.clone().count();
        let mut result = times.json(rays.len(), n_hits);
        let mean = distances.map(f64::from).sum::<f64>() / n_hits as f64;
        result["mean_distance"] = json!(mean);
        Ok(result)
    }

    fn any(&self, rays: &[Ray]) -> surfel_core::Result<Value> {
        let (times, found) = self.time(rays, false, search::any)?;
        Ok(times.json(rays.len(), found.iter().filter(|is_hit| **is_hit).count()))
    }

    fn gather(&self, rays: &[Ray]) -> surfel_core::Result<Value> {
        let (times, found) = self.time(rays, Shaded::EMPTY, search::gather)?;
        let n_discs: f64 = found.iter().map(|found| f64::from(found.n_discs)).sum();
        let n_hits = found.iter().filter(|found| 0.0 < found.n_discs).count();
        let mut result = times.json(rays.len(), n_hits);
        result["hits_per_ray"] = json!(n_discs / n_hits as f64);
        Ok(result)
    }

    /// Searches once untimed, so that all memory is mapped, then in timed runs; returns the results of the last.
    fn time<T: Copy + Send>(
        &self,
        rays: &[Ray],
        nothing: T,
        search: Search<T>,
    ) -> surfel_core::Result<(Times, Vec<T>)> {
        let mut found = vec![nothing; rays.len()];
        let work =
            |rays: &[Ray], found: &mut [T]| search(&self.scene.geometry, self.simd, rays, found);
        for_each_chunk(rays, &mut found, &work);
        let mut runs = Vec::new();
        for _ in 0..self.runs {
            self.report.check()?;
            runs.push(timed(|| for_each_chunk(rays, &mut found, &work)).1);
        }
        Ok((Times::of(&runs), found))
    }
}

/// Searches along a chunk of rays.
type Search<T> = fn(&FlatGeometry, Simd, &[Ray], &mut [T]);

/// Searches along all rays: threads claim chunks until none is left.
fn for_each_chunk<T: Send>(
    rays: &[Ray],
    found: &mut [T],
    work: &(impl Fn(&[Ray], &mut [T]) + Sync),
) {
    let chunks = Mutex::new(rays.chunks(CHUNK).zip(found.chunks_mut(CHUNK)));
    let claim = || chunks.lock().unwrap_or_else(PoisonError::into_inner).next();
    rayon::broadcast(|_| {
        while let Some((rays, found)) = claim() {
            work(rays, found);
        }
    });
}

/// Seconds of a run.
struct Times {
    /// Median of processor time divided by the number of threads, which equals wall time on idle cores.
    median: f64,
    /// Least of the same.
    best: f64,
    best_wall: f64,
}

impl Times {
    fn of(runs: &[Elapsed]) -> Self {
        let n_threads = rayon::current_num_threads() as f64;
        let mut cpu: Vec<f64> = runs.iter().map(|run| run.cpu / n_threads).collect();
        cpu.sort_unstable_by(f64::total_cmp);
        let best_wall = runs.iter().map(|run| run.wall).fold(f64::INFINITY, f64::min);
        Self { median: cpu[cpu.len() / 2], best: cpu[0], best_wall }
    }

    fn json(&self, n_rays: usize, n_hits: usize) -> Value {
        let speed = |secs: f64| mrays_per_s(n_rays as u64, secs);
        json!({
            "rays": n_rays,
            "hits": n_hits,
            "median_mrays_per_s": speed(self.median),
            "best_mrays_per_s": speed(self.best),
            "wall_mrays_per_s": speed(self.best_wall),
        })
    }
}
