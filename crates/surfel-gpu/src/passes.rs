//! The passes that render a sample of each pixel, and the tasks that they read.

use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::numbers::queue;
use crate::numbers::ray_kind;
use crate::records::{Task, Visit};
use crate::scene_records::n_light_samples;
use crate::search::{ANY, CLOSEST, SearchKernels, SearchStep};
use crate::shader::Kernel;
use crate::surface::Surface;
use crate::tree_visits::{TreeInstances, TreeVisits};
use crate::upload::TreeRef;
use crate::wavefront::RECORD_STRIDE;
use std::ops::Range;
use surfel_core::flat::FlatScene;
use surfel_core::render::Settings;
use surfel_core::scene::{AlphaMode, Light, Material, PunctualLightKind};

/// The number of invocations of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// One for each pixel.
    Pixels,
    /// One.
    One,
    /// One for each entry of the queue of this number.
    Queue(u32),
}

/// One pass over the entries of a queue.
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// The kernel.
    pub kernel: Kernel,
    /// The tree that the kernel reads.
    pub tree: Option<TreeRef>,
    /// Offset of the task.
    pub task_offset: u32,
    /// The number of invocations.
    pub size: Size,
    /// True if the kernel works on the rays toward a light, not on paths.
    pub is_of_light: bool,
}

/// The passes that make the rays from points toward one light.
#[derive(Clone, Copy, Debug)]
pub struct LightPasses {
    /// The pass of the first sample.
    first_sample: Pass,
    /// Maximum number of samples at a point. Their tasks follow that of the first.
    n_samples: u32,
    /// The pass that takes the rays of a sample; none for a headlight, whose light needs no rays.
    pub take: Option<Pass>,
}

impl LightPasses {
    /// Returns the pass of each sample.
    pub fn samples(&self) -> impl Iterator<Item = Pass> {
        let Self { first_sample, n_samples, .. } = *self;
        let task_offset = move |i| first_sample.task_offset + i * RECORD_STRIDE as u32;
        (0..n_samples).map(move |i| Pass { task_offset: task_offset(i), ..first_sample })
    }
}

/// The passes of one sample, and what they read.
#[derive(Debug, Default)]
pub struct Passes {
    /// The passes that make the camera rays.
    pub camera: Vec<Pass>,
    /// The passes that find the hits of a wavefront.
    pub trace: Vec<Pass>,
    /// The passes that shade them and take the queue of points that receive light.
    pub shade: Vec<Pass>,
    /// The passes of each light.
    pub lights: Vec<LightPasses>,
    /// The passes that find out how much light the rays of a sample bring, the same for all samples of all lights.
    pub light_rays: Vec<Pass>,
    /// The passes behind these that take all rays toward a light through one surface each, and run until none is left;
    /// none if no surface lets light through.
    pub surfaces: Vec<Pass>,
    /// The passes that begin the next wavefront; none if there is only one.
    pub next_wave: Option<Pass>,
    /// The pass after all samples.
    pub resolve: Option<Pass>,
    /// The passes that find the hits of the rays through the centres of pixels, if the picture has AOVs and these hits
    /// are not known from its only sample.
    pub aov_hits: Vec<Pass>,
    /// The passes that find the points behind these hits.
    pub aov_supports: Vec<Pass>,
    /// The tasks, at multiples of `RECORD_STRIDE`.
    pub tasks: Vec<u8>,
    /// The instances of trees.
    pub visits: Vec<Visit>,
}

impl Passes {
    /// Returns the passes that render one sample of each pixel.
    ///
    /// # Errors
    ///
    /// Fails if the device allows no array of so many tasks, before those of light samples are made.
    pub fn new(gpu: &Gpu, scene: &FlatScene, settings: &Settings) -> Result<Self> {
        // The offset of a task has 32 bits.
        let found = gpu.device.limits().max_buffer_size.min(u32::MAX.into());
        Self::with_task_bytes(found, scene, settings).map_err(|needed| {
            let limit = "bytes of tasks (samples of lights and the like)";
            Error::Limit { device: gpu.info.name.clone(), limit, found, needed }
        })
    }

    /// Returns the passes, or the bytes that their tasks need if these are more than `max_bytes`.
    fn with_task_bytes(
        max_bytes: u64,
        scene: &FlatScene,
        settings: &Settings,
    ) -> std::result::Result<Self, u64> {
        let light_samples = light_samples(scene, settings);
        let n_samples = light_samples.iter().map(|(_, max_samples)| u64::from(*max_samples));
        let sample_bytes = RECORD_STRIDE * n_samples.sum::<u64>();
        if max_bytes < sample_bytes {
            return Err(sample_bytes);
        }
        let mut passes = Self::default();
        let TreeVisits { trees, gaussians, visits } = TreeVisits::new(scene);
        passes.visits = visits;
        passes.camera = passes.camera_passes(ray_kind::PRIMARY);
        passes.trace = passes.trace_passes(&trees);
        let light =
            passes.tree_pass(Kernel::Gaussians, TreeRef::Gaussians, &gaussians, queue::PATHS);
        passes.trace.extend(light);
        let shade = passes.pass(Kernel::Shade, Size::Queue(queue::PATHS), Task::default());
        passes.shade = vec![shade, passes.take(queue::POINTS, ray_kind::UNCOUNTED)];
        for (light, (kind, max_samples)) in (0..).zip(&light_samples) {
            passes.add_light(light, *kind, *max_samples);
        }
        if light_samples.iter().any(|(kind, _)| kind.is_some()) {
            passes.add_light_rays(scene, &trees, &gaussians);
        }
        if scene.materials.iter().any(has_branches) {
            passes.next_wave = Some(passes.take(queue::PATHS, ray_kind::SECONDARY));
        }
        passes.resolve = Some(passes.pass(Kernel::Resolve, Size::Pixels, Task::default()));
        passes.add_aov_passes(&trees, &gaussians, settings);
        let n_bytes = passes.tasks.len() as u64;
        if max_bytes < n_bytes { Err(n_bytes) } else { Ok(passes) }
    }

    /// Returns every pass, of those that differ in their samples of a light only the first.
    pub fn all(&self) -> impl Iterator<Item = &Pass> {
        let samples = self.lights.iter().map(|light| &light.first_sample);
        let takes = self.lights.iter().filter_map(|light| light.take.as_ref());
        let light = samples.chain(takes).chain(&self.light_rays).chain(&self.surfaces);
        let aovs = self.aov_hits.iter().chain(&self.aov_supports);
        let last = self.next_wave.iter().chain(&self.resolve);
        let first = self.camera.iter().chain(&self.trace).chain(&self.shade);
        first.chain(light).chain(last).chain(aovs)
    }

    /// Returns a pass without a tree.
    pub fn pass(&mut self, kernel: Kernel, size: Size, task: Task) -> Pass {
        // `Passes::new` fails if the offsets exceed this.
        let task_offset = self.tasks.len() as u32;
        self.tasks.extend_from_slice(bytemuck::bytes_of(&task));
        self.tasks.resize(self.tasks.len().next_multiple_of(RECORD_STRIDE as usize), 0);
        Pass { kernel, tree: None, task_offset, size, is_of_light: false }
    }

    /// Returns the pass of paths, or of rays toward lights, over these instances of a tree; none without any.
    fn tree_pass(
        &mut self,
        kernel: Kernel,
        tree: TreeRef,
        visits: &Range<u32>,
        queue: u32,
    ) -> Option<Pass> {
        let is_of_light = queue == queue::LIGHT_RAYS;
        (!visits.is_empty())
            .then(|| Pass { is_of_light, ..self.round_pass(kernel, tree, visits, (queue, 0)) })
    }

    /// Returns the pass of a round of a search over these instances of a tree.
    fn round_pass(
        &mut self,
        kernel: Kernel,
        tree: TreeRef,
        visits: &Range<u32>,
        (queue, round): (u32, u32),
    ) -> Pass {
        let n_visits = visits.end - visits.start;
        let task = Task { queue, round, first_visit: visits.start, n_visits, ..Task::default() };
        Pass { tree: Some(tree), ..self.pass(kernel, Size::Queue(queue), task) }
    }

    /// Returns the passes of a search along the rays of a queue over instances of a tree.
    pub fn search(
        &mut self,
        steps: &[SearchStep],
        tree: TreeRef,
        visits: &Range<u32>,
        queue: u32,
    ) -> Vec<Pass> {
        let is_of_light = queue == queue::LIGHT_RAYS;
        let pass = |step: &SearchStep| match *step {
            SearchStep::Search { kernel, round } => {
                let queue = if round == 0 { queue } else { queue::UNDECIDED };
                self.round_pass(kernel, tree, visits, (queue, round))
            }
            SearchStep::Take => self.take(queue::UNDECIDED, ray_kind::UNCOUNTED),
        };
        steps.iter().map(pass).map(|pass| Pass { is_of_light, ..pass }).collect()
    }

    /// Returns the passes of a search in a tree with the kernels of its surface.
    fn tree_search(
        &mut self,
        kernels: &SearchKernels,
        tree: &TreeInstances,
        visits: &Range<u32>,
        queue: u32,
    ) -> Vec<Pass> {
        let steps = kernels.steps(tree.surface, visits.len());
        self.search(&steps, tree.tree, visits, queue)
    }

    /// Returns the passes that find hits, and the points behind them where these give the colour.
    fn closest(&mut self, tree: &TreeInstances, visits: &Range<u32>, queue: u32) -> Vec<Pass> {
        let mut passes = self.tree_search(&CLOSEST, tree, visits, queue);
        if tree.has_support_colors {
            passes.extend(self.tree_pass(Kernel::Support(tree.surface), tree.tree, visits, queue));
        }
        passes
    }

    /// Returns the pass that takes a queue.
    pub fn take(&mut self, queue: u32, ray_kind: u32) -> Pass {
        self.pass(Kernel::TakeQueue, Size::One, Task { queue, ray_kind, ..Task::default() })
    }

    fn camera_passes(&mut self, ray_kind: u32) -> Vec<Pass> {
        let generate = self.pass(Kernel::Generate, Size::Pixels, Task::default());
        vec![generate, self.take(queue::PATHS, ray_kind)]
    }

    fn trace_passes(&mut self, trees: &[TreeInstances]) -> Vec<Pass> {
        let task = Task { queue: queue::PATHS, ..Task::default() };
        let mut passes = vec![self.pass(Kernel::ClearHits, Size::Queue(queue::PATHS), task)];
        for tree in trees {
            passes.extend(self.closest(tree, &tree.all(), queue::PATHS));
        }
        passes
    }

    /// Adds the passes that make the rays toward a light, of this kind.
    fn add_light(&mut self, light: u32, ray_kind: Option<u32>, max_samples: u32) {
        let of_light = |pass: Pass| Pass { is_of_light: true, ..pass };
        let size = Size::Queue(queue::POINTS);
        let first = Task { light, max_samples, ..Task::default() };
        let first_sample = of_light(self.pass(Kernel::SampleLight, size, first));
        for sample_idx in 1..max_samples {
            self.pass(Kernel::SampleLight, size, Task { sample_idx, ..first });
        }
        let take = ray_kind.map(|kind| of_light(self.take(queue::LIGHT_RAYS, kind)));
        self.lights.push(LightPasses { first_sample, n_samples: max_samples, take });
    }

    /// Adds the passes that find out how much light the rays of a sample bring.
    fn add_light_rays(
        &mut self,
        scene: &FlatScene,
        trees: &[TreeInstances],
        gaussians: &Range<u32>,
    ) {
        let task = Task { queue: queue::LIGHT_RAYS, ..Task::default() };
        let size = Size::Queue(queue::LIGHT_RAYS);
        let of_light = |pass: Pass| Pass { is_of_light: true, ..pass };
        let mut passes = Vec::new();
        for tree in trees {
            passes.extend(self.tree_search(&ANY, tree, &tree.opaque, queue::LIGHT_RAYS));
        }
        passes.extend(self.tree_pass(
            Kernel::GaussianShadow,
            TreeRef::Gaussians,
            gaussians,
            queue::LIGHT_RAYS,
        ));
        let last = if scene.is_transmissive { Kernel::ClearHits } else { Kernel::AddLight };
        passes.push(of_light(self.pass(last, size, task)));
        self.light_rays = passes;
        if !scene.is_transmissive {
            return;
        }
        let mut surfaces = Vec::new();
        for tree in trees {
            surfaces.extend(self.closest(tree, &tree.transmissive, queue::LIGHT_RAYS));
        }
        surfaces.push(of_light(self.pass(Kernel::PassSurface, size, task)));
        self.surfaces = surfaces;
    }

    /// Adds the passes for AOVs. If there is one sample and one wavefront, it has left its hits, if all are on surfaces.
    fn add_aov_passes(
        &mut self,
        trees: &[TreeInstances],
        gaussians: &Range<u32>,
        settings: &Settings,
    ) {
        if !settings.with_aovs {
            return;
        }
        let is_sampled = 1 < settings.samples_per_pixel;
        let has_gaussians = !gaussians.is_empty();
        if is_sampled || self.next_wave.is_some() || has_gaussians {
            // Wavefronts overwrite the hits of their one sample, whose rays are counted.
            let is_counted = is_sampled || has_gaussians;
            let kind = if is_counted { ray_kind::PRIMARY } else { ray_kind::UNCOUNTED };
            self.aov_hits = self.camera_passes(kind);
            let trace = self.trace_passes(trees);
            self.aov_hits.extend(trace);
            let hits =
                self.tree_pass(Kernel::GaussianHits, TreeRef::Gaussians, gaussians, queue::PATHS);
            self.aov_hits.extend(hits);
        }
        for tree in trees.iter().filter(|tree| tree.surface != Surface::Triangle) {
            let kernel = Kernel::Support(tree.surface);
            let support = self.tree_pass(kernel, tree.tree, &tree.all(), queue::PATHS);
            self.aov_supports.extend(support);
        }
        let support =
            self.tree_pass(Kernel::GaussianSupport, TreeRef::Gaussians, gaussians, queue::PATHS);
        self.aov_supports.extend(support);
    }
}

/// Returns true if paths go on behind a surface of this material.
fn has_branches(material: &Material) -> bool {
    material.metallic != 0.0
        || material.ior != 1.0
        || material.transmission != 0.0
        || material.alpha_mode != AlphaMode::Opaque
}

/// Returns for each light, in the order of their records, the kind of its rays, none for a headlight, and the maximum
/// number of rays from a point.
fn light_samples(scene: &FlatScene, settings: &Settings) -> Vec<(Option<u32>, u32)> {
    let n_light_samples = n_light_samples(settings);
    let n_samples = |is_point: bool| if is_point { 1 } else { n_light_samples };
    let lights = scene.lights.iter().map(|light| match light {
        Light::Sun(sun) => (Some(ray_kind::SHADOW), n_samples(sun.angular_diameter_deg <= 0.0)),
        Light::Sky(_) | Light::Environment(_) => (Some(ray_kind::SKY), n_light_samples),
        Light::Headlight(_) => (None, 1),
    });
    let lamps = scene.punctual_lights.iter().map(|lamp| {
        let is_directional = lamp.kind == PunctualLightKind::Directional;
        (Some(ray_kind::SHADOW), n_samples(lamp.radius <= 0.0 || is_directional))
    });
    lights.chain(lamps).collect()
}

#[cfg(test)]
mod tests {
    //! The samples of all lights share their passes, and pictures with too many tasks are refused.

    use super::*;
    use crate::test_support::{open_gpu, scene_of_points};
    use surfel_core::math::Vec3;
    use surfel_core::scene::Sky;
    use surfel_core::surface::SurfaceKind;

    /// Returns a scene of points under two skies and a headlight.
    fn scene_under_skies() -> FlatScene {
        let (up, zenith, ground) = (Vec3::Z, Vec3::ONE, Vec3::ZERO);
        let sky = Light::Sky(Sky { up, zenith, ground, ao_distance: f32::INFINITY });
        let lights = vec![sky.clone(), Light::Headlight(1.0), sky];
        let mut scene = scene_of_points(SurfaceKind::Smooth);
        scene.lights = lights;
        scene
    }

    fn settings(light_samples: u32) -> Settings {
        Settings { samples_per_pixel: 1, light_samples, ..Settings::default() }
    }

    #[test]
    fn samples_of_lights_share_the_passes_of_their_rays() {
        let scene = scene_under_skies();
        let passes = |n| Passes::with_task_bytes(u32::MAX.into(), &scene, &settings(n)).unwrap();
        let (few, many) = (passes(1), passes(1000));
        assert_eq!(few.all().count(), many.all().count());
        // A sample has a task of its own, and no more.
        let task_bytes = 2 * 999 * RECORD_STRIDE as usize;
        assert_eq!(many.tasks.len() - few.tasks.len(), task_bytes);
        assert!(many.lights.iter().map(|light| light.take.is_some()).eq([true, false, true]));
    }

    #[test]
    fn passes_of_samples_have_the_tasks_of_their_light_and_sample() {
        let passes = Passes::with_task_bytes(u64::MAX, &scene_under_skies(), &settings(3)).unwrap();
        let task = |pass: Pass| {
            let bytes = &passes.tasks[pass.task_offset as usize..][..size_of::<Task>()];
            let Task { light, sample_idx, max_samples, .. } = bytemuck::pod_read_unaligned(bytes);
            (light, sample_idx, max_samples)
        };
        let found: Vec<_> =
            passes.lights.iter().flat_map(|light| light.samples().map(task)).collect();
        let sky = |light| (0..3).map(move |sample_idx| (light, sample_idx, 3));
        let expected: Vec<_> = sky(0).chain([(1, 0, 1)]).chain(sky(2)).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn too_many_tasks_are_refused() {
        let mut scene = scene_under_skies();
        let passes = |bytes, n| Passes::with_task_bytes(bytes, &scene, &settings(n)).map(|_| ());
        let sample_bytes = RECORD_STRIDE * (2 * 1000 + 1);
        assert_eq!(passes(sample_bytes - 1, 1000), Err(sample_bytes));
        // The other passes have tasks as well.
        assert!(passes(sample_bytes, 1000).is_err_and(|needed| sample_bytes < needed));
        let Some(gpu) = open_gpu() else { return };
        scene.lights = vec![scene.lights[0].clone(); 1000];
        let error = Passes::new(&gpu, &scene, &settings(1 << 16)).unwrap_err();
        let expected = "of lights and the like), 16777216000 are needed";
        assert!(error.to_string().ends_with(expected), "{error}");
    }
}
