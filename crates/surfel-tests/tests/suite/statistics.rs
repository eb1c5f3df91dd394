//! Unbiased noise: the mean of many pictures of different seeds against numerical integration.
//!
//! There is a z-test for each pixel, corrected for the number of pixels, and one for the whole picture, like the
//! tests of mitsuba3 (`src/render/tests/test_renders.py`). The expected light is computed here from the formulas
//! alone, in double precision, with the geometry that blocks it.

use crate::materials::gentle_light;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use surfel_core::flat::FlatScene;
use surfel_core::math::{DAffine3, DVec3, Random, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, Environment, Geometry, Graph, Light, Material, Node, Projection,
    PunctualLight, PunctualLightKind, Scene, Sun, Transform,
};
use surfel_core::trace::Simd;
use surfel_tests::scenes::{self, from_above};

const SIDE: u32 = 12;
/// The number of pictures where each has several light samples a pixel.
const N_RUNS: u64 = 64;
/// The number of pictures where each has one sample a pixel.
const N_LONG_RUNS: u64 = 1024;

/// Several light samples a run include the stratification within a run in the test.
const SETTINGS: Settings = Settings {
    width: SIDE,
    height: SIDE,
    samples_per_pixel: 1,
    noise_threshold: 0.0,
    light_samples: 4,
    max_depth: 2,
    seed: 0,
    point_size: 1.0,
    with_aovs: true,
};

/// The greatest number of standard errors that a pixel may be off by.
///
/// One false alarm in a hundred pictures, two-sided and distributed over their pixels (Sidak 1967), gives 3.98 for a
/// normal distribution. The mean of 64 runs has heavier tails: 4.3 (Student's distribution).
const MAX_Z: f64 = 4.3;
/// The greatest number of standard errors that the mean of a picture may be off by.
const MAX_Z_OF_MEAN: f64 = 3.5;

/// Panics unless the mean of all runs equals `expected` of each pixel's position and direction toward the viewer.
/// `inexact` is the relative error that the renderer's own formulas allow.
fn check(
    name: &str,
    scene: &Scene,
    n_runs: u64,
    inexact: f64,
    expected: impl Fn(DVec3, DVec3) -> f64 + Sync,
) {
    let flat = FlatScene::new(scene, &NoProgress).unwrap();
    let renderer = CpuRenderer { simd: Simd::detect() };
    let runs: Vec<_> = (0..n_runs)
        .map(|seed| renderer.render(&flat, &Settings { seed, ..SETTINGS }, &NoProgress).unwrap().0)
        .collect();
    let positions = &runs[0].aovs.as_ref().unwrap().position;
    let view = scene.camera.view(flat.origin, SIDE, SIDE);
    let answers: Vec<f64> = positions
        .par_iter()
        .map(|position| expected(position.as_dvec3(), view.toward_camera(*position).as_dvec3()))
        .collect();
    let brightest = answers.iter().copied().fold(0.0, f64::max);
    // The contribution of one sample of all runs. With a probability of 1 in 20 thousand none of ten expected
    // samples is found, which the variance of the others does not show.
    let one = brightest / (n_runs as f64 * f64::from(SETTINGS.light_samples));
    let n = n_runs as f64;
    let (mut sum, mut sum_expected, mut sum_variance) = (0.0, 0.0, 0.0);
    for (i, answer) in answers.iter().enumerate() {
        let values = || runs.iter().map(|run| f64::from(run.color[i][1]));
        let mean = values().sum::<f64>() / n;
        let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
        let off = ((mean - answer).abs() - inexact * answer).max(0.0);
        let z = off / variance.sqrt();
        assert!(
            z < MAX_Z || off < 10.0 * one,
            "{name}, pixel {i}: {mean} for {answer}, {z} standard errors"
        );
        sum += mean;
        sum_expected += answer;
        sum_variance += variance;
    }
    let off = ((sum - sum_expected).abs() - (inexact + INTEGRATION) * sum_expected).max(0.0);
    let z = off / sum_variance.sqrt();
    let (mean, answer) = (sum / answers.len() as f64, sum_expected / answers.len() as f64);
    assert!(z < MAX_Z_OF_MEAN, "{name}: mean {mean} for {answer}, {z} standard errors");
    // The test is strict enough: the mean of the picture is known to within 2 percent.
    assert!(sum_variance.sqrt() < 0.02 * sum, "{name}: too noisy");
}

/// The relative error of the numerical integrations in this file.
const INTEGRATION: f64 = 5e-4;

/// Returns a scene of a white floor with a sheet that blocks a part of the light.
fn floor_scene(lights: Vec<Light>) -> Scene {
    let graph = scenes::graph(vec![
        (Geometry::Triangles(scenes::floor(0.0, 10.0)), Material::MATTE),
        (Geometry::Triangles(blocker()), Material::MATTE),
    ]);
    let camera = Camera {
        // The camera is at the side, below the sheet.
        position: DVec3::new(0.0, -6.0, 2.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Z,
        projection: Projection::Orthographic { height: 1.0 },
    };
    Scene { graph, lights, background: Background::Transparent, camera }
}

/// Returns the sheet at z = 2 that blocks light.
fn blocker() -> surfel_core::scene::Mesh {
    scenes::quad(2.0 * Vec3::Z, 0.5 * Vec3::X, 0.3 * Vec3::Y)
}

/// Returns whether nothing blocks the path from `position` up to a height.
fn is_open(position: DVec3, direction: DVec3, height: f64) -> bool {
    if height < 2.0 || direction.z <= 0.0 {
        return true;
    }
    let at_sheet = position + (2.0 - position.z) / direction.z * direction;
    0.5 < at_sheet.x.abs() || 0.3 < at_sheet.y.abs()
}

/// Returns the centres of `n` by `n` cells of the unit square.
fn cells(n: u32) -> impl Iterator<Item = (f64, f64)> {
    let middle = move |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    (0..n * n).map(move |i| (middle(i % n), middle(i / n)))
}

/// Returns an orthonormal frame whose third axis is a direction.
fn frame(direction: DVec3) -> [DVec3; 3] {
    let [tangent, bitangent] = direction.any_orthonormal_pair().into();
    [tangent, bitangent, direction]
}

/// Returns the direction with a cosine to a frame's third axis, at an angle around that axis.
fn direction(frame: &[DVec3; 3], height: f64, angle: f64) -> DVec3 {
    let level = (1.0 - height * height).max(0.0).sqrt();
    level * angle.cos() * frame[0] + level * angle.sin() * frame[1] + height * frame[2]
}

#[test]
fn soft_shadows_of_the_sun_have_their_mean() {
    let toward = Vec3::new(0.3, -0.2, 1.0).normalize();
    let sun = Sun { direction: toward, color: Vec3::ONE, angular_diameter_deg: 25.0 };
    let cos_max = (12.5f64).to_radians().cos();
    let frame = frame(toward.as_dvec3());
    check("sun", &floor_scene(vec![Light::Sun(sun)]), N_RUNS, 0.0, |position, _| {
        let light = |(u, v): (f64, f64)| {
            let toward = direction(&frame, 1.0 - u * (1.0 - cos_max), TAU * v);
            if is_open(position, toward, f64::INFINITY) { toward.z.max(0.0) } else { 0.0 }
        };
        cells(200).map(light).sum::<f64>() / 200f64.powi(2)
    });
}

#[test]
fn soft_shadows_of_a_lamp_have_their_mean() {
    let position_of_lamp = DVec3::new(0.4, 0.2, 4.0);
    let radius = 0.5;
    let light = PunctualLight {
        kind: PunctualLightKind::Point,
        color: 16.0 * std::f32::consts::PI * Vec3::ONE,
        range: f32::INFINITY,
        radius: radius as f32,
    };
    let mut scene = floor_scene(Vec::new());
    let transform = Transform::Matrix(DAffine3::from_translation(position_of_lamp));
    scene.graph.nodes.push(Node { light: Some(light), transform, ..Node::new("light") });
    // The light is a ball that emits the same radiance everywhere: 16 over its area as a disc.
    check("punctual light", &scene, N_RUNS, 0.0, |position, _| {
        let to_center = position_of_lamp - position;
        let frame = frame(to_center.normalize());
        let cos_max = (1.0 - radius * radius / to_center.length_squared()).sqrt();
        let light = |(u, v): (f64, f64)| {
            let toward = direction(&frame, 1.0 - u * (1.0 - cos_max), TAU * v);
            let radiance = 16.0 * 2.0 * (1.0 - cos_max) / (radius * radius);
            if is_open(position, toward, to_center.z) { radiance * toward.z } else { 0.0 }
        };
        cells(200).map(light).sum::<f64>() / 200f64.powi(2)
    });
}

/// Returns an environment of random pixels, some of them bright.
fn structured(width: u32, bright_fraction: f32) -> Environment {
    let mut random = Random::new(91, 0);
    let mut pixel = || {
        let is_bright = random.next_f32() < bright_fraction;
        (if is_bright { 4.0 } else { 0.5 } * random.next_f32()) * Vec3::ONE
    };
    let pixels = (0..width * width / 2).map(|_| pixel()).collect();
    Environment::new(width, width / 2, pixels, Vec3::new(0.1, 0.2, 1.0), 25.0).unwrap()
}

#[test]
fn an_environment_over_a_floor_has_its_mean() {
    let environment = structured(16, 0.2);
    let scene = floor_scene(vec![Light::Environment(environment.clone())]);
    check("environment", &scene, N_RUNS, 0.0, |position, _| {
        let light = |(u, v): (f64, f64)| {
            // Directions are uniform in the square of their height: in proportion to the cosine.
            let toward = direction(&[DVec3::X, DVec3::Y, DVec3::Z], u.sqrt(), TAU * v);
            if !is_open(position, toward, f64::INFINITY) {
                return 0.0;
            }
            f64::from(environment.radiance(toward.as_vec3()).y)
        };
        cells(200).map(light).sum::<f64>() / 200f64.powi(2)
    });
}

/// Returns a scene of a plane of rough metal, seen at a slant.
fn metal(roughness: f32, lights: Vec<Light>) -> Scene {
    let rough = Material { ignores_vertex_colors: true, roughness, ..Material::METAL };
    let graph = Graph::from_geometry(Geometry::Triangles(scenes::floor(0.0, 10.0)), rough);
    let camera = Camera {
        position: DVec3::new(1.0, -4.0, 3.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: 40.0 },
    };
    Scene { graph, lights, background: Background::Transparent, camera }
}

/// Returns the radiance times cosine that rough metal reflects to the viewer for a unit of radiance from `toward`,
/// without light that is reflected more than once: GGX (Walter et al. 2007) with Smith's height-correlated masking
/// (Heitz 2014), and alpha the square of the roughness.
fn single_bounce(viewer: DVec3, toward: DVec3, roughness: f64) -> f64 {
    let alpha_squared = roughness.powi(4);
    let half = (viewer + toward).normalize();
    let tan_squared = |d: DVec3| (1.0 - d.z * d.z) / (d.z * d.z);
    let facets =
        alpha_squared / (PI * half.z.powi(4) * (alpha_squared + tan_squared(half)).powi(2));
    let lambda = |d: DVec3| 0.5 * ((1.0 + alpha_squared * tan_squared(d)).sqrt() - 1.0);
    let visible = 1.0 / (1.0 + lambda(viewer) + lambda(toward));
    facets * visible / (4.0 * viewer.z)
}

/// Returns the integral of `single_bounce` over the hemisphere, and that of its product with `radiance`. It
/// iterates over normals of facets rather than over directions, uniformly in their distribution.
fn over_hemisphere(viewer: DVec3, roughness: f64, radiance: impl Fn(DVec3) -> f64) -> (f64, f64) {
    let n = 160;
    let (mut all, mut lit) = (0.0, 0.0);
    for (u, v) in cells(n) {
        // The tangent of the facet's angle is such that all cells have the same probability.
        let tan_squared = roughness.powi(4) * u / (1.0 - u);
        let cos = 1.0 / (1.0 + tan_squared).sqrt();
        let half = direction(&[DVec3::X, DVec3::Y, DVec3::Z], cos, TAU * v);
        let toward = 2.0 * viewer.dot(half) * half - viewer;
        if toward.z <= 0.0 || viewer.dot(half) <= 0.0 {
            continue;
        }
        // The density of these facets times that of directions per facet.
        let alpha_squared = roughness.powi(4);
        let density = alpha_squared
            / (PI * cos.powi(3) * (alpha_squared + tan_squared).powi(2))
            / (4.0 * viewer.dot(half));
        let weight = single_bounce(viewer, toward, roughness) / density;
        all += weight;
        lit += weight * radiance(toward);
    }
    let n_cells = f64::from(n).powi(2);
    (all / n_cells, lit / n_cells)
}

/// The relative error of the interpolated table of light lost between facets.
const TABLE: f64 = 0.01;

#[test]
fn rough_reflections_of_an_environment_have_their_mean() {
    let environment = structured(32, 0.1);
    for roughness in [0.3f32, 0.7] {
        let scene = metal(roughness, vec![Light::Environment(environment.clone())]);
        check(&format!("metal {roughness}"), &scene, N_LONG_RUNS, TABLE, |_, viewer| {
            let radiance = |toward: DVec3| f64::from(environment.radiance(toward.as_vec3()).y);
            let (all, lit) = over_hemisphere(viewer, f64::from(roughness), radiance);
            lit / all
        });
    }
}

#[test]
fn highlights_of_the_sun_on_rough_metal_have_their_mean() {
    let toward = Vec3::new(-0.2, 0.7, 0.6).normalize();
    let sun = Sun { direction: toward, color: Vec3::ONE, angular_diameter_deg: 20.0 };
    let cos_max = 10f64.to_radians().cos();
    let around_sun = frame(toward.as_dvec3());
    for roughness in [0.3f32, 0.7] {
        let scene = metal(roughness, vec![Light::Sun(sun)]);
        check(&format!("metal {roughness}"), &scene, N_RUNS, TABLE, |_, viewer| {
            let (all, _) = over_hemisphere(viewer, f64::from(roughness), |_| 0.0);
            let light = |(u, v): (f64, f64)| {
                let toward = direction(&around_sun, 1.0 - u * (1.0 - cos_max), TAU * v);
                // A sun of strength 1 has an irradiance of π at normal incidence.
                if toward.z <= 0.0 {
                    0.0
                } else {
                    PI * single_bounce(viewer, toward, roughness.into())
                }
            };
            cells(100).map(light).sum::<f64>() / 100f64.powi(2) / all
        });
    }
}

/// The test fails if a light is slightly stronger than expected.
#[test]
fn the_test_detects_an_error_of_two_percent() {
    let sun = |strength: f32| {
        let color = strength * Vec3::ONE;
        Light::Sun(Sun { direction: Vec3::Z, color, angular_diameter_deg: 25.0 })
    };
    let cos_max = (12.5f64).to_radians().cos();
    let is_detected = |strength: f32| {
        let mut scene = floor_scene(vec![sun(strength)]);
        scene.camera = from_above(0.5);
        scene.graph.nodes[1].is_visible = false;
        let check = || check("strong sun", &scene, N_RUNS, 0.0, |_, _| 0.5 * (1.0 + cos_max));
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(check)).is_err()
    };
    assert_eq!([1.0, 1.02].map(is_detected), [false, true]);
}

#[test]
fn light_samples_remove_the_grain_of_rough_reflections() {
    let scene = metal(0.7, vec![Light::Environment(gentle_light())]);
    let flat = FlatScene::new(&scene, &NoProgress).unwrap();
    let renderer = CpuRenderer { simd: Simd::detect() };
    let variance = |light_samples| {
        let values = (0..N_RUNS).map(|seed| {
            let settings = Settings { seed, light_samples, ..SETTINGS };
            f64::from(renderer.render(&flat, &settings, &NoProgress).unwrap().0.color[0][1])
        });
        let values: Vec<f64> = values.collect();
        let mean = values.iter().sum::<f64>() / N_RUNS as f64;
        values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (N_RUNS - 1) as f64
    };
    let (one, many) = (variance(1), variance(16));
    assert!(0.0 < one && 8.0 * many < one, "{one} with 1 sample, {many} with 16");
}
