//! One picture: it is rendered part by part, each part sample by sample, each sample wavefront by wavefront.

use crate::aovs::{AovSource, set_aovs};
use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::kernels::Kernels;
use crate::numbers::WORKGROUP_SIZE;
use crate::passes::{Pass, PassStage, Passes, Size};
use crate::records::{FrameRecord, HitRecord, ShadingPointRecord};
use crate::scene_records::{SceneRecords, frame};
use crate::shader::Resources;
use crate::upload::{TreeRef, Uploads};
use crate::wavefront::{Capacities, Contents, DISPATCH_BYTES, Wavefront, written};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::integrator::constants::MAX_SURFACES;
use surfel_core::math::Vec4;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, RenderStats, Settings};

/// Number of pixels of the first part of a picture.
const FIRST_PART: u32 = 1 << 12;
/// Maximum number of entries of a queue: it bounds the memory, up to 800 bytes an entry.
const MAX_ENTRIES: u32 = 1 << 20;
/// Number of entries of a queue for each pixel, where paths have branches. A part whose paths have more is rendered
/// again in smaller parts.
const ENTRIES_PER_PIXEL: u32 = 4;
/// Minimum number of entries of a queue, where paths have branches.
const MIN_ENTRIES: u32 = 1 << 14;
/// Number of passes that the device is given at once. Between them work can be cancelled, and the wait for them is far
/// shorter than its limit, also on slow devices and with many light samples.
const PASSES_AT_ONCE: usize = 16;
/// Number of surfaces that rays toward a light pass before the device is asked whether any is left.
const SURFACES_AT_ONCE: usize = 4;
/// Time of a sample of a part above which the next part is smaller, and well below which it is larger. A device that
/// also draws a screen must not be busy for long, and work is cancelled between samples.
const MAX_SAMPLE_TIME: Duration = Duration::from_millis(200);

/// One picture.
pub struct Job<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// Its kernels.
    pub kernels: &'a Kernels,
    /// The geometries in its memory.
    pub uploads: &'a Uploads,
    /// The scene.
    pub scene: &'a FlatScene,
    /// The settings of the picture.
    pub settings: &'a Settings,
    /// The part of the picture that is wanted.
    pub region: RenderRegion,
    /// The passes of a sample.
    pub passes: Passes,
    /// The records that shading reads.
    pub records: SceneRecords,
    /// Texels and the like.
    pub words: &'a wgpu::Buffer,
}

/// A tree, bound for passes.
struct BoundTree {
    group: wgpu::BindGroup,
    is_paged: bool,
}

/// Durations of a part of a picture.
#[derive(Clone, Copy, Debug, Default)]
struct PartTimes {
    /// Duration of the slowest sample.
    slowest: Duration,
    /// Duration of the search for the nearest hits of camera rays, in all samples.
    trace: Duration,
}

/// The arrays of a picture, bound for its passes.
struct Arrays {
    wavefront: Wavefront,
    trees: BTreeMap<TreeRef, BoundTree>,
}

/// The result of a part of a picture.
enum Part {
    /// It was rendered.
    Done(PartTimes),
    /// A queue was too short.
    Overflow,
}

impl Job<'_> {
    /// Renders the picture.
    pub fn render(&self, progress: &dyn Progress) -> surfel_core::Result<(Image, RenderStats)> {
        let Self { gpu, settings, region, .. } = *self;
        let start = Instant::now();
        let n_pixels = u64::from(settings.width) * u64::from(region.n_rows());
        progress.begin("render", n_pixels);
        let sizes = Self::sizes(gpu, self.scene, &self.passes, n_pixels);
        let Self { records, words, .. } = self;
        let contents = Contents { scene: records, words, tasks: &self.passes.tasks };
        let arrays = Arrays {
            wavefront: Wavefront::new(gpu, self.kernels, sizes, contents)?,
            trees: self.bind_trees()?,
        };
        let wavefront = &arrays.wavefront;
        let view = self.scene.camera.view(self.scene.origin, settings.width, settings.height);
        let capacity = sizes.n_entries;
        let frame = FrameRecord { capacity, ..frame(self.scene, &view, settings) };
        let source = AovSource { scene: self.scene, view: &view, settings };
        let mut image = region.blank_image(settings);
        let mut stats = RenderStats::default();
        let mut max_part = sizes.n_pixels;
        let (mut done, mut part) = (0, FIRST_PART.min(max_part));
        while done < n_pixels {
            let n_rays = u64::from(part).min(n_pixels - done) as u32;
            // Pictures have at most 2^28 pixels.
            let first = done as u32;
            let first_pixel = region.rows.0 * settings.width + first;
            let frame = FrameRecord { first_pixel, n_rays, ..frame };
            let Part::Done(times) = self.render_part(&arrays, frame, progress)? else {
                wavefront.clear_counts(gpu);
                max_part = self.smaller_part(n_rays)?;
                part = max_part;
                continue;
            };
            let sums = wavefront.read_pixels(gpu, n_rays)?;
            self.resolve(&sums, first, &mut image);
            if let Some(aovs) = &mut image.aovs {
                let frame = FrameRecord { is_centered: 1, ..frame };
                let hits = self.find_aov_hits(&arrays, frame, progress)?;
                set_aovs(aovs, &hits, &source, frame, first);
            }
            stats.rays += wavefront.read_counts(gpu)?.rays();
            wavefront.clear_counts(gpu);
            stats.trace_secs += times.trace.as_secs_f64();
            part = next_part(part, times.slowest, max_part);
            done += u64::from(n_rays);
            progress.advance(n_rays.into());
        }
        stats.frame_secs = start.elapsed().as_secs_f64();
        Ok((image, stats))
    }

    /// Returns the sizes of the arrays of a picture with this number of pixels.
    pub fn sizes(gpu: &Gpu, scene: &FlatScene, passes: &Passes, n_pixels: u64) -> Capacities {
        let has_waves = passes.next_wave.is_some();
        let fitting = gpu.info.max_array_bytes / size_of::<ShadingPointRecord>() as u64;
        let max_entries = fitting.min(MAX_ENTRIES.into());
        let (wanted, per_pixel) = match has_waves {
            true => {
                let per_pixel = u64::from(ENTRIES_PER_PIXEL);
                ((per_pixel * n_pixels).max(MIN_ENTRIES.into()), per_pixel)
            }
            false => (n_pixels, 1),
        };
        let n_entries = wanted.min(max_entries);
        Capacities {
            n_pixels: n_pixels.min(n_entries / per_pixel) as u32,
            n_entries: n_entries as u32,
            has_waves,
            is_transmissive: scene.is_transmissive,
        }
    }

    /// Binds the trees that passes read, together with the records of their instances.
    fn bind_trees(&self) -> Result<BTreeMap<TreeRef, BoundTree>> {
        let mut visits = self.passes.visits.clone();
        visits.resize_with(visits.len().max(1), bytemuck::Zeroable::zeroed);
        let bytes = bytemuck::cast_slice(&visits);
        let visits = written(self.gpu, "instances", bytes, wgpu::BufferUsages::STORAGE)?;
        let mut bound = BTreeMap::new();
        for tree in self.passes.all().filter_map(|pass| pass.tree) {
            let Some(arrays) = self.uploads.tree(&self.scene.geometries, tree) else { continue };
            let bind = || arrays.bind(self.gpu, self.kernels, &visits);
            let group = self.gpu.catch("a tree", bind)?;
            bound.insert(tree, BoundTree { group, is_paged: arrays.is_paged() });
        }
        Ok(bound)
    }

    /// Returns the number of pixels of the parts after one of `n_pixels` whose paths did not fit the queues.
    fn smaller_part(&self, n_pixels: u32) -> Result<u32> {
        if n_pixels == 1 {
            let reason =
                "the paths of one pixel have more branches than its queues hold".to_owned();
            return Err(Error::Device { device: self.gpu.info.name.clone(), reason });
        }
        Ok((n_pixels / 4).max(1))
    }

    /// Renders all samples of a part.
    fn render_part(
        &self,
        arrays: &Arrays,
        frame: FrameRecord,
        progress: &dyn Progress,
    ) -> surfel_core::Result<Part> {
        let mut times = PartTimes::default();
        for sample_idx in self.region.samples.0..self.region.samples.1 {
            let start = Instant::now();
            let is_first = (sample_idx == self.region.samples.0).into();
            arrays.wavefront.set_frame(self.gpu, &FrameRecord { sample_idx, is_first, ..frame });
            let Part::Done(of_sample) = self.render_sample(arrays, frame, progress)? else {
                return Ok(Part::Overflow);
            };
            times.slowest = times.slowest.max(start.elapsed());
            times.trace += of_sample.trace;
        }
        Ok(Part::Done(times))
    }

    /// Renders a sample, one wavefront after the other.
    fn render_sample(
        &self,
        arrays: &Arrays,
        frame: FrameRecord,
        progress: &dyn Progress,
    ) -> surfel_core::Result<Part> {
        let mut run = Run { job: self, arrays, n_pixels: frame.n_rays, parity: 0 };
        run.passes(&self.passes.camera, progress)?;
        let start = Instant::now();
        run.passes(&self.passes.trace, progress)?;
        let done = PartTimes { trace: start.elapsed(), ..PartTimes::default() };
        loop {
            for stage in &self.passes.shade {
                match stage {
                    PassStage::Once(passes) => run.passes(passes, progress)?,
                    PassStage::Surfaces(passes) => run.surfaces(passes, progress)?,
                }
            }
            let Some(next_wave) = self.passes.next_wave else { return Ok(Part::Done(done)) };
            match arrays.wavefront.read_counts(self.gpu)?.n_next_paths() {
                0 => return Ok(Part::Done(done)),
                n if frame.capacity < n => return Ok(Part::Overflow),
                _ => {}
            }
            run.parity = 1 - run.parity;
            run.submit(&[next_wave])?;
            run.passes(&self.passes.trace, progress)?;
        }
    }

    /// Returns the hits of the rays through the centres of the pixels of a part.
    fn find_aov_hits(
        &self,
        arrays: &Arrays,
        frame: FrameRecord,
        progress: &dyn Progress,
    ) -> surfel_core::Result<Vec<HitRecord>> {
        arrays.wavefront.set_frame(self.gpu, &frame);
        let run = Run { job: self, arrays, n_pixels: frame.n_rays, parity: 0 };
        run.passes(&self.passes.aov_hits, progress)?;
        run.passes(&self.passes.aov_supports, progress)?;
        Ok(arrays.wavefront.read_hits(self.gpu, frame.n_rays)?)
    }

    /// Sets the pixels from `first` on to the means of their samples over the background.
    fn resolve(&self, sums: &[[f32; 4]], first: u32, image: &mut Image) {
        let n_samples = self.region.n_samples() as f32;
        for (i, sum) in sums.iter().enumerate() {
            let pixel = first as usize + i;
            let y = self.region.rows.0 + (pixel / self.settings.width as usize) as u32;
            let height = (y as f32 + 0.5) / self.settings.height as f32;
            let background = Vec4::from_array(self.scene.background.color_at(height));
            let mean = Vec4::from_array(*sum) / n_samples;
            image.coverage[pixel] = mean.w;
            image.color[pixel] = (mean + (1.0 - mean.w) * background).to_array();
        }
    }
}

/// Returns the number of pixels of the part after one whose slowest sample took this time.
fn next_part(part: u32, slowest: Duration, max_part: u32) -> u32 {
    if MAX_SAMPLE_TIME < slowest {
        (part / 2).max(WORKGROUP_SIZE).min(max_part)
    } else if slowest < MAX_SAMPLE_TIME / 3 {
        (part * 2).min(max_part)
    } else {
        part
    }
}

/// The way of passes to the device.
struct Run<'a> {
    job: &'a Job<'a>,
    arrays: &'a Arrays,
    /// Number of pixels of the part.
    n_pixels: u32,
    /// Index of the array that holds the paths of the current wavefront.
    parity: usize,
}

impl Run<'_> {
    /// Runs passes, a few at once.
    fn passes(&self, passes: &[Pass], progress: &dyn Progress) -> surfel_core::Result<()> {
        for passes in passes.chunks(PASSES_AT_ONCE) {
            progress.check()?;
            self.submit(passes)?;
            self.job.gpu.wait()?;
        }
        Ok(())
    }

    /// Runs the passes that take rays through one surface each, until none is left or too many were passed.
    fn surfaces(&self, passes: &[Pass], progress: &dyn Progress) -> surfel_core::Result<()> {
        for _ in 0..MAX_SURFACES.div_ceil(SURFACES_AT_ONCE) {
            for _ in 0..SURFACES_AT_ONCE {
                self.passes(passes, progress)?;
            }
            if self.arrays.wavefront.read_counts(self.job.gpu)?.n_active() == 0 {
                break;
            }
        }
        Ok(())
    }

    /// Gives passes to the device.
    fn submit(&self, passes: &[Pass]) -> Result<()> {
        let gpu = self.job.gpu;
        gpu.catch("the passes", || {
            let description = wgpu::CommandEncoderDescriptor::default();
            let mut encoder = gpu.device.create_command_encoder(&description);
            {
                let description = wgpu::ComputePassDescriptor::default();
                let mut encoder = encoder.begin_compute_pass(&description);
                passes.iter().for_each(|pass| self.encode(&mut encoder, *pass));
            }
            gpu.queue.submit([encoder.finish()]);
        })
    }

    fn encode(&self, encoder: &mut wgpu::ComputePass, pass: Pass) {
        let Self { arrays: Arrays { wavefront, trees }, job, .. } = *self;
        let rays =
            if pass.is_of_light { &wavefront.light_rays } else { &wavefront.paths[self.parity] };
        let tree = pass.tree.and_then(|tree| trees.get(&tree));
        let is_paged = tree.is_some_and(|tree| tree.is_paged);
        encoder.set_pipeline(job.kernels.get(pass.kernel, is_paged));
        encoder.set_bind_group(0, &wavefront.uniforms, &[pass.task_offset]);
        encoder.set_bind_group(1, rays, &[]);
        match pass.kernel.resources() {
            Resources::Scene => encoder.set_bind_group(2, &wavefront.scene, &[]),
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
                encoder.dispatch_workgroups_indirect(&wavefront.dispatch_sizes, offset);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Parts grow while they are fast and shrink while they are slow.

    use super::*;

    #[test]
    fn parts_follow_the_speed_of_the_device() {
        let next = |part, millis| next_part(part, Duration::from_millis(millis), MAX_ENTRIES);
        assert_eq!(next(FIRST_PART, 1), 2 * FIRST_PART);
        assert_eq!(next(FIRST_PART, 100), FIRST_PART);
        assert_eq!(next(FIRST_PART, 300), FIRST_PART / 2);
        assert_eq!(next(WORKGROUP_SIZE, 9000), WORKGROUP_SIZE);
        assert_eq!(next(MAX_ENTRIES, 0), MAX_ENTRIES);
        assert_eq!(next_part(7, Duration::from_secs(9), 7), 7);
    }
}
