//! Submits passes to a device: many in a submission, the next one while the device works.

use crate::device::{DeviceKind, Gpu};
use crate::error::Result;
use crate::kernel_times::{KernelTimes, Timestamps};
use crate::kernels::Kernels;
use crate::numbers::WORKGROUP_SIZE;
use crate::passes::{Pass, Passes, Size};
use crate::shader::Resources;
use crate::upload::{GpuTree, TreeRef};
use crate::wavefront::{Counts, DISPATCH_BYTES, Wavefront, written};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use surfel_core::progress::Progress;

/// Maximum number of passes in a submission. Work is cancelled between submissions; on a GPU a pass takes a few
/// milliseconds, and the way of a submission to the device a tenth of one.
const MAX_PASSES: usize = 64;
/// Maximum number of passes in a submission to a software device. There a pass can take a second, and a wait for a
/// submission must be far shorter than its limit.
const MAX_SOFTWARE_PASSES: usize = 16;
/// Maximum number of submissions of passes that the device has not finished: one to work on, and one to go on with.
const MAX_IN_FLIGHT: usize = 2;

/// A tree, bound for passes.
#[derive(Debug)]
pub struct BoundTree {
    /// The arrays of the tree.
    pub group: wgpu::BindGroup,
    /// True if they are in pages.
    pub is_paged: bool,
}

/// Binds the trees that passes read, together with the records of their instances.
///
/// # Errors
///
/// Fails if the device does.
pub fn bind_trees<'a>(
    gpu: &Gpu,
    kernels: &Kernels,
    trees: impl Fn(TreeRef) -> Option<&'a GpuTree>,
    passes: &Passes,
) -> Result<BTreeMap<TreeRef, BoundTree>> {
    let mut bound = BTreeMap::new();
    if passes.visits.is_empty() {
        return Ok(bound);
    }
    let bytes = bytemuck::cast_slice(&passes.visits);
    let visits = written(gpu, "instances", bytes, wgpu::BufferUsages::STORAGE)?;
    let used: BTreeSet<TreeRef> = passes.all().filter_map(|pass| pass.tree).collect();
    for tree in used {
        let Some(arrays) = trees(tree) else { continue };
        let group = gpu.catch("a tree", || arrays.bind(gpu, kernels, &visits))?;
        bound.insert(tree, BoundTree { group, is_paged: arrays.is_paged() });
    }
    Ok(bound)
}

/// The resources that passes use.
#[derive(Clone, Copy)]
pub struct Bound<'a> {
    /// The kernels.
    pub kernels: &'a Kernels,
    /// The arrays of rays and pixels.
    pub wavefront: &'a Wavefront<'a>,
    /// The trees.
    pub trees: &'a BTreeMap<TreeRef, BoundTree>,
}

/// Collects passes, and submits them.
pub struct Submitter<'a> {
    gpu: &'a Gpu,
    bound: Bound<'a>,
    progress: &'a dyn Progress,
    max_passes: usize,
    waiting: Vec<Step>,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
    measured: Option<(Timestamps, &'a mut KernelTimes)>,
    /// Seconds of the passes that were added with `is_primary`, if times are measured.
    pub primary_secs: f64,
    /// Number of pixels of the part.
    pub n_pixels: u32,
    /// Index of the array that holds the paths of the current wavefront.
    pub parity: usize,
    /// True while passes are added that find the hits of camera rays.
    pub is_primary: bool,
}

/// A pass and the state in which it was added.
#[derive(Clone, Copy)]
struct Step {
    pass: Pass,
    parity: usize,
    is_primary: bool,
}

impl<'a> Submitter<'a> {
    /// Returns a submitter that measures the times of kernels, if these are wanted and the device has a clock.
    ///
    /// # Errors
    ///
    /// Fails if the device does.
    pub fn new(
        gpu: &'a Gpu,
        bound: Bound<'a>,
        times: &'a mut KernelTimes,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let max_passes = match gpu.info.kind {
            DeviceKind::Software => MAX_SOFTWARE_PASSES,
            _ => MAX_PASSES,
        };
        let measured = match times.is_measured && gpu.has_timestamps() {
            true => Some((Timestamps::new(gpu, max_passes as u32)?, times)),
            false => None,
        };
        Ok(Self {
            gpu,
            bound,
            progress,
            max_passes,
            waiting: Vec::new(),
            in_flight: VecDeque::new(),
            measured,
            primary_secs: 0.0,
            n_pixels: 0,
            parity: 0,
            is_primary: false,
        })
    }

    /// Adds passes; those that make a submission full go to the device.
    ///
    /// # Errors
    ///
    /// Fails if the device does, or once `progress` is cancelled.
    pub fn add<'p>(
        &mut self,
        passes: impl IntoIterator<Item = &'p Pass>,
    ) -> surfel_core::Result<()> {
        for pass in passes {
            let Self { parity, is_primary, .. } = *self;
            self.waiting.push(Step { pass: *pass, parity, is_primary });
            if self.waiting.len() == self.max_passes {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Submits the passes that were added.
    ///
    /// # Errors
    ///
    /// Fails as [`Submitter::add`] does.
    pub fn flush(&mut self) -> surfel_core::Result<()> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        self.progress.check()?;
        if self.in_flight.len() == MAX_IN_FLIGHT
            && let Some(first) = self.in_flight.pop_front()
        {
            self.gpu.wait_for(&first)?;
            self.progress.check()?;
        }
        let submission = self.submit()?;
        self.in_flight.push_back(submission);
        if let Some((timestamps, times)) = &mut self.measured {
            let secs = timestamps.read(self.gpu, self.waiting.len())?;
            for (step, secs) in self.waiting.iter().zip(secs) {
                times.add(step.pass.kernel, secs);
                self.primary_secs += if step.is_primary { secs } else { 0.0 };
            }
        }
        self.waiting.clear();
        Ok(())
    }

    /// Returns the last submission; none before the first.
    pub fn last(&self) -> Option<&wgpu::SubmissionIndex> {
        self.in_flight.back()
    }

    /// Returns the arrays that the passes work on.
    pub fn wavefront(&self) -> &'a Wavefront<'a> {
        self.bound.wavefront
    }

    /// Waits for all passes, and returns what they have counted.
    ///
    /// # Errors
    ///
    /// Fails as [`Submitter::add`] does.
    pub fn read_counts(&mut self) -> surfel_core::Result<Counts> {
        self.flush()?;
        Ok(self.bound.wavefront.read_counts(self.gpu)?)
    }

    fn submit(&self) -> Result<wgpu::SubmissionIndex> {
        let timestamps = self.measured.as_ref().map(|(timestamps, _)| timestamps);
        self.gpu.catch("the passes", || {
            let description = wgpu::CommandEncoderDescriptor::default();
            let mut encoder = self.gpu.device.create_command_encoder(&description);
            {
                let description = wgpu::ComputePassDescriptor::default();
                let mut encoder = encoder.begin_compute_pass(&description);
                for (i, step) in self.waiting.iter().enumerate() {
                    if let Some(timestamps) = timestamps.filter(|_| i == 0) {
                        timestamps.write(&mut encoder, 0);
                    }
                    self.encode(&mut encoder, *step);
                    if let Some(timestamps) = timestamps {
                        timestamps.write(&mut encoder, i + 1);
                    }
                }
            }
            self.gpu.queue.submit([encoder.finish()])
        })
    }

    fn encode(&self, encoder: &mut wgpu::ComputePass, Step { pass, parity, .. }: Step) {
        let Bound { kernels, wavefront, trees } = self.bound;
        let rays = if pass.is_of_light { &wavefront.light_rays } else { &wavefront.paths[parity] };
        let tree = pass.tree.and_then(|tree| trees.get(&tree));
        let is_paged = tree.is_some_and(|tree| tree.is_paged);
        encoder.set_pipeline(kernels.get(pass.kernel, is_paged));
        encoder.set_bind_group(0, &wavefront.uniforms, &[pass.task_offset]);
        encoder.set_bind_group(1, rays, &[]);
        match pass.kernel.resources() {
            Resources::Scene => encoder.set_bind_group(2, &wavefront.scene, &[]),
            Resources::Colors => encoder.set_bind_group(2, &wavefront.colors, &[]),
            Resources::Dispatches => {
                let dispatches =
                    if pass.size == Size::One { &wavefront.dispatches } else { &wavefront.unused };
                encoder.set_bind_group(2, dispatches, &[]);
            }
            Resources::Tree => {
                let Some(tree) = tree else { return };
                encoder.set_bind_group(2, &tree.group, &[]);
            }
        }
        match pass.size {
            Size::One => encoder.dispatch_workgroups(1, 1, 1),
            Size::Pixels => {
                encoder.dispatch_workgroups(self.n_pixels.div_ceil(WORKGROUP_SIZE), 1, 1);
            }
            Size::Queue(queue) => {
                let offset = DISPATCH_BYTES * u64::from(queue);
                encoder.dispatch_workgroups_indirect(&wavefront.arrays.dispatch_sizes, offset);
            }
        }
    }
}
