//! The GPU renderer: it keeps kernels and scenes on a device from picture to picture.

use crate::device::{DeviceInfo, Gpu};
use crate::error::{Error, Result};
use crate::job::{Job, RendererState};
use crate::kernel_times::{KernelTime, KernelTimes};
use crate::kernels::Kernels;
use crate::part_size::PartSize;
use crate::passes::{Pass, Passes};
use crate::picture_memory::scene_bytes;
use crate::ray_timing::{self, RayTimes, Timing};
use crate::scene_records::SceneRecords;
use crate::scene_words::SceneWords;
use crate::unsupported::unsupported;
use crate::upload::{GpuTree, UploadTime, Uploads};
use crate::wavefront::{Arrays, Capacities};
use std::sync::{Mutex, MutexGuard, PoisonError};
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::locks::lock_unless_cancelled;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, RenderStats, Renderer, Settings, check};

/// A renderer that runs on a GPU. Pictures that are asked for at the same time are rendered one after the other.
#[derive(Debug)]
pub struct GpuRenderer {
    gpu: Gpu,
    /// A panic leaves nothing half done here: kernels and uploads are added when they are complete.
    state: Mutex<State>,
}

/// Kernels, points and arrays, kept from picture to picture.
#[derive(Debug)]
struct State {
    kernels: Kernels,
    uploads: Uploads,
    words: Option<SceneWords>,
    arrays: Option<Arrays>,
    /// The size of the next part, once one was rendered.
    part_size: Option<PartSize>,
    times: KernelTimes,
}

impl GpuRenderer {
    /// Opens the device with this index or name, or the one that is preferred.
    ///
    /// # Errors
    ///
    /// Fails if there is no such device, if it allows less than is needed, or if its driver refuses to open it.
    pub fn open(selector: Option<&str>) -> Result<Self> {
        Self::with_pages(selector, u64::MAX)
    }

    /// Opens a device as [`GpuRenderer::open`] does, whose trees are split in pages of at most `max_page_bytes`, or less if
    /// the device has smaller arrays.
    ///
    /// # Errors
    ///
    /// Fails as [`GpuRenderer::open`] does.
    pub fn with_pages(selector: Option<&str>, max_page_bytes: u64) -> Result<Self> {
        let gpu = Gpu::open(selector, max_page_bytes)?;
        let kernels = Kernels::new(&gpu)?;
        let state = State {
            kernels,
            uploads: Uploads::default(),
            words: None,
            arrays: None,
            part_size: None,
            times: KernelTimes::default(),
        };
        Ok(Self { gpu, state: Mutex::new(state) })
    }

    /// Sets the maximum number of bytes to hold in the device's memory: trees, textures and the arrays of a picture. What
    /// needs more is refused before it is uploaded.
    pub fn with_memory_limit(mut self, memory_limit: Option<u64>) -> Self {
        self.gpu.memory_limit = memory_limit;
        self
    }

    /// Returns the device.
    pub fn device(&self) -> &DeviceInfo {
        &self.gpu.info
    }

    /// Returns the bytes of points and triangles that went to the device since it was opened, and the time that this took.
    /// Waits for a picture that is being rendered, as all methods do that ask for times.
    pub fn upload_time(&self) -> UploadTime {
        self.state().uploads.time
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic leaves a state that can be used.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts to measure how long each kernel works, if the device has a clock, or stops. Pictures take longer
    /// meanwhile: the device waits until its clock was read.
    pub fn measure_kernels(&self, is_wanted: bool) {
        let times = &mut self.state().times;
        times.is_measured = is_wanted;
        if is_wanted {
            times.reset();
        }
    }

    /// Returns the kernels' names and the work of each that was measured.
    pub fn kernel_times(&self) -> Vec<(String, KernelTime)> {
        self.state().times.named()
    }

    /// Searches along given rays several times, as benchmarks do.
    ///
    /// # Errors
    ///
    /// Fails if the device cannot answer the question or hold the geometry, if it fails, or if `progress` is cancelled.
    pub fn time_rays(
        &self,
        timing: Timing,
        progress: &dyn Progress,
    ) -> surfel_core::Result<RayTimes> {
        self.gpu.check()?;
        ray_timing::check(&self.gpu, timing.geometry, timing.query)?;
        let mut state = lock_unless_cancelled(&self.state, progress)?;
        let State { kernels, uploads, arrays, .. } = &mut *state;
        ray_timing::time(&self.gpu, kernels, (uploads, arrays), timing, progress)
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
        let gpu = &self.gpu;
        gpu.check()?;
        let mut state = lock_unless_cancelled(&self.state, progress)?;
        let passes = Passes::new(gpu, scene, settings)?;
        // Pictures have at most 2^28 pixels.
        let n_pixels = region.n_pixels() as u32;
        let (sizes, other_bytes) = state.make_room(gpu, scene, &passes, n_pixels)?;
        state.upload(gpu, scene, &passes, other_bytes, progress)?;
        let State { kernels, uploads, words, arrays, part_size, times } = &mut *state;
        let words = SceneWords::update(words, gpu, scene, progress)?;
        let records = SceneRecords::new(scene, &words.offsets);
        let words = &words.buffer;
        let job =
            Job { gpu, kernels, uploads, scene, settings, region, passes, sizes, records, words };
        let kernels = job.passes.all().map(|pass| pass.kernel).collect();
        let first_part = PartSize::first(gpu.info.kind, part_size.take(), kernels, scene);
        let part_size = part_size.insert(first_part);
        job.render(RendererState { arrays, times, part_size }, progress)
    }
}

impl State {
    /// Frees what a picture leaves no room for. Returns the sizes of its arrays, and the bytes that it takes besides trees.
    fn make_room(
        &mut self,
        gpu: &Gpu,
        scene: &FlatScene,
        passes: &Passes,
        n_pixels: u32,
    ) -> Result<(Capacities, u64)> {
        let Self { uploads, words, arrays, .. } = self;
        SceneWords::free_unless_same(words, gpu, scene)?;
        let scene_bytes = scene_bytes(scene, passes);
        let bytes = |sizes| scene_bytes + Arrays::n_bytes(sizes);
        let makes_room = |sizes| uploads.make_room(gpu, &scene.geometries, bytes(sizes)).is_ok();
        let sizes = Job::sizes(gpu, scene, passes, n_pixels, makes_room);
        let fits_memory =
            |sizes| uploads.check_memory(gpu, &scene.geometries, bytes(sizes)).is_ok();
        let found = Arrays::free_unless_fitting(arrays, gpu, sizes, fits_memory)?;
        Ok((sizes, bytes(found)))
    }

    /// Uploads the trees and compiles the kernels of a picture that are missing.
    fn upload(
        &mut self,
        gpu: &Gpu,
        scene: &FlatScene,
        passes: &Passes,
        other_bytes: u64,
        progress: &dyn Progress,
    ) -> surfel_core::Result<()> {
        let Self { kernels, uploads, .. } = self;
        uploads.update(gpu, &scene.geometries, other_bytes, progress)?;
        let is_paged = |tree| uploads.tree(&scene.geometries, tree).is_some_and(GpuTree::is_paged);
        let of_pass = |pass: &Pass| (pass.kernel, pass.tree.is_some_and(is_paged));
        kernels.compile(gpu, passes.all().map(of_pass), progress)
    }
}

#[cfg(test)]
mod tests {
    //! A lost device is an error, memory is shared well, and kernels are measured.

    use super::*;
    use crate::test_support::{
        CancelledAfter, empty_scene, open_renderer, report_skipped, scene_of_lit_points,
        scene_of_points,
    };
    use std::collections::BTreeSet;
    use surfel_core::Error as CoreError;
    use surfel_core::math::Vec3;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::Texture;
    use surfel_core::surface::SurfaceKind;

    #[test]
    fn a_device_that_is_lost_is_an_error_for_ever() {
        let Some(renderer) = open_renderer() else { return };
        let (scene, settings) =
            (empty_scene(), Settings { width: 8, height: 4, ..Settings::default() });
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
    fn a_picture_that_waits_for_another_can_be_cancelled() {
        let Some(renderer) = open_renderer() else { return };
        let settings = Settings { width: 8, height: 4, ..Settings::default() };
        let other = renderer.state();
        let result = renderer.render(&empty_scene(), &settings, &CancelledAfter::new(2));
        assert_eq!(result.map(|_| ()), Err(CoreError::Cancelled));
        drop(other);
        assert!(renderer.render(&empty_scene(), &settings, &NoProgress).is_ok());
    }

    #[test]
    fn a_picture_can_be_cancelled_before_each_kernel_and_each_chunk_of_its_upload() {
        let Some(renderer) = open_renderer() else { return };
        let settings = Settings { width: 8, height: 4, ..Settings::default() };
        let scene = textured_scene();
        let render = |n_max| {
            let progress = CancelledAfter::new(n_max);
            let result = renderer.render(&scene, &settings, &progress);
            result.map(|_| progress.n_asked())
        };
        for n in 0..3 {
            assert_eq!(render(n), Err(CoreError::Cancelled));
            assert_eq!(renderer.upload_time().n_bytes, 0);
        }
        let passes = Passes::new(&renderer.gpu, &scene, &settings).unwrap();
        let kernels: BTreeSet<_> = passes.all().map(|pass| pass.kernel).collect();
        let trees: BTreeSet<_> = passes.all().filter_map(|pass| pass.tree).collect();
        // Each tree has a chunk of nodes and one of blocks. The texture and its chunk come last, the turn first.
        let n = (1 + 2 * trees.len() + kernels.len() + 2) as u32;
        assert_eq!(render(n - 1), Err(CoreError::Cancelled));
        // All but the texture has stayed.
        assert_eq!(render(n), Ok(3));
        assert_eq!(render(n), Ok(1));
    }

    #[test]
    fn arrays_of_larger_pictures_are_freed_where_memory_is_short() {
        let Some(renderer) = open_renderer() else { return };
        let small = Settings { width: 8, height: 4, ..Settings::default() };
        let large = Settings { width: 64, height: 64, ..small };
        let render = |renderer: &GpuRenderer, settings: &Settings| {
            renderer.render(&empty_scene(), settings, &NoProgress).map(|_| {
                let state = renderer.state();
                state.arrays.as_ref().map(|arrays| arrays.sizes().n_pixels)
            })
        };
        assert_eq!(render(&renderer, &large), Ok(Some(64 * 64)));
        assert_eq!(render(&renderer, &small), Ok(Some(64 * 64)));
        let limited = renderer.with_memory_limit(Some(1 << 20));
        assert_eq!(render(&limited, &small), Ok(Some(8 * 4)));
        assert!(render(&limited, &large).is_err());
    }

    #[test]
    fn trees_of_other_pictures_make_room_before_queues_become_shorter() {
        let Some(renderer) = open_renderer() else { return };
        let scenes = [scene_of_points(SurfaceKind::Disc), scene_of_points(SurfaceKind::Disc)];
        let settings = Settings { width: 256, height: 128, ..Settings::default() };
        assert!(renderer.render(&scenes[0], &settings, &NoProgress).is_ok());
        let tree_bytes = renderer.upload_time().n_bytes;
        let sizes = renderer.state().arrays.as_ref().unwrap().sizes();
        let passes = Passes::new(&renderer.gpu, &scenes[0], &settings).unwrap();
        let picture_bytes = Arrays::n_bytes(sizes) + scene_bytes(&scenes[0], &passes);
        // The limit fits a tree and its copy on the way, but no other tree.
        let limit = picture_bytes + 2 * tree_bytes + tree_bytes / 2;
        drop(renderer);
        let renderer = open_renderer().unwrap().with_memory_limit(Some(limit));
        for scene in [&scenes[0], &scenes[1], &scenes[0]] {
            assert!(renderer.render(scene, &settings, &NoProgress).is_ok());
            let state = renderer.state();
            assert_eq!(state.arrays.as_ref().unwrap().sizes(), sizes);
        }
        assert_eq!(renderer.upload_time().n_bytes, 3 * tree_bytes);
    }

    /// Returns a scene of points with a texture of 1 MiB, which no material uses.
    fn textured_scene() -> FlatScene {
        let texels = vec![[200, 100, 50, 255]; 1 << 18].into();
        let mut scene = scene_of_points(SurfaceKind::Disc);
        scene.textures.push(Texture { width: 1 << 9, height: 1 << 9, texels });
        scene
    }

    #[test]
    fn too_many_texels_are_refused_before_trees_are_uploaded() {
        let Some(mut renderer) = open_renderer() else { return };
        renderer.gpu.info.max_array_bytes = 1 << 19;
        let settings = Settings { width: 8, height: 4, ..Settings::default() };
        let error = renderer.render(&textured_scene(), &settings, &NoProgress).unwrap_err();
        let expected = " allows 524288 bytes in one array, 1048576 are needed";
        assert!(error.to_string().ends_with(expected), "{error}");
        assert_eq!(renderer.upload_time().n_bytes, 0);
    }

    #[test]
    fn texels_of_the_scene_before_are_freed_before_the_next_one_is_uploaded() {
        let Some(renderer) = open_renderer() else { return };
        let settings = Settings { width: 8, height: 4, ..Settings::default() };
        assert!(renderer.render(&textured_scene(), &settings, &NoProgress).is_ok());
        assert!(renderer.state().words.is_some());
        // The trees of the next scene are refused.
        let limited = renderer.with_memory_limit(Some(1 << 12));
        let next = scene_of_points(SurfaceKind::Disc);
        assert!(limited.render(&next, &settings, &NoProgress).is_err());
        assert!(limited.state().words.is_none());
    }

    #[test]
    fn sums_of_bright_pixels_do_not_wrap_around() {
        let Some(renderer) = open_renderer() else { return };
        // Each sample adds 2^24, so that 256 of them would reach 2^32. Sums end at 2^31.
        let scene = scene_of_lit_points(SurfaceKind::Sphere, Vec3::splat(1e8));
        let (width, height, samples_per_pixel) = (16, 8, 256);
        let settings = Settings { width, height, samples_per_pixel, ..Settings::default() };
        let (image, _) = renderer.render(&scene, &settings, &NoProgress).unwrap();
        assert!(image.coverage.iter().any(|coverage| 0.5 < *coverage));
        for (coverage, color) in image.coverage.iter().zip(&image.color) {
            let expected = coverage.min(0.5) * (1 << 24) as f32;
            assert_eq!(color[..3], [expected; 3], "{coverage}");
        }
    }

    #[test]
    fn kernels_are_measured_once_it_is_wanted() {
        let Some(renderer) = open_renderer() else { return };
        if !renderer.gpu.has_timestamps() {
            return report_skipped("the device has no clock");
        }
        let settings = Settings { width: 8, height: 4, ..Settings::default() };
        let n_runs = || {
            renderer.render(&empty_scene(), &settings, &NoProgress).unwrap();
            let times = renderer.kernel_times();
            times.iter().find(|(name, _)| name == "generate").map_or(0, |(_, time)| time.n_runs)
        };
        assert_eq!(n_runs(), 0);
        renderer.measure_kernels(true);
        let n = n_runs();
        assert!(0 < n);
        assert_eq!(n_runs(), 2 * n);
        renderer.measure_kernels(true);
        assert_eq!(n_runs(), n);
    }

    #[test]
    fn a_device_lost_amid_a_picture_is_an_error() {
        /// Loses the device when the work is about to begin.
        struct Loss(wgpu::Device);
        impl Progress for Loss {
            fn begin(&self, _: &str, _: u64) {
                self.0.destroy();
            }
        }
        let Some(renderer) = open_renderer() else { return };
        let settings = Settings { width: 8, height: 4, ..Settings::default() };
        let loss = Loss(renderer.gpu.device.clone());
        let error = renderer.render(&empty_scene(), &settings, &loss).unwrap_err();
        let CoreError::Renderer(reason) = &error else { panic!("{error}") };
        assert!(reason.starts_with(&renderer.device().name), "{reason}");
    }
}
