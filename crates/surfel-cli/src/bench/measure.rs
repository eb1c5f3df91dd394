//! Measures a kind of ray: all rays traced several times by all threads, chunk by chunk.

use super::Stage;
use super::clock::{Spent, timed};
use super::rays::{bounce_rays, shadow_rays};
use super::search::{self, CHUNK, Nearest, Shaded};
use crate::report::Report;
use crate::stats::mrays_per_s;
use clap::ValueEnum;
use serde_json::{Value, json};
use std::sync::{Mutex, PoisonError};
use surfel::flat::FlatGeometry;
use surfel::math::{Ray, Vec3};
use surfel::progress::Progress;
use surfel::trace::{Hit, Simd};

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Rays {
    /// Camera rays, nearest disc, sphere or triangle.
    Primary,
    /// From each hit to a light at one point: is anything between?
    Shadow,
    /// From each hit in one random direction: is anything there?
    BounceAny,
    /// The same, nearest disc, sphere or triangle.
    Bounce,
    /// Camera rays, up to 16 discs within a radius behind the nearest, and the mean of their normals.
    Gather,
    /// Camera rays, the finished surface with its boundary.
    Surface,
}

/// What all measurements share.
pub struct Bench<'a> {
    pub stage: &'a Stage,
    pub simd: Simd,
    pub runs: u32,
    /// Relative to the stage's origin, as all rays are.
    pub light: Vec3,
    pub primary: Vec<Ray>,
    /// Of the primary rays, where all others start.
    pub hits: Vec<Hit>,
    pub report: &'a Report<'a>,
}

/// The nearest hits, untimed.
pub fn closest_hits(stage: &Stage, simd: Simd, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    let find = |rays: &[Ray], hits: &mut [Hit]| search::closest(&stage.geometry, simd, rays, hits);
    for_each_chunk(rays, &mut hits, &find);
    hits
}

impl Bench<'_> {
    /// Rays, hits and rates of a kind, as JSON.
    pub fn measure(&self, kind: Rays) -> surfel::Result<Value> {
        let (primary, hits) = (&self.primary, &self.hits);
        let bounces = || bounce_rays(self.stage, primary, hits);
        match kind {
            Rays::Primary => self.nearest(primary, search::nearest),
            Rays::Surface => self.nearest(primary, search::surface),
            Rays::Bounce => self.nearest(&bounces(), search::nearest),
            Rays::BounceAny => self.any(&bounces()),
            Rays::Shadow => self.any(&shadow_rays(self.stage, primary, hits, self.light)),
            Rays::Gather => self.gather(primary),
        }
    }

    fn nearest(&self, rays: &[Ray], search: Search<Nearest>) -> surfel::Result<Value> {
        let (times, found) = self.time(rays, Nearest::MISS, search)?;
        let distances = found.iter().filter(|found| !found.is_miss()).map(|found| found.distance);
        let n_hits = distances.clone().count();
        let mut result = times.json(rays.len(), n_hits);
        let mean = distances.map(f64::from).sum::<f64>() / n_hits as f64;
        result["mean_distance"] = json!(mean);
        Ok(result)
    }

    fn any(&self, rays: &[Ray]) -> surfel::Result<Value> {
        let (times, found) = self.time(rays, false, search::any)?;
        Ok(times.json(rays.len(), found.iter().filter(|is_hit| **is_hit).count()))
    }

    fn gather(&self, rays: &[Ray]) -> surfel::Result<Value> {
        let (times, found) = self.time(rays, Shaded::EMPTY, search::gather)?;
        let n_discs: f64 = found.iter().map(|found| f64::from(found.n_discs)).sum();
        let n_hits = found.iter().filter(|found| 0.0 < found.n_discs).count();
        let mut result = times.json(rays.len(), n_hits);
        result["hits_per_ray"] = json!(n_discs / n_hits as f64);
        Ok(result)
    }

    /// Once untimed, so that all memory is there, then as often as asked for; what was found last.
    fn time<T: Copy + Send>(
        &self,
        rays: &[Ray],
        nothing: T,
        search: Search<T>,
    ) -> surfel::Result<(Times, Vec<T>)> {
        let mut found = vec![nothing; rays.len()];
        let work =
            |rays: &[Ray], found: &mut [T]| search(&self.stage.geometry, self.simd, rays, found);
        for_each_chunk(rays, &mut found, &work);
        let mut runs = Vec::new();
        for _ in 0..self.runs {
            self.report.check()?;
            runs.push(timed(|| for_each_chunk(rays, &mut found, &work)).1);
        }
        Ok((Times::of(&runs), found))
    }
}

/// Answers a chunk of rays.
type Search<T> = fn(&FlatGeometry, Simd, &[Ray], &mut [T]);

/// All threads claim chunks until none is left.
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

/// Seconds a run.
struct Times {
    /// Of the processor, shared among the threads: equal to those of the wall on idle cores.
    median: f64,
    best: f64,
    best_wall: f64,
}

impl Times {
    fn of(runs: &[Spent]) -> Self {
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
