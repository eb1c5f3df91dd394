//! Adaptive sampling: blocks that are noisy get more samples until they are below the noise threshold, others keep
//! theirs, and neither threads nor regions change a byte.

use crate::materials::gentle_light;
use crate::statistics::structured;
use rayon::ThreadPoolBuilder;
use surfel_core::flat::FlatScene;
use surfel_core::image::{Image, encode_srgb};
use surfel_core::math::{DVec3, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, RenderRegion, RenderStats, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, Geometry, Graph, Light, Material, Projection, Scene, Sun,
};
use surfel_core::trace::Simd;
use surfel_tests::scenes;

const SETTINGS: Settings = Settings {
    width: 70,
    height: 50,
    samples_per_pixel: 4,
    light_samples: 4,
    noise_threshold: 2.0,
    max_depth: 2,
    seed: 0,
    point_size: 1.0,
    with_aovs: false,
};
const N_SEEDS: u64 = 8;

/// Returns a floor that is seen at a slant.
fn floor(material: Material, lights: Vec<Light>) -> FlatScene {
    let graph = Graph::from_geometry(Geometry::Triangles(scenes::floor(0.0, 10.0)), material);
    let camera = Camera {
        position: DVec3::new(1.0, -4.0, 3.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: 40.0 },
    };
    let scene = Scene { graph, lights, background: Background::Transparent, camera };
    FlatScene::new(&scene, &NoProgress).unwrap()
}

/// Returns a floor whose rough reflections of an environment are noisy.
fn rough_metal() -> FlatScene {
    let rough = Material { ignores_vertex_colors: true, roughness: 0.7, ..Material::METAL };
    floor(rough, vec![Light::Environment(gentle_light())])
}

fn render(scene: &FlatScene, settings: Settings) -> (Image, RenderStats) {
    CpuRenderer { simd: Simd::detect() }.render(scene, &settings, &NoProgress).unwrap()
}

/// Returns the standard deviation of a picture's pixels between seeds, in steps of an 8-bit picture.
fn deviation(scene: &FlatScene, settings: Settings) -> f32 {
    let images: Vec<Image> =
        (0..N_SEEDS).map(|seed| render(scene, Settings { seed, ..settings }).0).collect();
    let mut sum = 0.0;
    for pixel in 0..images[0].color.len() {
        let values = images.iter().map(|image| 255.0 * encode_srgb(image.color[pixel][1]));
        let mean = values.clone().sum::<f32>() / N_SEEDS as f32;
        sum += values.map(|value| (value - mean).powi(2)).sum::<f32>() / (N_SEEDS - 1) as f32;
    }
    (sum / images[0].color.len() as f32).sqrt()
}

#[test]
fn noisy_blocks_get_samples_until_they_are_below_the_threshold() {
    let scene = rough_metal();
    let fixed = Settings { noise_threshold: 0.0, ..SETTINGS };
    // Four times the samples, the most that a block gets, halve the noise or better.
    let adaptive = Settings { noise_threshold: 6.0, ..SETTINGS };
    let (before, after) = (deviation(&scene, fixed), deviation(&scene, adaptive));
    assert!(2.0 * adaptive.noise_threshold < before, "{before} without");
    assert!(after < adaptive.noise_threshold, "{before} without, {after} with");
    let n_primary = |settings| render(&scene, settings).1.rays.primary;
    assert!(2 * n_primary(fixed) < n_primary(adaptive));
}

#[test]
fn no_block_gets_more_than_four_times_its_samples() {
    let least = Settings { noise_threshold: f32::MIN_POSITIVE, ..SETTINGS };
    let scene = rough_metal();
    for (samples_per_pixel, most) in [(1, 1), (2, 8), (4, 16), (5, 20), (12, 24), (40, 40)] {
        let settings = Settings { samples_per_pixel, ..least };
        let n_pixels = u64::from(settings.width * settings.height);
        assert_eq!(render(&scene, settings).1.rays.primary, n_pixels * most, "{samples_per_pixel}");
    }
}

/// The means of pictures of many seeds, and the square of the standard error of their mean.
fn mean_and_variance(
    scene: &FlatScene,
    settings: Settings,
    seeds: std::ops::Range<u64>,
) -> (f64, f64) {
    let mean = |seed| {
        let image = render(scene, Settings { seed, ..settings }).0;
        image.color.iter().map(|color| f64::from(color[1])).sum::<f64>() / image.color.len() as f64
    };
    let means: Vec<f64> = seeds.map(mean).collect();
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    (mean, means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
}

#[test]
fn adaptive_samples_have_the_mean_of_fixed_ones() {
    // Few directions are bright: blocks that found none of them must not stay dark.
    let rough = Material { ignores_vertex_colors: true, roughness: 0.7, ..Material::METAL };
    let scene = floor(rough, vec![Light::Environment(structured(32, 0.1))]);
    let small = Settings { width: 24, height: 24, light_samples: 2, ..SETTINGS };
    let adaptive = Settings { samples_per_pixel: 2, noise_threshold: 30.0, ..small };
    let fixed = Settings { samples_per_pixel: 8, noise_threshold: 0.0, ..small };
    let n_pixels = u64::from(small.width * small.height);
    let n_primary = render(&scene, adaptive).1.rays.primary;
    assert!((3 * n_pixels..8 * n_pixels).contains(&n_primary), "{n_primary} camera rays");
    let (mean, variance) = mean_and_variance(&scene, adaptive, 0..128);
    let (expected, expected_variance) = mean_and_variance(&scene, fixed, 1000..1128);
    let error = (variance + expected_variance).sqrt();
    assert!(error < 0.005 * expected, "{error} of {expected} is too noisy");
    assert!((mean - expected).abs() < 3.5 * error, "{mean} for {expected}, error {error}");
}

#[test]
fn pictures_without_grain_keep_their_samples() {
    let sun = Sun { direction: Vec3::Z, color: Vec3::ONE, angular_diameter_deg: 0.0 };
    let scene = floor(Material::MATTE, vec![Light::Sun(sun)]);
    let fixed = Settings { noise_threshold: 0.0, ..SETTINGS };
    let ((adaptive, stats), (expected, expected_stats)) =
        (render(&scene, SETTINGS), render(&scene, fixed));
    assert_eq!(adaptive, expected);
    assert_eq!(stats.rays, expected_stats.rays);
}

#[test]
fn the_number_of_threads_and_the_simd_level_change_no_byte() {
    let scene = rough_metal();
    let expected = render(&scene, SETTINGS).0;
    for n_threads in [1, 2, 3] {
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        for simd in Simd::available() {
            let image = pool
                .install(|| CpuRenderer { simd }.render(&scene, &SETTINGS, &NoProgress).unwrap().0);
            assert!(image == expected, "{n_threads} threads, {}", simd.name());
        }
    }
}

#[test]
fn regions_have_the_samples_that_they_state() {
    let scene = rough_metal();
    let region = RenderRegion { rows: (0, SETTINGS.height), samples: (0, 2) };
    let renderer = CpuRenderer { simd: Simd::detect() };
    let (_, stats) = renderer.render_region(&scene, &SETTINGS, region, &NoProgress).unwrap();
    assert_eq!(stats.rays.primary, u64::from(2 * SETTINGS.width * SETTINGS.height));
}
