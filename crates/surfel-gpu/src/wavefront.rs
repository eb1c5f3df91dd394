//! The arrays of rays, hits and pixels that the passes work on, and the way of their results to the CPU.

use crate::device::Gpu;
use crate::error::Result;
use crate::kernels::{Kernels, bind};
use crate::numbers::count;
use crate::numbers::queue;
use crate::numbers::ray_kind;
use crate::readback::Readback;
use crate::records::{FrameRecord, HitRecord, Path, Pixel, SearchState, ShadingPointRecord};
use crate::scene_records::SceneRecords;
use std::time::Instant;
use surfel_core::image::decode_srgb8;
use surfel_core::integrator::RayCounts;
use surfel_core::integrator::constants::{ALBEDO_STEPS, directional_albedo};
use wgpu::BufferUsages as Usage;

/// Bytes between two tasks, which are chosen by their offset.
pub const RECORD_STRIDE: u64 = 256;
/// Bytes of the sizes of the dispatches over one queue.
pub const DISPATCH_BYTES: u64 = 12;

/// Bytes of the counts before the colours of pixels in a readback: colours begin at a multiple of their size.
const COUNT_BYTES: u64 = 256;
/// Maximum number of bytes of hits and the like that are read at once.
const MAX_READ_BYTES: u64 = 1 << 24;

/// The large arrays, which a renderer keeps from picture to picture. A picture reads nothing that one before it left.
#[derive(Debug)]
pub struct Arrays {
    sizes: Capacities,
    paths: [wgpu::Buffer; 2],
    hits: wgpu::Buffer,
    light_rays: wgpu::Buffer,
    light_hits: wgpu::Buffer,
    points: wgpu::Buffer,
    search_states: wgpu::Buffer,
    pixels: wgpu::Buffer,
    colors: wgpu::Buffer,
    counts: wgpu::Buffer,
    tables: wgpu::Buffer,
    unused_paths: wgpu::Buffer,
    unused_sizes: wgpu::Buffer,
    /// Two buffers for the counts and colours of a part, in turn.
    part_readbacks: [wgpu::Buffer; 2],
    readback: wgpu::Buffer,
    /// Sizes of the dispatches over the queues.
    pub dispatch_sizes: wgpu::Buffer,
}

/// The arrays bound for the passes of one picture, with its small ones.
#[derive(Debug)]
pub struct Wavefront<'a> {
    /// The large arrays.
    pub arrays: &'a Arrays,
    frame: wgpu::Buffer,
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
    /// The colours of pixels.
    pub colors: wgpu::BindGroup,
    /// The arrays of the scene.
    pub scene: wgpu::BindGroup,
}

/// The sizes of the arrays of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

impl Capacities {
    /// Returns true if arrays of these sizes hold what is wanted.
    fn hold(&self, wanted: &Self) -> bool {
        wanted.n_pixels <= self.n_pixels
            && wanted.n_entries <= self.n_entries
            && wanted.has_waves <= self.has_waves
            && wanted.is_transmissive <= self.is_transmissive
    }
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

    /// Returns the greatest number of entries that were added to a queue.
    pub fn max_added(&self) -> u32 {
        self.0[count::MAX_ADDED as usize].max(self.n_next_paths())
    }

    /// Returns the number of rays toward a light that are still on their way.
    pub fn n_active(&self) -> u32 {
        self.0[count::N_ACTIVE as usize]
    }

    /// Returns the numbers of rays traced.
    pub fn rays(&self) -> RayCounts {
        let word = |idx: u32| u64::from(self.0[idx as usize]);
        let n = |kind: u32| {
            word(count::FIRST_TRACED_UPPER + kind) << 32 | word(count::FIRST_TRACED + kind)
        };
        RayCounts {
            primary: n(ray_kind::PRIMARY),
            shadow: n(ray_kind::SHADOW),
            sky: n(ray_kind::SKY),
            secondary: n(ray_kind::SECONDARY),
        }
    }
}

impl Arrays {
    /// Frees `known` if it does not hold what is wanted, or if it holds more and leaves no room for the rest of a picture.
    /// Returns the sizes of the arrays that the picture will have.
    ///
    /// # Errors
    ///
    /// Fails if the device does.
    pub fn free_unless_fitting(
        known: &mut Option<Self>,
        gpu: &Gpu,
        wanted: Capacities,
        fits_memory: impl FnOnce(Capacities) -> bool,
    ) -> Result<Capacities> {
        if let Some(Self { sizes, .. }) = *known {
            if sizes == wanted || sizes.hold(&wanted) && fits_memory(sizes) {
                return Ok(sizes);
            }
            // The memory never holds both. It is free once the device has finished with it.
            *known = None;
            gpu.wait()?;
        }
        Ok(wanted)
    }

    /// Returns `known`, which [`Arrays::free_unless_fitting`] has left, or new arrays that hold what is wanted.
    ///
    /// # Errors
    ///
    /// Fails if the device has too little memory.
    pub fn update<'a>(
        known: &'a mut Option<Self>,
        gpu: &Gpu,
        wanted: Capacities,
    ) -> Result<&'a Self> {
        let arrays = match known.take() {
            Some(arrays) => arrays,
            None => Self::new(gpu, wanted)?,
        };
        Ok(known.insert(arrays))
    }

    /// Returns the sizes.
    #[cfg(test)]
    pub fn sizes(&self) -> Capacities {
        self.sizes
    }

    /// Returns the bytes of arrays of these sizes, as `new` makes them.
    pub fn n_bytes(sizes: Capacities) -> u64 {
        let Capacities { n_pixels, n_entries, has_waves, is_transmissive } = sizes;
        let n_path_arrays = if has_waves { 3 } else { 2 };
        let n_hit_arrays = if is_transmissive { 2 } else { 1 };
        let of_entry = n_path_arrays * size_of::<Path>()
            + n_hit_arrays * size_of::<HitRecord>()
            + size_of::<ShadingPointRecord>()
            + size_of::<SearchState>();
        // Colours come back through two arrays in turn.
        let of_pixel = size_of::<Pixel>() + 3 * size_of::<[f32; 4]>();
        let hit_bytes = u64::from(n_entries) * size_of::<HitRecord>() as u64;
        u64::from(n_entries) * of_entry as u64
            + u64::from(n_pixels) * of_pixel as u64
            + hit_bytes.min(MAX_READ_BYTES)
    }

    fn new(gpu: &Gpu, sizes: Capacities) -> Result<Self> {
        let array = |label, n: u32, size: usize, usage| {
            gpu.buffer(label, u64::from(n) * size as u64, Usage::STORAGE | usage)
        };
        let Capacities { n_pixels, n_entries, .. } = sizes;
        let paths =
            |label, n| array(label, n, size_of::<Path>(), Usage::COPY_DST | Usage::COPY_SRC);
        let hits = |label, n| array(label, n, size_of::<HitRecord>(), Usage::COPY_SRC);
        let of_cpu = Usage::MAP_READ | Usage::COPY_DST;
        let part_bytes = COUNT_BYTES + u64::from(n_pixels) * size_of::<[f32; 4]>() as u64;
        let part = || gpu.buffer("colours and counts", part_bytes, of_cpu);
        let hit_bytes = u64::from(n_entries) * size_of::<HitRecord>() as u64;
        let read_bytes = hit_bytes.clamp(COUNT_BYTES, MAX_READ_BYTES);
        let count_bytes = 4 * u64::from(count::N_COUNTS);
        let of_counts = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST;
        let dispatch_bytes = DISPATCH_BYTES * u64::from(queue::N_QUEUES);
        let of_points = size_of::<ShadingPointRecord>();
        Ok(Self {
            sizes,
            paths: [
                paths("paths", n_entries)?,
                paths("next paths", if sizes.has_waves { n_entries } else { 1 })?,
            ],
            hits: hits("hits", n_entries)?,
            light_rays: paths("rays toward lights", n_entries)?,
            light_hits: hits("hits of light", if sizes.is_transmissive { n_entries } else { 1 })?,
            points: array("points", n_entries, of_points, Usage::empty())?,
            search_states: array(
                "search states",
                n_entries,
                size_of::<SearchState>(),
                Usage::COPY_SRC,
            )?,
            pixels: array("pixels", n_pixels, size_of::<Pixel>(), Usage::empty())?,
            colors: array("colours", n_pixels, size_of::<[f32; 4]>(), Usage::COPY_SRC)?,
            counts: gpu.buffer("counts", count_bytes, of_counts)?,
            tables: written(gpu, "tables", bytemuck::cast_slice(&tables()), Usage::UNIFORM)?,
            unused_paths: paths("unused", 1)?,
            unused_sizes: gpu.buffer("unused", dispatch_bytes, Usage::STORAGE)?,
            part_readbacks: [part()?, part()?],
            readback: gpu.buffer("results", read_bytes, of_cpu)?,
            dispatch_sizes: gpu.buffer(
                "sizes",
                dispatch_bytes,
                Usage::STORAGE | Usage::INDIRECT,
            )?,
        })
    }
}

impl<'a> Wavefront<'a> {
    /// Binds the arrays for a picture.
    ///
    /// # Errors
    ///
    /// Fails if the device does.
    pub fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        arrays: &'a Arrays,
        contents: Contents,
    ) -> Result<Self> {
        let Arrays { hits, points, pixels, counts, search_states, tables, .. } = arrays;
        let tasks = written(gpu, "tasks", contents.tasks, Usage::UNIFORM)?;
        let frame_bytes = size_of::<FrameRecord>() as u64;
        let frame = gpu.buffer("picture", frame_bytes, Usage::UNIFORM | Usage::COPY_DST)?;
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
                let arrays = [paths, hits, next, points, pixels, counts, search_states];
                bind(gpu, &kernels.rays, &arrays.map(wgpu::Buffer::as_entire_binding))
            };
            let output =
                |array: &wgpu::Buffer| bind(gpu, &kernels.output, &[array.as_entire_binding()]);
            let uniforms = [frame.as_entire_binding(), task, tables.as_entire_binding()];
            let [materials, instances, lights] = &scene;
            let scene = [materials, instances, lights, contents.words];
            let [first, second] = &arrays.paths;
            Self {
                arrays,
                uniforms: bind(gpu, &kernels.uniforms, &uniforms),
                paths: [rays(first, hits, second), rays(second, hits, first)],
                light_rays: rays(&arrays.light_rays, &arrays.light_hits, &arrays.unused_paths),
                dispatches: output(&arrays.dispatch_sizes),
                unused: output(&arrays.unused_sizes),
                colors: output(&arrays.colors),
                scene: bind(gpu, &kernels.scene, &scene.map(wgpu::Buffer::as_entire_binding)),
                frame,
            }
        })
    }

    /// Sets the part of the picture that the next passes render.
    pub fn set_frame(&self, gpu: &Gpu, frame: &FrameRecord) {
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
    }

    /// Asks for the counts and the colours of the first `n` pixels. Two parts may be on their way, of different parity.
    pub fn request_part(&self, gpu: &Gpu, n: u32, parity: usize) -> PartReadback<'a> {
        let Arrays { colors, counts, part_readbacks, .. } = self.arrays;
        let buffer = &part_readbacks[parity];
        let color_bytes = u64::from(n) * size_of::<[f32; 4]>() as u64;
        PartReadback(Readback::new(gpu, buffer, COUNT_BYTES + color_bytes, |encoder| {
            encoder.copy_buffer_to_buffer(counts, 0, buffer, 0, counts.size());
            encoder.copy_buffer_to_buffer(colors, 0, buffer, COUNT_BYTES, color_bytes);
        }))
    }

    /// Returns the hits of the first `n` rays.
    pub fn read_hits(&self, gpu: &Gpu, n: u32) -> Result<Vec<HitRecord>> {
        self.read(gpu, &self.arrays.hits, n)
    }

    /// Returns the discs that were found on the first `n` rays.
    pub fn read_search_states(&self, gpu: &Gpu, n: u32) -> Result<Vec<SearchState>> {
        self.read(gpu, &self.arrays.search_states, n)
    }

    /// Sets the first paths of the first wavefront.
    pub fn write_paths(&self, gpu: &Gpu, paths: &[Path]) {
        gpu.queue.write_buffer(&self.arrays.paths[0], 0, bytemuck::cast_slice(paths));
    }

    /// Returns the first `n` paths of the first wavefront.
    pub fn read_paths(&self, gpu: &Gpu, n: u32) -> Result<Vec<Path>> {
        self.read(gpu, &self.arrays.paths[0], n)
    }

    /// Sets the number of entries that were added to the queue of paths, and all other counts to zero.
    pub fn fill_paths(&self, gpu: &Gpu, n: u32) {
        let mut counts = [0u32; count::N_COUNTS as usize];
        counts[(count::FIRST_ADDED + queue::PATHS) as usize] = n;
        gpu.queue.write_buffer(&self.arrays.counts, 0, bytemuck::cast_slice(&counts));
    }

    /// Returns what the kernels have counted so far.
    pub fn read_counts(&self, gpu: &Gpu) -> Result<Counts> {
        self.read(gpu, &self.arrays.counts, count::N_COUNTS).map(Counts)
    }

    /// Sets all counts to zero.
    pub fn clear_counts(&self, gpu: &Gpu) {
        gpu.queue.write_buffer(&self.arrays.counts, 0, &[0; 4 * count::N_COUNTS as usize]);
    }

    /// Returns the first `n` records of an array.
    fn read<T: bytemuck::Pod>(&self, gpu: &Gpu, array: &wgpu::Buffer, n: u32) -> Result<Vec<T>> {
        let buffer = &self.arrays.readback;
        let record_bytes = size_of::<T>() as u64;
        let chunk_size = buffer.size() / record_bytes;
        let mut records = Vec::with_capacity(n as usize);
        while (records.len() as u64) < u64::from(n) {
            let first = records.len() as u64;
            let n_bytes = chunk_size.min(u64::from(n) - first) * record_bytes;
            let readback = Readback::new(gpu, buffer, n_bytes, |encoder| {
                let offset = first * record_bytes;
                encoder.copy_buffer_to_buffer(array, offset, buffer, 0, n_bytes);
            });
            let read = |bytes: &[u8]| records.extend(bytemuck::pod_collect_to_vec::<_, T>(bytes));
            readback.read(gpu, read)?;
        }
        Ok(records)
    }
}

/// The counts and colours of a part on their way to the CPU.
#[derive(Debug)]
pub struct PartReadback<'a>(Readback<'a>);

impl PartReadback<'_> {
    /// Waits for the part, gives its colours to `read`, and returns its counts and the time at which it was there.
    ///
    /// # Errors
    ///
    /// Fails if the device does.
    pub fn read(self, gpu: &Gpu, read: impl FnOnce(&[[f32; 4]])) -> Result<(Counts, Instant)> {
        self.0.read(gpu, |bytes| {
            let (counts, colors) = bytes.split_at(COUNT_BYTES as usize);
            read(bytemuck::cast_slice(colors));
            Counts(bytemuck::pod_collect_to_vec(&counts[..4 * count::N_COUNTS as usize]))
        })
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
