//! The renderer of a description: the CPU, or a GPU where one is demanded or is likely to be faster.

use crate::description::{Backend, RunSettings};
use crate::error::Result;
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::progress::Progress;
use surfel_core::render::{CpuRenderer, RenderRegion, RenderStats, Renderer, Settings};
use surfel_core::trace::Simd;

#[cfg(not(feature = "gpu"))]
use crate::no_gpu::{DeviceKind, GpuRenderer, unsupported};
#[cfg(not(feature = "gpu"))]
use surfel_core::Result as GpuResult;
#[cfg(feature = "gpu")]
use surfel_gpu::{DeviceKind, GpuRenderer, Result as GpuResult, unsupported};

/// Number of rays of a picture from which on a GPU is taken: with fewer, 16 cores are done before an H100 has
/// started and compiled its kernels (docs/gpu.md).
const MIN_RAYS: u64 = 1 << 24;
/// Number of points for each ray above which the upload of the points would take longer than their picture.
const MAX_POINTS_PER_RAY: u64 = 20;

/// Renders on the CPU or on a GPU, as the settings of a run say.
#[derive(Debug)]
pub struct SceneRenderer {
    cpu: CpuRenderer,
    backend: Backend,
    device: Option<String>,
    memory_limit: Option<u64>,
    /// The GPU, once it was opened; none if there is none that is worth it.
    gpu: OnceLock<Option<GpuRenderer>>,
    /// True if the last picture was rendered on the GPU.
    was_on_gpu: AtomicBool,
    has_reported_device: AtomicBool,
}

impl SceneRenderer {
    /// Makes the renderer, and opens the device if a GPU is demanded: by the backend, or by naming it without one.
    ///
    /// # Errors
    ///
    /// Fails if a GPU is demanded and there is no such device, or if it cannot be opened.
    pub fn new(settings: &RunSettings) -> Result<Self> {
        let renderer = Self {
            cpu: CpuRenderer { simd: Simd::detect() },
            backend: settings.chosen_backend(),
            device: settings.device.clone(),
            memory_limit: settings.memory_limit,
            gpu: OnceLock::new(),
            was_on_gpu: AtomicBool::new(false),
            has_reported_device: AtomicBool::new(false),
        };
        if renderer.backend == Backend::Gpu {
            let opened = renderer.open_gpu().map_err(surfel_core::Error::from)?;
            _ = renderer.gpu.set(Some(opened));
        }
        Ok(renderer)
    }

    /// Returns the SIMD level of the kernels that run on the CPU.
    pub fn simd(&self) -> Simd {
        self.cpu.simd
    }

    /// Returns the name of the GPU that rendered the last picture; none if the CPU did.
    pub fn gpu_name(&self) -> Option<&str> {
        let gpu = self.gpu.get()?.as_ref()?;
        self.was_on_gpu.load(Ordering::Relaxed).then(|| gpu.device().name.as_str())
    }

    fn open_gpu(&self) -> GpuResult<GpuRenderer> {
        let opened = GpuRenderer::open(self.device.as_deref());
        opened.map(|gpu| gpu.with_memory_limit(self.memory_limit))
    }

    /// Returns a GPU that may be taken unasked: one that is not emulated, or that is named.
    fn automatic_gpu(&self) -> Option<&GpuRenderer> {
        let open = || {
            if self.device.is_none() && !may_have_gpu() {
                return None;
            }
            let opened = self.open_gpu().ok()?;
            let is_emulated = opened.device().kind == DeviceKind::Software;
            (self.device.is_some() || !is_emulated).then_some(opened)
        };
        self.gpu.get_or_init(open).as_ref()
    }

    /// Renders on the GPU if that is likely to be faster and possible; otherwise returns none, and says why if there is a
    /// GPU.
    fn try_gpu(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> Option<surfel_core::Result<(Image, RenderStats)>> {
        if !is_worth_upload(scene, settings, region) {
            return None;
        }
        let gpu = self.automatic_gpu()?;
        let missing = unsupported(scene);
        if !missing.is_empty() {
            let reason = format!("on the CPU: the GPU does not render {} yet", missing.join(", "));
            self.report(progress, &reason);
            return None;
        }
        match gpu.render_region(scene, settings, region, progress) {
            Err(surfel_core::Error::Renderer(reason)) => {
                progress.note(&format!("on the CPU: {reason}"));
                None
            }
            result => {
                self.report(progress, &format!("on the GPU: {}", gpu.device().name));
                Some(result)
            }
        }
    }

    /// Reports the device once.
    fn report(&self, progress: &dyn Progress, line: &str) {
        if !self.has_reported_device.swap(true, Ordering::Relaxed) {
            progress.choice(line, &["backend", "device"]);
        }
    }
}

impl Renderer for SceneRenderer {
    fn render_region(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> surfel_core::Result<(Image, RenderStats)> {
        let on_gpu = match (self.backend, self.gpu.get()) {
            (Backend::Cpu, _) => None,
            (Backend::Gpu, Some(Some(gpu))) => {
                Some(gpu.render_region(scene, settings, region, progress))
            }
            _ => self.try_gpu(scene, settings, region, progress),
        };
        self.was_on_gpu.store(on_gpu.is_some(), Ordering::Relaxed);
        on_gpu.unwrap_or_else(|| self.cpu.render_region(scene, settings, region, progress))
    }
}

/// Returns false if there is certainly no GPU. Asking the drivers takes a tenth of a second, and on servers without
/// desktops those of Mesa print errors that are none.
fn may_have_gpu() -> bool {
    let devices = ["/dev/dri", "/dev/nvidiactl", "/dev/dxg", "/dev/mali0"];
    !cfg!(target_os = "linux") || devices.iter().any(|device| Path::new(device).exists())
}

/// Returns true if a picture takes so many rays, and the scene has so few points for them, that a GPU is likely to be
/// faster.
fn is_worth_upload(scene: &FlatScene, settings: &Settings, region: RenderRegion) -> bool {
    let n_points = scene.clouds().map(|cloud| cloud.points.ids.len() as u64).sum();
    let n_light_rays = scene.lights.len() as u64 * u64::from(settings.light_samples);
    let n_samples = u64::from(region.n_samples());
    let n_light_rays = n_light_rays * n_samples / u64::from(settings.samples_per_pixel.max(1));
    is_worth(n_points, region.n_pixels() * (n_samples + n_light_rays))
}

fn is_worth(n_points: u64, n_rays: u64) -> bool {
    MIN_RAYS <= n_rays && n_points <= MAX_POINTS_PER_RAY.saturating_mul(n_rays)
}

#[cfg(test)]
mod tests {
    //! A GPU is taken for large pictures that fit it, and not for huge clouds in small ones.

    use super::*;
    #[cfg(feature = "gpu")]
    use std::sync::Mutex;

    #[test]
    fn large_pictures_are_worth_an_upload() {
        let full_hd = 1920 * 1080 * 36;
        assert!(is_worth(1_000_000, full_hd) && is_worth(100_000_000, full_hd));
        assert!(!is_worth(1_000_000, 200 * 150 * 17));
        assert!(!is_worth(1_000_000_000, MIN_RAYS));
    }

    /// Keeps the notes about a picture.
    #[cfg(feature = "gpu")]
    #[derive(Default)]
    struct Notes(Mutex<Vec<String>>);

    #[cfg(feature = "gpu")]
    impl Progress for Notes {
        fn note(&self, text: &str) {
            self.0.lock().unwrap().push(text.to_owned());
        }
    }

    /// Returns an empty scene with a light: few of its rays are traced, and many may be.
    #[cfg(feature = "gpu")]
    fn empty() -> FlatScene {
        use surfel_core::math::DVec3;
        use surfel_core::scene::{Background, Camera, Graph, Light, Projection, Scene};
        let camera = Camera {
            position: DVec3::ZERO,
            focal_point: DVec3::Y,
            view_up: DVec3::Z,
            projection: Projection::Panorama,
        };
        let lights = vec![Light::Headlight(1.0)];
        let (graph, background) = (Graph::default(), Background::Transparent);
        let scene = Scene { graph, lights, background, camera };
        FlatScene::new(&scene, &surfel_core::progress::NoProgress).unwrap()
    }

    #[cfg(feature = "gpu")]
    #[test]
    fn what_exceeds_the_memory_limit_is_rendered_on_the_cpu_with_a_note() {
        let run = RunSettings {
            backend: Some(Backend::Auto),
            device: Some("0".into()),
            memory_limit: Some(1 << 10),
            ..RunSettings::default()
        };
        let renderer = SceneRenderer::new(&run).unwrap();
        if surfel_gpu::devices().is_empty() {
            #[expect(clippy::print_stdout, reason = "a test that does nothing says so")]
            {
                println!("skipped: there is no GPU");
            }
            return;
        }
        assert!(renderer.automatic_gpu().is_some(), "{:?}", renderer.open_gpu().err());
        let settings =
            Settings { width: 64, height: 64, light_samples: 1 << 13, ..Settings::default() };
        let notes = Notes::default();
        let (image, _) = renderer.render(&empty(), &settings, &notes).unwrap();
        assert_eq!((image.coverage[0], renderer.gpu_name()), (0.0, None));
        let notes = notes.0.into_inner().unwrap();
        let [note] = &notes[..] else { panic!("{notes:?}") };
        assert!(note.starts_with("on the CPU: "), "{note}");
        assert!(
            note.ends_with("MiB of memory are needed, and the limit is 1.0 KiB [memory_limit]"),
            "{note}"
        );
    }
}
