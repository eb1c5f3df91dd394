//! Timed searches along given rays, for benchmarks.

use crate::device::{DeviceKind, Gpu};
use crate::error::{Error, Result};
use crate::job::max_entries;
use crate::kernels::Kernels;
use crate::numbers::queue;
use crate::numbers::ray_kind;
use crate::numbers::{NO_LIMIT, NONE, WORKGROUP_SIZE};
use crate::passes::{Pass, Size};
use crate::picture_memory::array_bytes;
use crate::records::{FrameRecord, Path, SearchState, Task, Visit};
use crate::scene_records::SceneRecords;
use crate::search::{ANY, CLOSEST, SearchKernels, SearchStep};
use crate::shader::Kernel;
use crate::surface::Surface;
use crate::tree_visits::lone_visit;
use crate::unsupported::trees;
use crate::upload::{GpuTree, TreeRef, Uploads};
use crate::wavefront::{
    Arrays, Capacities, Contents, DISPATCH_BYTES, RECORD_STRIDE, Wavefront, written,
};
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
    let fits_memory = |sizes| uploads.fits_memory(gpu, geometries, array_bytes(sizes));
    let found = Arrays::free_unless_fitting(arrays, gpu, sizes, fits_memory)?;
    let start = Instant::now();
    uploads.update(gpu, geometries, array_bytes(found))?;
    let mut times = RayTimes {
        geometry_upload_secs: start.elapsed().as_secs_f64(),
        run_secs: vec![0.0; timing.n_runs as usize],
        ..RayTimes::default()
    };
    let tree = |search: &Search| {
        uploads.tree(geometries, TreeRef::Geometry { geometry_idx: 0, tree_idx: search.tree_idx })
    };
    // Empty trees are not uploaded.
    searches.retain(|search| tree(search).is_some());
    let is_paged = |search: &Search| tree(search).is_some_and(GpuTree::is_paged);
    let own = [Kernel::TakeQueue, Kernel::ClearHits].map(|kernel| (kernel, false));
    let of_trees = searches.iter().flat_map(|search| {
        let is_paged = is_paged(search);
        search.steps().into_iter().filter_map(move |step| match step {
            SearchStep::Search { kernel, .. } => Some((kernel, is_paged)),
            SearchStep::Take => None,
        })
    });
    kernels.compile(gpu, own.into_iter().chain(of_trees))?;
    let kernels = &*kernels;
    let arrays = Arrays::update(arrays, gpu, sizes)?;
    for rays in timing.rays.chunks(max_rays) {
        let chunk = Chunk::new(gpu, (kernels, arrays), &searches, rays)?;
        let visits: Vec<Visit> = searches.iter().map(|search| search.visit).collect();
        let bytes = bytemuck::cast_slice(&visits);
        let visits = written(gpu, "instances", bytes, wgpu::BufferUsages::STORAGE)?;
        let groups: Result<Vec<_>> = searches
            .iter()
            .filter_map(|search| {
                let tree = tree(search)?;
                let group = gpu.catch("a tree", || tree.bind(gpu, kernels, &visits));
                Some(group.map(|group| (group, tree.is_paged())))
            })
            .collect();
        let groups = groups?;
        for run in 0..=timing.n_runs {
            progress.check()?;
            times.ray_transfer_secs += chunk.reset(gpu, kernels)? / f64::from(timing.n_runs + 1);
            let start = Instant::now();
            chunk.search(gpu, kernels, &groups)?;
            if let Some(before) = run.checked_sub(1) {
                times.run_secs[before as usize] += start.elapsed().as_secs_f64();
            }
        }
        let start = Instant::now();
        times.distances.extend(chunk.results(gpu, timing.query)?);
        times.ray_transfer_secs += start.elapsed().as_secs_f64();
    }
    Ok(times)
}

/// A search in one tree.
struct Search {
    query: TimedQuery,
    surface: Surface,
    kernels: SearchKernels,
    tree_idx: usize,
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
        Search { query, surface, kernels, tree_idx, visit }
    };
    let cloud = match geometry {
        FlatGeometry::Mesh(_) => return vec![search(0, Surface::Triangle)],
        FlatGeometry::Cloud(cloud) => cloud,
    };
    match query {
        TimedQuery::Surface => {
            let shown = trees(cloud).into_iter().enumerate();
            let shown = shown.filter(|(_, (_, points))| !points.nodes.is_empty());
            let surfaces = shown.filter_map(|(i, (kind, _))| {
                Some((i, Surface::of_kind(kind, &cloud.options, cloud.edge_test)?))
            });
            surfaces.map(|(i, surface)| search(i, surface)).collect()
        }
        TimedQuery::Gather => vec![search(0, Surface::SplatRims)],
        _ if cloud.surface.uses_discs() => vec![search(0, Surface::DiscRims)],
        _ => vec![search(0, Surface::Sphere)],
    }
}

/// Rays on a device.
struct Chunk<'a> {
    wavefront: Wavefront<'a>,
    paths: Vec<Path>,
    clear: Vec<Pass>,
    /// The passes of the searches, with the indices of their trees; a pass that takes a queue has none.
    searches: Vec<(Pass, Option<usize>)>,
    /// True if the searches find discs and nothing more.
    finds_discs: bool,
}

impl<'a> Chunk<'a> {
    fn new(
        gpu: &Gpu,
        (kernels, arrays): (&Kernels, &'a Arrays),
        searches: &[Search],
        rays: &[Ray],
    ) -> Result<Self> {
        let n = rays.len() as u32;
        let mut tasks = Vec::new();
        let mut pass = |kernel: Kernel, size, task: Task| {
            let task_offset = tasks.len() as u32;
            tasks.extend_from_slice(bytemuck::bytes_of(&task));
            tasks.resize(task_offset as usize + RECORD_STRIDE as usize, 0);
            Pass { kernel, tree: None, task_offset, size, is_of_light: false }
        };
        let mut clear = Vec::new();
        let task = Task { queue: queue::PATHS, ray_kind: ray_kind::UNCOUNTED, ..Task::default() };
        clear.push(pass(Kernel::TakeQueue, Size::One, task));
        clear.push(pass(Kernel::ClearHits, Size::Pixels, Task::default()));
        let finds_discs = !searches.is_empty()
            && searches.iter().all(|search| search.disc_only_kernel().is_some());
        let mut passes = Vec::new();
        for (tree_idx, search) in searches.iter().enumerate() {
            let task = Task { first_visit: tree_idx as u32, n_visits: 1, ..Task::default() };
            for step in search.steps() {
                passes.push(match step {
                    SearchStep::Search { kernel, round } => {
                        let queue = if round == 0 { queue::PATHS } else { queue::UNDECIDED };
                        let task = Task { queue, round, ..task };
                        (pass(kernel, Size::Queue(queue), task), Some(tree_idx))
                    }
                    SearchStep::Take => {
                        let (queue, ray_kind) = (queue::UNDECIDED, ray_kind::UNCOUNTED);
                        let task = Task { queue, ray_kind, ..Task::default() };
                        (pass(Kernel::TakeQueue, Size::One, task), None)
                    }
                });
            }
        }
        let searches = passes;
        let records = SceneRecords::empty();
        let words = written(gpu, "textures", &[0; 4], wgpu::BufferUsages::STORAGE)?;
        let contents = Contents { scene: &records, words: &words, tasks: &tasks };
        let wavefront = Wavefront::new(gpu, kernels, arrays, contents)?;
        wavefront.set_frame(gpu, &FrameRecord { n_rays: n, capacity: n, ..Zeroable::zeroed() });
        let path = |ray: &Ray| Path {
            ray: Ray { t_max: ray.t_max.min(NO_LIMIT), ..*ray },
            state: 1,
            ..Zeroable::zeroed()
        };
        Ok(Self { wavefront, paths: rays.iter().map(path).collect(), clear, searches, finds_discs })
    }

    /// Uploads the rays, which have found nothing yet; returns the seconds that this took.
    fn reset(&self, gpu: &Gpu, kernels: &Kernels) -> Result<f64> {
        let start = Instant::now();
        self.wavefront.write_paths(gpu, &self.paths);
        self.wavefront.fill_paths(gpu, self.paths.len() as u32);
        self.run(gpu, kernels, self.clear.iter().map(|pass| (pass, None)))?;
        Ok(start.elapsed().as_secs_f64())
    }

    /// Searches along all rays and waits for the end.
    fn search(
        &self,
        gpu: &Gpu,
        kernels: &Kernels,
        trees: &[(wgpu::BindGroup, bool)],
    ) -> Result<()> {
        let searches = self.searches.iter().map(|(pass, tree)| (pass, tree.map(|i| &trees[i])));
        self.run(gpu, kernels, searches)
    }

    /// Runs passes, each with its tree, and waits for the end.
    fn run<'p>(
        &self,
        gpu: &Gpu,
        kernels: &Kernels,
        passes: impl Iterator<Item = (&'p Pass, Option<&'p (wgpu::BindGroup, bool)>)>,
    ) -> Result<()> {
        let n_groups = (self.paths.len() as u32).div_ceil(WORKGROUP_SIZE);
        gpu.catch("the passes", || {
            let description = wgpu::CommandEncoderDescriptor::default();
            let mut encoder = gpu.device.create_command_encoder(&description);
            {
                let description = wgpu::ComputePassDescriptor::default();
                let mut encoder = encoder.begin_compute_pass(&description);
                for (pass, tree) in passes {
                    let (resources, is_paged) = match tree {
                        Some((group, is_paged)) => (group, *is_paged),
                        None => (&self.wavefront.dispatches, false),
                    };
                    encoder.set_pipeline(kernels.get(pass.kernel, is_paged));
                    encoder.set_bind_group(0, &self.wavefront.uniforms, &[pass.task_offset]);
                    encoder.set_bind_group(1, &self.wavefront.paths[0], &[]);
                    encoder.set_bind_group(2, resources, &[]);
                    match pass.size {
                        Size::One => encoder.dispatch_workgroups(1, 1, 1),
                        Size::Queue(queue) => {
                            let offset = DISPATCH_BYTES * u64::from(queue);
                            let sizes = &self.wavefront.arrays.dispatch_sizes;
                            encoder.dispatch_workgroups_indirect(sizes, offset);
                        }
                        Size::Pixels => encoder.dispatch_workgroups(n_groups, 1, 1),
                    }
                }
            }
            gpu.queue.submit([encoder.finish()]);
        })?;
        gpu.wait()
    }

    fn results(&self, gpu: &Gpu, query: TimedQuery) -> Result<Vec<f32>> {
        let n = self.paths.len() as u32;
        let found = |is_hit, distance| if is_hit { distance } else { f32::INFINITY };
        if self.finds_discs {
            let discs = self.wavefront.read_search_states(gpu, n)?;
            let distance =
                |disc: &SearchState| if query == TimedQuery::Any { 0.0 } else { disc.distance };
            return Ok(discs.iter().map(|disc| found(disc.slot != NONE, distance(disc))).collect());
        }
        if query == TimedQuery::Any {
            let paths = self.wavefront.read_paths(gpu, n)?;
            return Ok(paths.iter().map(|path| found(path.state == 0, 0.0)).collect());
        }
        let hits = self.wavefront.read_hits(gpu, n)?;
        Ok(hits.iter().map(|hit| found(hit.instance != NONE, hit.distance)).collect())
    }
}

/// Returns an error if a question about a geometry has no kernel.
pub fn check(gpu: &Gpu, geometry: &FlatGeometry, query: TimedQuery) -> Result<()> {
    let FlatGeometry::Cloud(cloud) = geometry else { return Ok(()) };
    if query != TimedQuery::Surface
        || Surface::of_kind(cloud.surface, &cloud.options, cloud.edge_test).is_some()
    {
        return Ok(());
    }
    let reason = format!("the GPU has no benchmark of the surface {}", cloud.surface.name());
    Err(Error::Device { device: gpu.info.name.clone(), reason })
}
