//! The arrays of rays, hits and pixels that the passes work on, and the way of their results to the CPU.

use crate::device::Gpu;
use crate::error::Result;
use crate::kernels::{Kernels, bind};
use crate::numbers::count;
use crate::numbers::queue;
use crate::numbers::ray_kind;
use crate::records::{FrameRecord, HitRecord, Path, Pixel, ShadingPointRecord, pixel_sums};
use crate::scene_records::SceneRecords;
use std::sync::mpsc;
use surfel_core::image::decode_srgb8;
use surfel_core::integrator::RayCounts;
use surfel_core::integrator::constants::{ALBEDO_STEPS, directional_albedo};
use wgpu::BufferUsages as Usage;

/// Bytes between two tasks, which are chosen by their offset.
pub const RECORD_STRIDE: u64 = 256;
/// Bytes of the sizes of the dispatches over one queue.
pub const DISPATCH_BYTES: u64 = 12;

/// The arrays of one picture.
#[derive(Debug)]
pub struct Wavefront {
    frame: wgpu::Buffer,
    pixels: wgpu::Buffer,
    first_paths: wgpu::Buffer,
    hits: wgpu::Buffer,
    counts: wgpu::Buffer,
    readback: wgpu::Buffer,
    /// Sizes of the dispatches over the queues.
    pub dispatch_sizes: wgpu::Buffer,
    /// The uniforms: picture, task and tables.
    pub uniforms: wgpu::BindGroup,
    /// The arrays of paths, with either of two arrays as that of the current wavefront.
    pub paths: [wgpu::BindGroup; 2],
    /// The arrays of rays toward lights.
    pub light_rays: wgpu::BindGroup,
    /// The sizes of dispatches, as a kernel writes them.
    pub dispatches: wgpu::BindGroup,
    /// An array in the place of these sizes, for kernels that do not write them.
    pub unused: wgpu::BindGroup,
    /// The arrays of the scene.
    pub scene: wgpu::BindGroup,
}

/// The sizes of the arrays of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Capacities {
    /// Number of pixels of a part.
    pub n_pixels: u32,
    /// Number of entries of a queue.
    pub n_entries: u32,
    /// True if paths have more than one ray.
    pub has_waves: bool,
    /// True if light passes surfaces.
    pub is_transmissive: bool,
}

/// The contents of a picture's arrays.
#[derive(Clone, Copy, Debug)]
pub struct Contents<'a> {
    /// Records of the scene.
    pub scene: &'a SceneRecords,
    /// Texels and the like.
    pub words: &'a wgpu::Buffer,
    /// Tasks of passes, at multiples of `RECORD_STRIDE`.
    pub tasks: &'a [u8],
}

/// The lengths of queues and the numbers of rays, as the kernels count them.
#[derive(Clone, Debug)]
pub struct Counts(Vec<u32>);

impl Counts {
    /// Returns the number of paths of the next wavefront.
    pub fn n_next_paths(&self) -> u32 {
        self.0[(count::FIRST_ADDED + queue::PATHS) as usize]
    }

    /// Returns the number of rays toward a light that are still on their way.
    pub fn n_active(&self) -> u32 {
        self.0[count::N_ACTIVE as usize]
    }

    /// Returns the numbers of rays traced.
    pub fn rays(&self) -> RayCounts {
        let n = |kind: u32| self.0[(count::FIRST_TRACED + kind) as usize].into();
        RayCounts {
            primary: n(ray_kind::PRIMARY),
            shadow: n(ray_kind::SHADOW),
            sky: n(ray_kind::SKY),
            secondary: n(ray_kind::SECONDARY),
        }
    }
}

impl Wavefront {
    /// Makes the arrays.
    pub fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        sizes: Capacities,
        contents: Contents,
    ) -> Result<Self> {
        let array = |label, n: u32, size: usize, usage| {
            gpu.buffer(label, u64::from(n) * size as u64, Usage::STORAGE | usage)
        };
        let Capacities { n_pixels, n_entries, .. } = sizes;
        let of_paths = Usage::COPY_DST | Usage::COPY_SRC;
        let paths = |label, n| array(label, n, size_of::<Path>(), of_paths);
        let n_seconds = if sizes.has_waves { n_entries } else { 1 };
        let (first, second) = (paths("paths", n_entries)?, paths("next paths", n_seconds)?);
        let (light_rays, unused) = (paths("rays toward lights", n_entries)?, paths("unused", 1)?);
        let hit_bytes = size_of::<HitRecord>();
        let hits = array("hits", n_entries, hit_bytes, Usage::COPY_SRC)?;
        let n_light_hits = if sizes.is_transmissive { n_entries } else { 1 };
        let light_hits = array("hits of light", n_light_hits, hit_bytes, Usage::empty())?;
        let points = array("points", n_entries, size_of::<ShadingPointRecord>(), Usage::empty())?;
        let pixels = array("pixels", n_pixels, size_of::<Pixel>(), Usage::COPY_SRC)?;
        let counts = [0u8; 4 * count::N_COUNTS as usize];
        let counts = written(gpu, "counts", &counts, Usage::STORAGE | Usage::COPY_SRC)?;
        let dispatch_bytes = DISPATCH_BYTES * u64::from(queue::N_QUEUES + 1);
        let dispatch_sizes =
            gpu.buffer("sizes", dispatch_bytes, Usage::STORAGE | Usage::INDIRECT)?;
        let unused_sizes = gpu.buffer("unused", dispatch_bytes, Usage::STORAGE)?;
        let tasks = written(gpu, "tasks", contents.tasks, Usage::UNIFORM)?;
        let tables = written(gpu, "tables", bytemuck::cast_slice(&tables()), Usage::UNIFORM)?;
        let frame_bytes = size_of::<FrameRecord>() as u64;
        let frame = gpu.buffer("picture", frame_bytes, Usage::UNIFORM | Usage::COPY_DST)?;
        let readback_bytes = u64::from(n_pixels) * hit_bytes as u64;
        let readback_bytes = readback_bytes.max(4 * u64::from(count::N_COUNTS));
        let readback = gpu.buffer("results", readback_bytes, Usage::MAP_READ | Usage::COPY_DST)?;
        let SceneRecords { materials, instances, lights } = contents.scene;
        let scene = [
            written(gpu, "materials", bytemuck::cast_slice(materials), Usage::STORAGE)?,
            written(gpu, "instances", bytemuck::cast_slice(instances), Usage::STORAGE)?,
            written(gpu, "lights", bytemuck::cast_slice(lights), Usage::STORAGE)?,
        ];
        let task = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &tasks,
            offset: 0,
            size: wgpu::BufferSize::new(RECORD_STRIDE),
        });
        gpu.catch("the arrays of rays", || {
            let rays = |paths: &wgpu::Buffer, hits: &wgpu::Buffer, next: &wgpu::Buffer| {
                let arrays = [paths, hits, next, &points, &pixels, &counts];
                bind(gpu, &kernels.rays, &arrays.map(wgpu::Buffer::as_entire_binding))
            };
            let uniforms = [frame.as_entire_binding(), task, tables.as_entire_binding()];
            let [materials, instances, lights] = &scene;
            let scene = [materials, instances, lights, contents.words];
            Self {
                uniforms: bind(gpu, &kernels.uniforms, &uniforms),
                paths: [rays(&first, &hits, &second), rays(&second, &hits, &first)],
                light_rays: rays(&light_rays, &light_hits, &unused),
                dispatches: bind(gpu, &kernels.dispatches, &[dispatch_sizes.as_entire_binding()]),
                unused: bind(gpu, &kernels.dispatches, &[unused_sizes.as_entire_binding()]),
                scene: bind(gpu, &kernels.scene, &scene.map(wgpu::Buffer::as_entire_binding)),
                frame,
                pixels,
                first_paths: first,
                hits,
                counts,
                readback,
                dispatch_sizes,
            }
        })
    }

    /// Sets the part of the picture that the next passes render.
    pub fn set_frame(&self, gpu: &Gpu, frame: &FrameRecord) {
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
    }

    /// Returns the sums of the first `n` pixels.
    pub fn read_pixels(&self, gpu: &Gpu, n: u32) -> Result<Vec<[f32; 4]>> {
        let n_bytes = u64::from(n) * size_of::<Pixel>() as u64;
        let pixels: Vec<Pixel> = self.read(gpu, &self.pixels, n_bytes)?;
        Ok(pixels.iter().map(pixel_sums).collect())
    }

    /// Returns the hits of the first `n` rays.
    pub fn read_hits(&self, gpu: &Gpu, n: u32) -> Result<Vec<HitRecord>> {
        self.read(gpu, &self.hits, u64::from(n) * size_of::<HitRecord>() as u64)
    }

    /// Sets the first paths of the first wavefront.
    pub fn write_paths(&self, gpu: &Gpu, paths: &[Path]) {
        gpu.queue.write_buffer(&self.first_paths, 0, bytemuck::cast_slice(paths));
    }

    /// Returns the first `n` paths of the first wavefront.
    pub fn read_paths(&self, gpu: &Gpu, n: u32) -> Result<Vec<Path>> {
        self.read(gpu, &self.first_paths, u64::from(n) * size_of::<Path>() as u64)
    }

    /// Sets the numbers of entries that were added to all queues.
    pub fn fill_queues(&self, gpu: &Gpu, n: u32) {
        let counts = [n; queue::N_QUEUES as usize];
        let offset = 4 * u64::from(count::FIRST_ADDED);
        gpu.queue.write_buffer(&self.counts, offset, bytemuck::cast_slice(&counts));
    }

    /// Returns what the kernels have counted so far.
    pub fn read_counts(&self, gpu: &Gpu) -> Result<Counts> {
        self.read(gpu, &self.counts, 4 * u64::from(count::N_COUNTS)).map(Counts)
    }

    /// Sets all counts to zero.
    pub fn clear_counts(&self, gpu: &Gpu) {
        gpu.queue.write_buffer(&self.counts, 0, &[0; 4 * count::N_COUNTS as usize]);
    }

    fn read<T: bytemuck::Pod>(
        &self,
        gpu: &Gpu,
        buffer: &wgpu::Buffer,
        n_bytes: u64,
    ) -> Result<Vec<T>> {
        let description = wgpu::CommandEncoderDescriptor::default();
        let mut encoder = gpu.device.create_command_encoder(&description);
        encoder.copy_buffer_to_buffer(buffer, 0, &self.readback, 0, n_bytes);
        gpu.queue.submit([encoder.finish()]);
        let slice = self.readback.slice(..n_bytes);
        let (sender, receiver) = mpsc::channel();
        // If the receiver is gone, the wait has failed before.
        slice.map_async(wgpu::MapMode::Read, move |result| _ = sender.send(result));
        gpu.wait()?;
        let unreadable =
            |reason: String| gpu.keep_failure(format!("results cannot be read: {reason}"));
        let mapped = receiver.try_recv().map_err(|error| unreadable(error.to_string()))?;
        mapped.map_err(|error| unreadable(error.to_string()))?;
        let view = slice.get_mapped_range().map_err(|error| unreadable(error.to_string()))?;
        let values = bytemuck::pod_collect_to_vec(&view);
        drop(view);
        self.readback.unmap();
        Ok(values)
    }
}

/// Returns the linear values of 8-bit sRGB values, and the directional albedos of rough mirrors by roughness and cosine.
fn tables() -> Vec<f32> {
    let step = |i: usize| i as f32 / (ALBEDO_STEPS - 1) as f32;
    let albedo = |i: usize| directional_albedo(step(i % ALBEDO_STEPS), step(i / ALBEDO_STEPS));
    (0..=255).map(decode_srgb8).chain((0..ALBEDO_STEPS.pow(2)).map(albedo)).collect()
}

/// Makes a buffer with these contents, which must not be empty.
pub fn written(gpu: &Gpu, label: &str, bytes: &[u8], usage: Usage) -> Result<wgpu::Buffer> {
    let buffer = gpu.buffer(label, bytes.len() as u64, usage | Usage::COPY_DST)?;
    gpu.queue.write_buffer(&buffer, 0, bytes);
    Ok(buffer)
}
