//! The time of pictures on a number of threads.

use super::clouds::Subject;
use rayon::ThreadPoolBuilder;
use surfel_core::flat::FlatScene;
use surfel_core::math::Vec3;
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, RenderStats, Renderer, Settings};
use surfel_core::scene::{Background, Geometry, Graph, Light, Material, Scene, Sun};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_tests::backends;

/// Width and height of the pictures.
pub const RESOLUTION: u32 = 1024;
/// Number of pictures, of which the fastest counts.
const N_RUNS: usize = 3;

/// Milliseconds of a picture.
#[derive(Clone, Copy)]
pub struct Times {
    /// The search for the nearest surface along the rays of all pixels.
    pub trace: f64,
    /// All of the picture from built trees.
    pub render: f64,
}

/// Returns the scene of a cloud under a sun with hard shadows.
pub fn scene(subject: &Subject, kind: SurfaceKind) -> Scene {
    let direction = Vec3::new(0.45, -0.6, 0.66).normalize();
    let sun = Sun { direction, color: Vec3::ONE, angular_diameter_deg: 0.0 };
    Scene {
        graph: Graph::from_geometry(Geometry::Points(subject.geometry(kind)), Material::MATTE),
        lights: vec![Light::Sun(sun), Light::Headlight(0.3)],
        background: Background::Transparent,
        camera: subject.camera,
    }
}

/// Returns settings of one ray a pixel.
pub fn settings(resolution: u32) -> Settings {
    Settings {
        width: resolution,
        height: resolution,
        samples_per_pixel: 1,
        light_samples: 1,
        ..Settings::default()
    }
}

/// Returns the times of a scene on one thread, on two, and on a GPU if there is one that draws it.
pub fn times(scene: &FlatScene) -> [Option<Times>; 3] {
    let on_threads = |n_threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let renderer = CpuRenderer { simd: Simd::detect() };
        pool.install(|| fastest(&renderer, scene))
    };
    let on_gpu = backends::gpu().and_then(|gpu| {
        // The first pictures compile kernels, and learn how many pixels the device renders at once.
        fastest(gpu, scene)?;
        gpu.measure_kernels(true);
        let measured = fastest(gpu, scene);
        // Pictures are slower while the kernels are measured.
        gpu.measure_kernels(false);
        Some(Times { trace: measured?.trace, ..fastest(gpu, scene)? })
    });
    [on_threads(1), on_threads(2), on_gpu]
}

/// Returns the least times of several pictures, or none if the renderer cannot draw the scene.
fn fastest(renderer: &dyn Renderer, scene: &FlatScene) -> Option<Times> {
    let run = || renderer.render(scene, &settings(RESOLUTION), &NoProgress).ok();
    let runs: Option<Vec<RenderStats>> = (0..N_RUNS).map(|_| Some(run()?.1)).collect();
    let runs = runs?;
    let least = |secs: fn(&RenderStats) -> f64| {
        1000.0 * runs.iter().map(secs).fold(f64::INFINITY, f64::min)
    };
    Some(Times { trace: least(|stats| stats.trace_secs), render: least(|stats| stats.frame_secs) })
}
