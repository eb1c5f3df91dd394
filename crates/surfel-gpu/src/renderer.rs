//! The GPU renderer: it renders a picture part by part, each part sample by sample.

use crate::aovs::{AovSource, set_aovs};
use crate::device::{DeviceInfo, Gpu};
use crate::error::{Error, Result};
use crate::kernels::Kernels;
use crate::passes::{Pass, Passes, frame, materials};
use crate::records::{FrameRecord, HitRecord};
use crate::shader::WORKGROUP_SIZE;
use crate::unsupported::unsupported;
use crate::upload::Uploads;
use crate::wavefront::Wavefront;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::math::Vec4;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, RenderStats, Renderer, Settings, check};

/// A renderer that runs on a GPU. Pictures that are asked for at the same time are rendered one after the other.
#[derive(Debug)]
pub struct GpuRenderer {
    gpu: Gpu,
    state: Mutex<State>,
}

/// Kernels and points, kept from picture to picture.
#[derive(Debug)]
struct State {
    kernels: Kernels,
    uploads: Uploads,
}

/// Number of rays of the first part of a picture.
const FIRST_PART: u32 = 1 << 12;
/// Maximum number of rays of a part: it bounds the memory, 240 bytes a ray.
const MAX_PART: u32 = 1 << 20;
/// Number of passes that the device is given at once. Between them work can be cancelled, and the wait for them is far
/// shorter than its limit, also on slow devices and with many light samples.
const PASSES_AT_ONCE: usize = 16;
/// Time of a sample of a part above which the next part is smaller, and well below which it is larger. A device that
/// also draws a screen must not be busy for long, and work is cancelled between samples.
const MAX_SAMPLE_TIME: Duration = Duration::from_millis(200);

impl GpuRenderer {
    /// Opens the device with this index or name, or the one that is preferred.
    ///
    /// # Errors
    /// Fails if there is no such device, if it allows less than is needed, or if its driver refuses to open it.
    pub fn open(selector: Option<&str>) -> Result<Self> {
        let gpu = Gpu::open(selector)?;
        let state = State { kernels: Kernels::new(&gpu)?, uploads: Uploads::default() };
        Ok(Self { gpu, state: Mutex::new(state) })
    }

    /// Returns the device.
    pub fn device(&self) -> &DeviceInfo {
        &self.gpu.info
    }
}

impl Renderer for GpuRenderer {
    fn render_region(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> surfel_core::Result<(Image, RenderStats)> {
        settings.check()?;
        region.check(settings)?;
        check(scene)?;
        let missing = unsupported(scene);
        if !missing.is_empty() {
            let device = self.gpu.info.name.clone();
            let reason = format!("the GPU does not render {} yet", missing.join(", "));
            return Err(Error::Device { device, reason }.into());
        }
        self.gpu.check()?;
        // A panic elsewhere leaves nothing half done here: kernels and uploads are added when they are complete.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let State { kernels, uploads } = &mut *state;
        let passes = Passes::new(scene, settings);
        let all = passes.passes.iter().chain(&passes.aov_passes);
        kernels.compile(&self.gpu, all.map(|pass| pass.kernel))?;
        uploads.update(&self.gpu, kernels, &scene.geometries)?;
        // The kernels number pixels row by row.
        let rows = RenderRegion { columns: RenderRegion::whole(settings).columns, ..region };
        let job = Job { gpu: &self.gpu, kernels, uploads, scene, settings, region: rows, passes };
        let (image, stats) = job.render(progress)?;
        Ok((image.with_columns(region.columns), stats))
    }
}

/// One picture.
struct Job<'a> {
    gpu: &'a Gpu,
    kernels: &'a Kernels,
    uploads: &'a Uploads,
    scene: &'a FlatScene,
    settings: &'a Settings,
    region: RenderRegion,
    passes: Passes,
}

impl Job<'_> {
    fn render(&self, progress: &dyn Progress) -> surfel_core::Result<(Image, RenderStats)> {
        let Self { gpu, settings, region, .. } = *self;
        let start = Instant::now();
        let n_pixels = u64::from(settings.width) * u64::from(region.n_rows());
        progress.begin("render", n_pixels);
        let capacity = n_pixels.min(MAX_PART.into()) as u32;
        let materials = materials(self.scene);
        let records = &self.passes.records;
        let wavefront = Wavefront::new(gpu, self.kernels, capacity, &materials, records)?;
        let view = self.scene.camera.view(self.scene.origin, settings.width, settings.height);
        let frame = frame(self.scene, &view, settings);
        let mut image = region.blank_image(settings);
        let mut stats = RenderStats::default();
        let (mut done, mut part) = (0, FIRST_PART.min(capacity));
        while done < n_pixels {
            let n_rays = u64::from(part).min(n_pixels - done) as u32;
            // Pictures have at most 2^28 pixels.
            let first = done as u32;
            let first_pixel = region.rows.0 * settings.width + first;
            let frame = FrameRecord { first_pixel, n_rays, ..frame };
            let slowest = self.render_part(&wavefront, frame, progress)?;
            let sums = wavefront.read_pixels(gpu, n_rays)?;
            self.resolve(&sums, first, &mut image);
            if let Some(aovs) = &mut image.aovs {
                let frame = FrameRecord { is_centered: 1, ..frame };
                let hits = self.find_aov_hits(&wavefront, frame)?;
                set_aovs(
                    aovs,
                    &hits,
                    &AovSource { scene: self.scene, view: &view, settings },
                    frame,
                    first,
                );
            }
            stats.rays += wavefront.read_counts(gpu)?;
            wavefront.clear_counts(gpu);
            part = next_part(part, slowest).min(capacity);
            done += u64::from(n_rays);
            progress.advance(n_rays.into());
        }
        stats.frame_secs = start.elapsed().as_secs_f64();
        Ok((image, stats))
    }

    /// Renders all samples of a part; returns the time of the slowest one.
    fn render_part(
        &self,
        wavefront: &Wavefront,
        frame: FrameRecord,
        progress: &dyn Progress,
    ) -> surfel_core::Result<Duration> {
        let mut slowest = Duration::ZERO;
        for sample_idx in self.region.samples.0..self.region.samples.1 {
            let start = Instant::now();
            let is_first = (sample_idx == self.region.samples.0).into();
            wavefront.set_frame(self.gpu, &FrameRecord { sample_idx, is_first, ..frame });
            for passes in self.passes.passes.chunks(PASSES_AT_ONCE) {
                progress.check()?;
                self.run(wavefront, passes, frame.n_rays)?;
            }
            slowest = slowest.max(start.elapsed());
        }
        Ok(slowest)
    }

    /// Returns the hits of the rays through the centres of the pixels of a part.
    fn find_aov_hits(&self, wavefront: &Wavefront, frame: FrameRecord) -> Result<Vec<HitRecord>> {
        wavefront.set_frame(self.gpu, &frame);
        for passes in self.passes.aov_passes.chunks(PASSES_AT_ONCE) {
            self.run(wavefront, passes, frame.n_rays)?;
        }
        wavefront.read_hits(self.gpu, frame.n_rays)
    }

    /// Runs passes and waits for them.
    fn run(&self, wavefront: &Wavefront, passes: &[Pass], n_rays: u32) -> Result<()> {
        self.gpu.catch("the passes", || self.submit(wavefront, passes, n_rays))?;
        self.gpu.wait()
    }

    fn submit(&self, wavefront: &Wavefront, passes: &[Pass], n_rays: u32) {
        let description = wgpu::CommandEncoderDescriptor::default();
        let mut encoder = self.gpu.device.create_command_encoder(&description);
        {
            let description = wgpu::ComputePassDescriptor::default();
            let mut encoder = encoder.begin_compute_pass(&description);
            for pass in passes {
                self.encode(&mut encoder, wavefront, *pass, n_rays);
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn encode(
        &self,
        encoder: &mut wgpu::ComputePass,
        wavefront: &Wavefront,
        pass: Pass,
        n_rays: u32,
    ) {
        encoder.set_pipeline(self.kernels.get(pass.kernel));
        encoder.set_bind_group(0, &wavefront.uniforms, &[pass.record_offset]);
        encoder.set_bind_group(1, &wavefront.rays, &[]);
        if let Some(tree) = pass.tree {
            let geometry = self.uploads.get(&self.scene.geometries[tree.geometry_idx]);
            let Some(tree) = geometry.and_then(|trees| trees[tree.tree_idx].as_ref()) else {
                return;
            };
            encoder.set_bind_group(2, &tree.arrays, &[]);
        }
        encoder.dispatch_workgroups(n_rays.div_ceil(WORKGROUP_SIZE), 1, 1);
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

/// Returns the number of rays of the part after one whose slowest sample took this time.
fn next_part(part: u32, slowest: Duration) -> u32 {
    if MAX_SAMPLE_TIME < slowest {
        (part / 2).max(WORKGROUP_SIZE)
    } else if slowest < MAX_SAMPLE_TIME / 3 {
        (part * 2).min(MAX_PART)
    } else {
        part
    }
}

#[cfg(test)]
mod tests {
    //! Parts grow while they are fast and shrink while they are slow; a lost device is an error.

    use super::*;
    use surfel_core::Error as CoreError;
    use surfel_core::math::DVec3;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::{Background, Camera, Graph, Projection, Scene};

    fn empty() -> FlatScene {
        let camera = Camera {
            position: DVec3::ZERO,
            focal_point: DVec3::Y,
            view_up: DVec3::Z,
            projection: Projection::Panorama,
        };
        let (graph, background) = (Graph::default(), Background::Transparent);
        let scene = Scene { graph, lights: Vec::new(), background, camera };
        FlatScene::new(&scene, &NoProgress).unwrap()
    }

    #[test]
    fn a_device_that_is_lost_is_an_error_for_ever() {
        let renderer = match GpuRenderer::open(None) {
            Ok(renderer) => renderer,
            Err(error) => {
                #[expect(clippy::print_stdout, reason = "a test that does nothing says so")]
                {
                    println!("skipped: {error}");
                }
                return;
            }
        };
        let (scene, settings) = (empty(), Settings { width: 8, height: 4, ..Settings::default() });
        let render = || renderer.render(&scene, &settings, &NoProgress);
        assert!(render().is_ok());
        renderer.gpu.device.destroy();
        for _ in 0..2 {
            let error = render().unwrap_err();
            let CoreError::Renderer(reason) = &error else { panic!("{error}") };
            assert!(reason.starts_with(&renderer.device().name), "{reason}");
        }
    }

    #[test]
    fn parts_follow_the_speed_of_the_device() {
        assert_eq!(next_part(FIRST_PART, Duration::from_millis(1)), 2 * FIRST_PART);
        assert_eq!(next_part(FIRST_PART, Duration::from_millis(100)), FIRST_PART);
        assert_eq!(next_part(FIRST_PART, Duration::from_millis(300)), FIRST_PART / 2);
        assert_eq!(next_part(WORKGROUP_SIZE, Duration::from_secs(9)), WORKGROUP_SIZE);
        assert_eq!(next_part(MAX_PART, Duration::ZERO), MAX_PART);
    }
}
