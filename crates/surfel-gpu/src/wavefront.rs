//! The arrays of rays, hits and pixels that the passes work on, and the way of their results to the CPU.

use crate::device::Gpu;
use crate::error::Result;
use crate::kernels::{Kernels, bind};
use crate::records::ray_kind::N_KINDS;
use crate::records::{FrameRecord, HitRecord, MaterialRecord, Pixel, ShadowRay};
use std::sync::mpsc;
use surfel_core::image::decode_srgb8;
use surfel_core::integrator::RayCounts;
use surfel_core::math::Ray;
use wgpu::BufferUsages as Usage;

/// Bytes between two records that are chosen by their offset.
pub const RECORD_STRIDE: u64 = 256;

/// The arrays of one picture.
#[derive(Debug)]
pub struct Wavefront {
    frame: wgpu::Buffer,
    pixels: wgpu::Buffer,
    hits: wgpu::Buffer,
    counts: wgpu::Buffer,
    readback: wgpu::Buffer,
    /// The uniforms: picture, instance or light, and the table of sRGB.
    pub uniforms: wgpu::BindGroup,
    /// The arrays of rays.
    pub rays: wgpu::BindGroup,
}

impl Wavefront {
    /// Makes arrays for `capacity` rays, with these materials and with `records` at multiples of `RECORD_STRIDE`.
    pub fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        capacity: u32,
        materials: &[MaterialRecord],
        records: &[u8],
    ) -> Result<Self> {
        let array = |label, size: usize, usage| {
            gpu.buffer(label, u64::from(capacity) * size as u64, Usage::STORAGE | usage)
        };
        let rays = array("rays", size_of::<Ray>(), Usage::empty())?;
        let hits = array("hits", size_of::<HitRecord>(), Usage::COPY_SRC)?;
        let shadow_rays = array("shadow rays", size_of::<ShadowRay>(), Usage::empty())?;
        let pixels = array("pixels", size_of::<Pixel>(), Usage::COPY_SRC)?;
        let counts = written(gpu, "counts", &[0; 4 * N_KINDS], Usage::STORAGE | Usage::COPY_SRC)?;
        let materials = written(gpu, "materials", bytemuck::cast_slice(materials), Usage::STORAGE)?;
        let records = written(gpu, "records", records, Usage::UNIFORM)?;
        let table: Vec<f32> = (0..=255).map(decode_srgb8).collect();
        let srgb = written(gpu, "sRGB", bytemuck::cast_slice(&table), Usage::UNIFORM)?;
        let frame_bytes = size_of::<FrameRecord>() as u64;
        let frame = gpu.buffer("picture", frame_bytes, Usage::UNIFORM | Usage::COPY_DST)?;
        let readback_bytes = u64::from(capacity) * size_of::<HitRecord>() as u64;
        let readback = gpu.buffer("results", readback_bytes, Usage::MAP_READ | Usage::COPY_DST)?;
        let record = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &records,
            offset: 0,
            size: wgpu::BufferSize::new(RECORD_STRIDE),
        });
        gpu.catch("the arrays of rays", || {
            let uniforms = [frame.as_entire_binding(), record, srgb.as_entire_binding()];
            let arrays = [&rays, &hits, &shadow_rays, &pixels, &materials, &counts];
            let arrays = arrays.map(wgpu::Buffer::as_entire_binding);
            let uniforms = bind(gpu, &kernels.uniforms, &uniforms);
            let rays = bind(gpu, &kernels.rays, &arrays);
            Self { frame, pixels, hits, counts, readback, uniforms, rays }
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
        Ok(pixels.iter().map(|pixel| pixel.sum).collect())
    }

    /// Returns the hits of the first `n` rays.
    pub fn read_hits(&self, gpu: &Gpu, n: u32) -> Result<Vec<HitRecord>> {
        self.read(gpu, &self.hits, u64::from(n) * size_of::<HitRecord>() as u64)
    }

    /// Returns the numbers of rays traced so far.
    pub fn read_counts(&self, gpu: &Gpu) -> Result<RayCounts> {
        let counts: Vec<u32> = self.read(gpu, &self.counts, 4 * N_KINDS as u64)?;
        let [primary, shadow, sky, _] = [counts[0], counts[1], counts[2], counts[3]].map(u64::from);
        Ok(RayCounts { primary, shadow, sky, secondary: 0 })
    }

    /// Sets the numbers of rays traced to zero.
    pub fn clear_counts(&self, gpu: &Gpu) {
        gpu.queue.write_buffer(&self.counts, 0, &[0; 4 * N_KINDS]);
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

/// Makes a buffer with these contents, which must not be empty.
fn written(gpu: &Gpu, label: &str, bytes: &[u8], usage: Usage) -> Result<wgpu::Buffer> {
    let buffer = gpu.buffer(label, bytes.len() as u64, usage | Usage::COPY_DST)?;
    gpu.queue.write_buffer(&buffer, 0, bytes);
    Ok(buffer)
}
