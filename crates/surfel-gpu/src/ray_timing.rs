//! Timed searches along given rays, for benchmarks.

use crate::device::{DeviceKind, Gpu};
use crate::error::{Error, Result};
use crate::job::max_entries;
use crate::kernel_times::KernelTimes;
use crate::kernels::Kernels;
use crate::numbers::queue;
use crate::numbers::ray_kind;
use crate::numbers::{NO_LIMIT, NONE};
use crate::passes::{Pass, Passes, Size};
use crate::records::{FrameRecord, Path, SearchState, Task, Visit};
use crate::scene_records::SceneRecords;
use crate::search::{ANY, CLOSEST, SearchKernels, SearchStep};
use crate::shader::Kernel;
use crate::submitter::{Bound, Submitter, bind_trees};
use crate::surface::Surface;
use crate::tree_visits::lone_visit;
use crate::unsupported::{surface_name, trees};
use crate::upload::{GpuTree, TreeRef, Uploads};
use crate::wavefront::{Arrays, Capacities, Contents, Wavefront, written};
use bytemuck::Zeroable;
use std::sync::Arc;
use std::time::Instant;
use surfel_core::flat::FlatGeometry;
use surfel_core::math::Ray;
use surfel_core::progress::Progress;

/// The question that rays ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimedQuery {
    /// The nearest disc, sphere or triangle.
    Nearest,
    /// Whether there is any disc, sphere or triangle.
    Any,
    /// The blend of the discs within a radius behind the nearest.
    Gather,
    /// The finished surface, with its edge test, lines and scatter.
    Surface,
}

/// The result of timed searches.
#[derive(Clone, Debug, Default)]
pub struct RayTimes {
    /// Seconds of each run: from the command to the end of the device's work, without transfers.
    pub run_secs: Vec<f64>,
    /// Seconds in which points or triangles went to the device; 0 if they were there.
    pub geometry_upload_secs: f64,
    /// Seconds in which rays went to the device and results came back, for one run.
    pub ray_transfer_secs: f64,
    /// Distance to what each ray found; infinite if that is nothing, 0 if it is not asked for.
    pub distances: Vec<f32>,
}

/// Maximum number of rays that are traced at once on a software device, which must finish them within the limit of a wait.
const MAX_SOFTWARE_RAYS: usize = 1 << 18;

/// Searches to be timed.
#[derive(Clone, Copy, Debug)]
pub struct Timing<'a> {
    /// The points or triangles.
    pub geometry: &'a Arc<FlatGeometry>,
    /// The rays in their coordinates.
    pub rays: &'a [Ray],
    /// The question.
    pub query: TimedQuery,
    /// Number of timed runs.
    pub n_runs: u32,
}

/// Times searches. The first run, in which memory is mapped, does not count.
pub fn time(
    gpu: &Gpu,
    kernels: &mut Kernels,
    (uploads, arrays): (&mut Uploads, &mut Option<Arrays>),
    timing: Timing,
    progress: &dyn Progress,
) -> surfel_core::Result<RayTimes> {
    let mut searches = searches(timing.geometry, timing.query);
    let geometries = std::slice::from_ref(timing.geometry);
    let max_rays = match gpu.info.kind {
        DeviceKind::Software => MAX_SOFTWARE_RAYS,
        _ => max_entries(gpu) as usize,
    };
    let n = timing.rays.len().min(max_rays) as u32;
    let sizes = Capacities { n_pixels: n, n_entries: n, has_waves: false, is_transmissive: false };
    let fits_memory = |sizes| uploads.check_memory(gpu, geometries, Arrays::n_bytes(sizes)).is_ok();
    let found = Arrays::free_unless_fitting(arrays, gpu, sizes, fits_memory)?;
    let secs_before = uploads.time.secs;
    uploads.update(gpu, geometries, Arrays::n_bytes(found), progress)?;
    let mut times = RayTimes {
        geometry_upload_secs: uploads.time.secs - secs_before,
        run_secs: vec![0.0; timing.n_runs as usize],
        ..RayTimes::default()
    };
    let tree = |tree| uploads.tree(geometries, tree);
    // Empty trees are not uploaded.
    searches.retain(|search| tree(search.tree).is_some());
    let passes = passes(&searches);
    let is_paged = |pass: &Pass| pass.tree.and_then(tree).is_some_and(GpuTree::is_paged);
    let needed = passes.all().map(|pass| (pass.kernel, is_paged(pass)));
    kernels.compile(gpu, needed, progress)?;
    let kernels = &*kernels;
    let trees = bind_trees(gpu, kernels, tree, &passes)?;
    let arrays = Arrays::update(arrays, gpu, sizes)?;
    let records = SceneRecords::empty();
    let words = written(gpu, "textures", &[0; 4], wgpu::BufferUsages::STORAGE)?;
    let contents = Contents { scene: &records, words: &words, tasks: &passes.tasks };
    let wavefront = Wavefront::new(gpu, kernels, arrays, contents)?;
    let bound = Bound { kernels, wavefront: &wavefront, trees: &trees };
    let mut kernel_times = KernelTimes::default();
    let mut submitter = Submitter::new(gpu, bound, &mut kernel_times, progress)?;
    for rays in timing.rays.chunks(max_rays) {
        let n = rays.len() as u32;
        wavefront.set_frame(gpu, &FrameRecord { n_rays: n, capacity: n, ..Zeroable::zeroed() });
        submitter.n_pixels = n;
        let paths: Vec<Path> = rays.iter().map(path).collect();
        for run in 0..=timing.n_runs {
            let start = Instant::now();
            wavefront.write_paths(gpu, &paths);
            wavefront.fill_paths(gpu, n);
            finish(gpu, &mut submitter, &passes.camera)?;
            times.ray_transfer_secs += start.elapsed().as_secs_f64() / f64::from(timing.n_runs + 1);
            let start = Instant::now();
            finish(gpu, &mut submitter, &passes.trace)?;
            if let Some(before) = run.checked_sub(1) {
                times.run_secs[before as usize] += start.elapsed().as_secs_f64();
            }
        }
        let start = Instant::now();
        times.distances.extend(results(gpu, &wavefront, &searches, timing.query, n)?);
        times.ray_transfer_secs += start.elapsed().as_secs_f64();
    }
    Ok(times)
}

/// Returns a path along a ray, which has found nothing yet.
fn path(ray: &Ray) -> Path {
    let ray = Ray { t_max: ray.t_max.min(NO_LIMIT), ..*ray };
    Path { ray, state: 1, ..Zeroable::zeroed() }
}

/// Runs passes, and waits for the end.
fn finish(gpu: &Gpu, submitter: &mut Submitter, passes: &[Pass]) -> surfel_core::Result<()> {
    submitter.add(passes)?;
    submitter.flush()?;
    Ok(gpu.wait()?)
}

/// A search in one tree.
struct Search {
    query: TimedQuery,
    surface: Surface,
    kernels: SearchKernels,
    tree: TreeRef,
    visit: Visit,
}

impl Search {
    fn steps(&self) -> Vec<SearchStep> {
        match self.disc_only_kernel() {
            Some(kernel) => vec![SearchStep::Search { kernel, round: 0 }],
            None => self.kernels.steps(self.surface, 1),
        }
    }

    /// Returns the kernel that finds no more than a disc, if that is the question.
    fn disc_only_kernel(&self) -> Option<Kernel> {
        (self.surface == Surface::DiscRims && self.query != TimedQuery::Surface)
            .then_some(self.kernels.disc)
    }
}

/// Returns the searches that answer a question.
fn searches(geometry: &FlatGeometry, query: TimedQuery) -> Vec<Search> {
    let kernels = if query == TimedQuery::Any { ANY } else { CLOSEST };
    let search = |tree_idx, surface| {
        let visit = lone_visit(geometry, tree_idx);
        let visit = match query {
            TimedQuery::Surface => visit,
            _ => Visit { has_edge_test: 0, min_discs: 1, ..visit },
        };
        let tree = TreeRef::Geometry { geometry_idx: 0, tree_idx };
        Search { query, surface, kernels, tree, visit }
    };
    let cloud = match geometry {
        FlatGeometry::Mesh(_) => return vec![search(0, Surface::Triangle)],
        FlatGeometry::Cloud(cloud) => cloud,
    };
    match query {
        TimedQuery::Surface => {
            let shown = trees(cloud).into_iter().enumerate();
            let shown = shown.filter(|(_, (_, points))| !points.nodes.is_empty());
            let surfaces =
                shown.filter_map(|(i, (kind, _))| Some((i, Surface::of_kind(kind, cloud)?)));
            surfaces.map(|(i, surface)| search(i, surface)).collect()
        }
        TimedQuery::Gather => vec![search(0, Surface::SplatRims)],
        _ if cloud.surface.uses_discs() => vec![search(0, Surface::DiscRims)],
        _ => vec![search(0, Surface::Sphere)],
    }
}

/// Returns the passes of searches: first those that set all hits to misses, in the place of the passes of a camera.
fn passes(searches: &[Search]) -> Passes {
    let mut passes = Passes {
        visits: searches.iter().map(|search| search.visit).collect(),
        ..Passes::default()
    };
    let take = passes.take(queue::PATHS, ray_kind::UNCOUNTED);
    let task = Task { queue: queue::PATHS, ..Task::default() };
    passes.camera = vec![take, passes.pass(Kernel::ClearHits, Size::Pixels, task)];
    for (search, first) in searches.iter().zip(0..) {
        let found = passes.search(&search.steps(), search.tree, &(first..first + 1), queue::PATHS);
        passes.trace.extend(found);
    }
    passes
}

/// Returns the distances to what was found on the first `n` rays.
fn results(
    gpu: &Gpu,
    wavefront: &Wavefront,
    searches: &[Search],
    query: TimedQuery,
    n: u32,
) -> Result<Vec<f32>> {
    let found = |is_hit, distance| if is_hit { distance } else { f32::INFINITY };
    let finds_discs =
        !searches.is_empty() && searches.iter().all(|search| search.disc_only_kernel().is_some());
    if finds_discs {
        let discs = wavefront.read_search_states(gpu, n)?;
        let distance =
            |disc: &SearchState| if query == TimedQuery::Any { 0.0 } else { disc.distance };
        return Ok(discs.iter().map(|disc| found(disc.slot != NONE, distance(disc))).collect());
    }
    if query == TimedQuery::Any {
        let paths = wavefront.read_paths(gpu, n)?;
        return Ok(paths.iter().map(|path| found(path.state == 0, 0.0)).collect());
    }
    let hits = wavefront.read_hits(gpu, n)?;
    Ok(hits.iter().map(|hit| found(hit.instance != NONE, hit.distance)).collect())
}

/// Returns an error if a question about a geometry has no kernel.
pub fn check(gpu: &Gpu, geometry: &FlatGeometry, query: TimedQuery) -> Result<()> {
    let FlatGeometry::Cloud(cloud) = geometry else { return Ok(()) };
    if query != TimedQuery::Surface || Surface::of_kind(cloud.surface, cloud).is_some() {
        return Ok(());
    }
    let reason = format!("the GPU has no benchmark of {}", surface_name(cloud));
    Err(Error::Device { device: gpu.info.name.clone(), reason })
}

#[cfg(test)]
mod tests {
    //! Searches find the same whatever the range of a ray.

    use super::*;
    use crate::test_support::{open_renderer, scene_of_points};
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;
    use surfel_core::surface::SurfaceKind;

    #[test]
    fn ranges_that_begin_or_end_in_a_cell_do_not_move_what_is_hit() {
        let Some(renderer) = open_renderer() else { return };
        let ray = |i: u16| {
            let target = Vec3::new(f32::from(i % 40), f32::from(i / 40), 0.0) * 0.45;
            let origin = target + Vec3::new(1.0, -0.5, 10.0);
            Ray::new(origin, (target - origin).normalize())
        };
        let rays: Vec<Ray> = (0..800).map(ray).collect();
        for kind in [SurfaceKind::Implicit, SurfaceKind::Octree, SurfaceKind::OctreeSplat] {
            let geometry = &scene_of_points(kind).geometries[0];
            let distances = |rays: &[Ray]| {
                let timing = Timing { geometry, rays, query: TimedQuery::Surface, n_runs: 1 };
                renderer.time_rays(timing, &NoProgress).unwrap().distances
            };
            let pairs = rays.iter().copied().zip(distances(&rays));
            let (rays, whole): (Vec<_>, Vec<_>) =
                pairs.filter(|(_, distance)| distance.is_finite()).unzip();
            assert!(400 < rays.len(), "{} {}", kind.name(), rays.len());
            // A leaf finds zeros up to a hundredth of a support beyond its end.
            let around = |(ray, distance): (&Ray, &f32)| {
                let (t_min, t_max) = (distance - 0.1, distance + 0.1);
                Ray { t_min, t_max, ..*ray }
            };
            let narrow: Vec<Ray> = rays.iter().zip(&whole).map(around).collect();
            assert!(distances(&narrow) == whole, "{}", kind.name());
        }
    }
}
