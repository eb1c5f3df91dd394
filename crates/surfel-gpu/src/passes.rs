//! The passes that render a sample of each pixel, and the tasks that they read.

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

/// A part of the work on a wavefront.
#[derive(Clone, Debug)]
pub enum PassStage {
    /// Passes that run once.
    Once(Vec<Pass>),
    /// Passes that take all rays toward a light through one surface each, and run until none is left.
    Surfaces(Vec<Pass>),
}

/// The passes of one sample, and what they read.
#[derive(Debug, Default)]
pub struct Passes {
    /// The passes that make the camera rays.
    pub camera: Vec<Pass>,
    /// The passes that find the hits of a wavefront.
    pub trace: Vec<Pass>,
    /// The passes that shade them.
    pub shade: Vec<PassStage>,
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
    pub fn new(scene: &FlatScene, settings: &Settings) -> Self {
        let mut passes = Self::default();
        let TreeVisits { trees, gaussians, visits } = TreeVisits::new(scene);
        passes.visits = visits;
        passes.camera = passes.camera_passes(ray_kind::PRIMARY);
        passes.trace = passes.trace_passes(&trees);
        let light =
            passes.tree_pass(Kernel::Gaussians, TreeRef::Gaussians, &gaussians, queue::PATHS);
        passes.trace.extend(light);
        let shade = passes.pass(Kernel::Shade, Size::Queue(queue::PATHS), Task::default());
        let mut once = vec![shade];
        once.push(passes.take(queue::POINTS, ray_kind::UNCOUNTED));
        for (light_idx, (kind, max_samples)) in
            light_samples(scene, settings).into_iter().enumerate()
        {
            for sample_idx in 0..max_samples {
                let task =
                    Task { light: light_idx as u32, sample_idx, max_samples, ..Task::default() };
                let mut sample = passes.pass(Kernel::SampleLight, Size::Queue(queue::POINTS), task);
                sample.is_of_light = true;
                once.push(sample);
                if let Some(kind) = kind {
                    passes.add_light_passes(scene, (&trees, &gaussians), kind, &mut once);
                }
            }
        }
        passes.shade.push(PassStage::Once(once));
        if scene.materials.iter().any(has_branches) {
            passes.next_wave = Some(passes.take(queue::PATHS, ray_kind::SECONDARY));
        }
        passes.resolve = Some(passes.pass(Kernel::Resolve, Size::Pixels, Task::default()));
        passes.add_aov_passes(&trees, &gaussians, settings);
        passes
    }

    /// Returns every pass.
    pub fn all(&self) -> impl Iterator<Item = &Pass> {
        let shade = self.shade.iter().flat_map(|stage| match stage {
            PassStage::Once(passes) | PassStage::Surfaces(passes) => passes,
        });
        let aovs = self.aov_hits.iter().chain(&self.aov_supports);
        let last = self.next_wave.iter().chain(&self.resolve);
        self.camera.iter().chain(&self.trace).chain(shade).chain(last).chain(aovs)
    }

    /// Returns a pass without a tree.
    pub fn pass(&mut self, kernel: Kernel, size: Size, task: Task) -> Pass {
        let task_offset = self.tasks.len() as u32;
        self.tasks.extend_from_slice(bytemuck::bytes_of(&task));
        self.tasks.resize(task_offset as usize + RECORD_STRIDE as usize, 0);
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

    /// Adds the passes that find out how much light the rays of a sample bring.
    fn add_light_passes(
        &mut self,
        scene: &FlatScene,
        (trees, gaussians): (&[TreeInstances], &Range<u32>),
        ray_kind: u32,
        once: &mut Vec<Pass>,
    ) {
        let task = Task { queue: queue::LIGHT_RAYS, ray_kind, ..Task::default() };
        let size = Size::Queue(queue::LIGHT_RAYS);
        let of_light = |pass: Pass| Pass { is_of_light: true, ..pass };
        once.push(of_light(self.pass(Kernel::TakeQueue, Size::One, task)));
        for tree in trees {
            once.extend(self.tree_search(&ANY, tree, &tree.opaque, queue::LIGHT_RAYS));
        }
        once.extend(self.tree_pass(
            Kernel::GaussianShadow,
            TreeRef::Gaussians,
            gaussians,
            queue::LIGHT_RAYS,
        ));
        if !scene.is_transmissive {
            once.push(of_light(self.pass(Kernel::AddLight, size, task)));
            return;
        }
        once.push(of_light(self.pass(Kernel::ClearHits, size, task)));
        self.shade.push(PassStage::Once(std::mem::take(once)));
        let mut surfaces = Vec::new();
        for tree in trees {
            surfaces.extend(self.closest(tree, &tree.transmissive, queue::LIGHT_RAYS));
        }
        surfaces.push(of_light(self.pass(Kernel::PassSurface, size, task)));
        self.shade.push(PassStage::Surfaces(surfaces));
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
