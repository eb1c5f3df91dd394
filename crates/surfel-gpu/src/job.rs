//! One picture: it is rendered part by part, each part sample by sample, each sample wavefront by wavefront.

use crate::aovs::{AovSource, set_aovs};
use crate::device::{DeviceKind, Gpu};
use crate::error::{Error, Result};
use crate::kernel_times::KernelTimes;
use crate::kernels::Kernels;
use crate::numbers::MAX_QUEUE_ENTRIES;
use crate::part_size::PartSize;
use crate::passes::{Pass, Passes};
use crate::pixel_order::{PixelOrder, set_pixels};
use crate::records::{FrameRecord, HitRecord};
use crate::scene_records::{SceneRecords, frame};
use crate::submitter::{Bound, Submitter, bind_trees};
use crate::upload::Uploads;
use crate::wavefront::{Arrays, Capacities, Contents, PartReadback, Wavefront};
use std::time::Instant;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::integrator::constants::MAX_SURFACES;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, RenderStats, Settings};
use surfel_core::scene::Background;

/// Maximum number of entries of a queue: it bounds the memory, up to 800 bytes an entry.
const MAX_ENTRIES: u64 = 1 << 20;
/// Maximum number of entries of a queue on devices with a large memory of their own. A pass takes as long as its slowest ray, so few
/// large passes are faster.
const MAX_ENTRIES_IN_LARGE_MEMORY: u64 = MAX_QUEUE_ENTRIES as u64;
/// Bytes from which on a memory is large.
const LARGE_MEMORY: u64 = 30 << 30;
/// Number of entries of a queue for each pixel, where paths have branches. A part whose paths have more is rendered
/// again in smaller parts.
const ENTRIES_PER_PIXEL: u32 = 4;
/// Minimum number of entries of a queue, where paths have branches or the memory is small.
const MIN_ENTRIES: u32 = 1 << 14;
/// Number of wavefronts after which the CPU asks whether any path is left. Passes over empty queues cost next to nothing.
const WAVES_AT_ONCE: usize = 4;
/// Number of surfaces that rays toward a light pass before the device is asked whether any is left.
const SURFACES_AT_ONCE: usize = 4;

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
    /// The sizes of the arrays.
    pub sizes: Capacities,
    /// The records that shading reads.
    pub records: SceneRecords,
    /// Texels and the like.
    pub words: &'a wgpu::Buffer,
}

/// The state that a renderer keeps from picture to picture, and that each of them changes.
pub struct RendererState<'a> {
    /// The large arrays.
    pub arrays: &'a mut Option<Arrays>,
    /// The times of kernels.
    pub times: &'a mut KernelTimes,
    /// The size of the next part.
    pub part_size: &'a mut PartSize,
}

/// A picture while its parts are rendered.
struct Picture<'a> {
    source: AovSource<'a>,
    order: PixelOrder,
    image: Image,
    stats: RenderStats,
    /// The time at which the last part was there.
    last_arrival: Instant,
    part_size: &'a mut PartSize,
    progress: &'a dyn Progress,
}

/// A part that the device works on.
struct Part<'a> {
    first: u32,
    n_pixels: u32,
    start: Instant,
    readback: PartReadback<'a>,
}

/// Whether a sample was submitted whole.
#[derive(PartialEq)]
enum Outcome {
    /// The sample was submitted whole.
    Done,
    /// A queue was too short.
    Overflow,
}

/// Returns the maximum number of entries of a queue on a device.
pub fn max_entries(gpu: &Gpu) -> u64 {
    // A hit is the largest entry.
    let fitting = gpu.info.max_array_bytes / size_of::<HitRecord>() as u64;
    let is_large = gpu.info.memory_bytes.is_some_and(|bytes| LARGE_MEMORY <= bytes);
    // An integrated GPU takes the memory of the processor.
    let is_own = gpu.info.kind == DeviceKind::Discrete;
    fitting.min(if is_large && is_own { MAX_ENTRIES_IN_LARGE_MEMORY } else { MAX_ENTRIES })
}

impl Job<'_> {
    /// Renders the picture.
    pub fn render(
        &self,
        state: RendererState,
        progress: &dyn Progress,
    ) -> surfel_core::Result<(Image, RenderStats)> {
        let Self { gpu, settings, region, sizes, .. } = *self;
        let start = Instant::now();
        let view = self.scene.camera.view(self.scene.origin, settings.width, settings.height);
        let order = PixelOrder::new(&region);
        progress.begin("render", order.n_pixels().into());
        let Self { records, words, .. } = self;
        let contents = Contents { scene: records, words, tasks: &self.passes.tasks };
        let arrays = Arrays::update(state.arrays, gpu, sizes)?;
        let wavefront = &Wavefront::new(gpu, self.kernels, arrays, contents)?;
        let trees = |tree| self.uploads.tree(&self.scene.geometries, tree);
        let bound = Bound {
            kernels: self.kernels,
            wavefront,
            trees: &bind_trees(gpu, self.kernels, trees, &self.passes)?,
        };
        let mut submitter = Submitter::new(gpu, bound, state.times, progress)?;
        let mut picture = Picture {
            source: AovSource { scene: self.scene, view: &view },
            order,
            image: region.blank_image(settings),
            stats: RenderStats::default(),
            last_arrival: start,
            part_size: state.part_size,
            progress,
        };
        let (capacity, n_samples) = (sizes.n_entries, region.n_samples());
        let frame = frame(self.scene, &view, settings);
        let PixelOrder { first_row, n_rows, first_column, n_columns } = order;
        let frame = FrameRecord {
            capacity,
            n_samples,
            first_row,
            n_rows,
            first_column,
            n_columns,
            ..frame
        };
        self.render_parts(&mut submitter, frame, &mut picture)?;
        let Picture { image, mut stats, .. } = picture;
        stats.trace_secs = submitter.primary_secs;
        stats.frame_secs = start.elapsed().as_secs_f64();
        Ok((image, stats))
    }

    /// Renders the parts of the picture, one after the other.
    fn render_parts(
        &self,
        submitter: &mut Submitter,
        frame: FrameRecord,
        picture: &mut Picture,
    ) -> surfel_core::Result<()> {
        let wavefront = submitter.wavefront();
        let n_pixels = picture.order.n_pixels();
        let (mut first_pixel, mut parity) = (0, 0);
        let mut working: Option<Part> = None;
        while first_pixel < n_pixels {
            let max_rays = self.sizes.n_pixels.min(n_pixels - first_pixel);
            let n_rays = picture.part_size.n_pixels().min(max_rays);
            let frame = FrameRecord { first_pixel, n_rays, ..frame };
            let start = Instant::now();
            if self.submit_part(submitter, frame)? == Outcome::Overflow {
                picture.part_size.limit(self.smaller_part(n_rays)?);
                continue;
            }
            self.add_aovs(submitter, frame, picture)?;
            let readback = wavefront.request_part(self.gpu, n_rays, parity);
            let part = Part { first: first_pixel, n_pixels: n_rays, start, readback };
            // While the CPU takes a part, the device works on the next one.
            if let Some(before) = working.replace(part) {
                self.take_part(before, picture)?;
            }
            first_pixel += n_rays;
            parity = 1 - parity;
        }
        if let Some(last) = working {
            if let Some(kernels) = submitter.last() {
                self.gpu.wait_for(kernels)?;
            }
            let finish = Instant::now();
            self.take_part(last, picture)?;
            picture.stats.transfer_secs = finish.elapsed().as_secs_f64();
        }
        Ok(())
    }

    /// Returns the sizes of the arrays of a picture with this number of pixels: the largest that fit the memory, or else
    /// the smallest that are sensible.
    pub fn sizes(
        gpu: &Gpu,
        scene: &FlatScene,
        passes: &Passes,
        n_pixels: u32,
        mut fits_memory: impl FnMut(Capacities) -> bool,
    ) -> Capacities {
        let mut max_entries = max_entries(gpu);
        loop {
            let sizes = Self::sizes_up_to(max_entries, scene, passes, n_pixels);
            if sizes.n_entries <= MIN_ENTRIES || fits_memory(sizes) {
                return sizes;
            }
            max_entries = u64::from(sizes.n_entries / 2);
        }
    }

    fn sizes_up_to(
        max_entries: u64,
        scene: &FlatScene,
        passes: &Passes,
        n_pixels: u32,
    ) -> Capacities {
        let n_pixels = u64::from(n_pixels);
        let has_waves = passes.next_wave.is_some();
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

    /// Returns the number of pixels of the parts after one of `n_pixels` whose paths did not fit the queues.
    fn smaller_part(&self, n_pixels: u32) -> Result<u32> {
        if n_pixels == 1 {
            let reason =
                "the paths of one pixel have more branches than its queues hold".to_owned();
            return Err(Error::Device { device: self.gpu.info.name.clone(), reason });
        }
        Ok((n_pixels / 4).max(1))
    }

    /// Gives all samples of a part to the device.
    fn submit_part(
        &self,
        submitter: &mut Submitter,
        frame: FrameRecord,
    ) -> surfel_core::Result<Outcome> {
        let wavefront = submitter.wavefront();
        submitter.n_pixels = frame.n_rays;
        wavefront.clear_counts(self.gpu);
        for sample_idx in self.region.samples.0..self.region.samples.1 {
            // The frame counts for all later submissions, so the passes of the sample before are submitted first.
            submitter.flush()?;
            let is_first = (sample_idx == self.region.samples.0).into();
            wavefront.set_frame(self.gpu, &FrameRecord { sample_idx, is_first, ..frame });
            if self.submit_sample(submitter)? == Outcome::Overflow {
                return Ok(Outcome::Overflow);
            }
        }
        submitter.add(&self.passes.resolve)?;
        submitter.flush()?;
        Ok(Outcome::Done)
    }

    /// Gives a sample to the device, some wavefronts at once.
    fn submit_sample(&self, submitter: &mut Submitter) -> surfel_core::Result<Outcome> {
        submitter.parity = 0;
        submitter.add(&self.passes.camera)?;
        submitter.is_primary = true;
        submitter.add(&self.passes.trace)?;
        submitter.is_primary = false;
        let mut n_waves = 0;
        loop {
            submitter.add(&self.passes.shade)?;
            self.submit_lights(submitter)?;
            let Some(next_wave) = &self.passes.next_wave else { return Ok(Outcome::Done) };
            n_waves += 1;
            if n_waves % WAVES_AT_ONCE == 0 {
                let counts = submitter.read_counts()?;
                if self.sizes.n_entries < counts.max_added() {
                    return Ok(Outcome::Overflow);
                }
                if counts.n_next_paths() == 0 {
                    return Ok(Outcome::Done);
                }
            }
            submitter.parity = 1 - submitter.parity;
            submitter.add([next_wave])?;
            submitter.add(&self.passes.trace)?;
        }
    }

    /// Gives the rays toward all lights to the device, sample by sample.
    fn submit_lights(&self, submitter: &mut Submitter) -> surfel_core::Result<()> {
        let Passes { lights, light_rays, surfaces, .. } = &self.passes;
        for light in lights {
            for sample in light.samples() {
                submitter.add([&sample])?;
                let Some(take) = &light.take else { continue };
                submitter.add([take])?;
                submitter.add(light_rays)?;
                if !surfaces.is_empty() {
                    submit_surfaces(submitter, surfaces)?;
                }
            }
        }
        Ok(())
    }

    /// Sets the AOVs of a part that was rendered, if they are wanted.
    fn add_aovs(
        &self,
        submitter: &mut Submitter,
        frame: FrameRecord,
        picture: &mut Picture,
    ) -> surfel_core::Result<()> {
        let Picture { source, order, image: Image { aovs: Some(aovs), .. }, .. } = picture else {
            return Ok(());
        };
        let wavefront = submitter.wavefront();
        wavefront.set_frame(self.gpu, &FrameRecord { is_centered: 1, ..frame });
        submitter.parity = 0;
        submitter.add(&self.passes.aov_hits)?;
        submitter.add(&self.passes.aov_supports)?;
        submitter.flush()?;
        let hits: Vec<HitRecord> = wavefront.read_hits(self.gpu, frame.n_rays)?;
        set_aovs(aovs, &hits, source, *order, frame.first_pixel);
        Ok(())
    }

    /// Waits for a part, adds it to the picture, and learns from its time how large those to come should be.
    fn take_part(&self, part: Part, picture: &mut Picture) -> surfel_core::Result<()> {
        let Part { first, n_pixels, start, readback } = part;
        let is_opaque = self.scene.background != Background::Transparent;
        let background_alpha = if is_opaque { 1.0 } else { 0.0 };
        let set = |colors: &[[f32; 4]]| {
            set_pixels(&mut picture.image, colors, first as usize, background_alpha);
        };
        let (counts, arrival) = readback.read(self.gpu, set)?;
        picture.stats.rays += counts.rays();
        // The device begins a part when it has finished the one before.
        let time = arrival.saturating_duration_since(start.max(picture.last_arrival));
        picture.part_size.learn(n_pixels, time / self.region.n_samples());
        picture.last_arrival = arrival;
        picture.progress.advance(n_pixels.into());
        Ok(())
    }
}

/// Runs the passes that take rays through one surface each, until none is left or too many were passed.
fn submit_surfaces(submitter: &mut Submitter, passes: &[Pass]) -> surfel_core::Result<()> {
    for _ in 0..MAX_SURFACES.div_ceil(SURFACES_AT_ONCE) {
        for _ in 0..SURFACES_AT_ONCE {
            submitter.add(passes)?;
        }
        if submitter.read_counts()?.n_active() == 0 {
            break;
        }
    }
    Ok(())
}
