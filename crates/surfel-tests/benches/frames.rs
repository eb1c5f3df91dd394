//! Pictures of a cloud under a sun and a sky: the time of a frame, of one after a change, and of each kernel of a GPU.
//!
//! `cargo bench -p surfel-tests --bench frames -- CLOUD.bin CLOUD.cam [--backend cpu|gpu] [--surfaces splat,smooth]
//! [--resolution 1920x1080] [--samples 1] [--light-samples 1] [--runs 7] [--kernels]`. The first file has records of
//! seven f32 (position, radius, normal), the second one a line `ex,ey,ez,tx,ty,tz,fovy_deg,lx,ly,lz`: eye, target,
//! vertical angle of view, and a point toward which the sun stands from the target. `SURFEL_DEVICE` chooses the GPU.
#![expect(clippy::print_stdout, reason = "a benchmark prints its figures")]

use std::path::Path;
use std::time::Instant;
use surfel_core::flat::FlatScene;
use surfel_core::math::{DQuat, DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::render::{RenderStats, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, Geometry, Graph, Light, Material, Projection, Scene, Sky, Sun,
};
use surfel_core::surface::SurfaceKind;
use surfel_formats::LoadOptions;
use surfel_gpu::GpuRenderer;
use surfel_tests::backends;
use surfel_tests::bench_args::is_timed;
use surfel_tests::clouds::waves;
use surfel_tests::scenes;

/// Distance of the farthest surfaces that hide the sky, as a fraction of the diagonal of the cloud's bounding box.
const AO_FRACTION: f32 = 0.1;

/// The options of the command line.
struct Options {
    on_gpu: bool,
    surfaces: Vec<SurfaceKind>,
    settings: Settings,
    n_runs: usize,
    with_kernels: bool,
}

/// A picture.
struct Frame {
    /// Seconds by the wall.
    secs: f64,
    stats: RenderStats,
}

/// A camera and the place of the sun.
struct View {
    camera: Camera,
    sun: DVec3,
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let options = options(&args);
    if !is_timed() {
        let settings = Settings { width: 32, height: 18, ..options.settings };
        let options =
            Options { surfaces: vec![SurfaceKind::Splat], settings, n_runs: 1, ..options };
        let view = view("500,-700,420,500,250,20,40,0,0,900");
        return measure_surfaces(&waves(1000, 0.0), &view, &options);
    }
    let has_value = |arg: &String| arg.starts_with("--") && arg != "--kernels" && arg != "--bench";
    let is_value = |i: usize| i.checked_sub(1).is_some_and(|before| has_value(&args[before]));
    let files = args.iter().enumerate().filter(|(i, arg)| !arg.starts_with("--") && !is_value(*i));
    let files: Vec<&String> = files.map(|(_, arg)| arg).collect();
    let [cloud, camera] = files[..] else {
        println!("frames skipped: no CLOUD.bin and CLOUD.cam are given");
        return;
    };
    let loaded = surfel_formats::load(Path::new(cloud), &LoadOptions::default(), &NoProgress);
    let line = std::fs::read_to_string(camera).unwrap();
    measure_surfaces(&loaded.unwrap().cloud, &view(line.trim()), &options);
}

fn options(args: &[String]) -> Options {
    let value = |name: &str, default: &str| {
        let found = args.iter().position(|arg| arg == name).and_then(|i| args.get(i + 1));
        found.map_or(default, String::as_str).to_owned()
    };
    let resolution = value("--resolution", "1920x1080");
    let (width, height) = resolution.split_once('x').unwrap();
    let kind = |name: &str| name.parse().unwrap_or_else(|error| panic!("{error}"));
    Options {
        on_gpu: value("--backend", "gpu") == "gpu",
        surfaces: value("--surfaces", "splat,smooth").split(',').map(kind).collect(),
        settings: Settings {
            width: width.parse().unwrap(),
            height: height.parse().unwrap(),
            samples_per_pixel: value("--samples", "1").parse().unwrap(),
            light_samples: value("--light-samples", "1").parse().unwrap(),
            ..Settings::default()
        },
        n_runs: value("--runs", "7").parse().unwrap(),
        with_kernels: args.iter().any(|arg| arg == "--kernels"),
    }
}

fn view(line: &str) -> View {
    let numbers: Vec<f64> = line.split(',').map(|number| number.trim().parse().unwrap()).collect();
    let &[ex, ey, ez, tx, ty, tz, view_angle_deg, lx, ly, lz] = &numbers[..] else {
        panic!("a camera has ten numbers");
    };
    let [position, focal_point, sun] = [[ex, ey, ez], [tx, ty, tz], [lx, ly, lz]].map(DVec3::from);
    let projection = Projection::Perspective { view_angle_deg };
    View { camera: Camera { position, focal_point, view_up: DVec3::Z, projection }, sun }
}

fn measure_surfaces(cloud: &PointCloud, view: &View, options: &Options) {
    let Settings { width, height, samples_per_pixel, light_samples, .. } = options.settings;
    let n = cloud.positions.len();
    println!("{n} points, {width}x{height}, samples {samples_per_pixel}, light {light_samples}");
    let cpu = backends::cpu();
    let gpu = if options.on_gpu { backends::gpu() } else { None };
    if let Some(gpu) = gpu {
        println!("on {}", gpu.device().name);
    } else if options.on_gpu {
        return;
    }
    for kind in &options.surfaces {
        println!("{}", kind.name());
        let flat = scene(cloud.clone(), *kind, view);
        match gpu {
            Some(gpu) => {
                print_upload(gpu, &flat, options);
                measure(gpu, flat.clone(), view, options);
                if options.with_kernels {
                    print_kernels(gpu, &flat, options);
                }
            }
            None => measure(&cpu, flat, view, options),
        }
    }
}

fn scene(cloud: PointCloud, kind: SurfaceKind, view: &View) -> FlatScene {
    let mut points = scenes::grey(cloud);
    points.surface = kind;
    let scene = Scene {
        graph: Graph::from_geometry(Geometry::Points(points), Material::MATTE),
        lights: Vec::new(),
        background: Background::Gradient { top: Vec3::splat(0.6), bottom: Vec3::splat(0.9) },
        camera: view.camera,
    };
    let mut flat = FlatScene::new(&scene, &NoProgress).unwrap();
    let bounds = flat.instances[0].bounds;
    let ao_distance = AO_FRACTION * (bounds.max - bounds.min).length();
    let (zenith, ground) = (Vec3::splat(0.4), Vec3::splat(0.4));
    let sky = Sky { up: Vec3::Z, zenith, ground, ao_distance };
    flat.lights = vec![sun(view, 0.0), Light::Sky(sky)];
    flat
}

/// Returns the sun, turned around the vertical.
fn sun(view: &View, turn_rad: f64) -> Light {
    let direction = DQuat::from_rotation_z(turn_rad) * (view.sun - view.camera.focal_point);
    let direction = direction.as_vec3().normalize();
    Light::Sun(Sun { direction, color: Vec3::ONE, angular_diameter_deg: 0.0 })
}

/// Prints the time of frames: of equal ones, and of those after a change of the light and of the camera.
fn measure(renderer: &dyn Renderer, mut flat: FlatScene, view: &View, options: &Options) {
    let render = |flat: &FlatScene| -> Frame {
        let start = Instant::now();
        // The time to free the image does not count.
        let (_image, stats) = renderer.render(flat, &options.settings, &NoProgress).unwrap();
        Frame { secs: start.elapsed().as_secs_f64(), stats }
    };
    render(&flat);
    let runs: Vec<Frame> = (0..options.n_runs).map(|_| render(&flat)).collect();
    let turns = (1..=options.n_runs).map(|i| 0.02 * i as f64);
    let lit: Vec<Frame> = turns
        .clone()
        .map(|turn| {
            flat.lights[0] = sun(view, turn);
            render(&flat)
        })
        .collect();
    let seen: Vec<Frame> = turns
        .map(|turn| {
            let Camera { position, focal_point, .. } = view.camera;
            let turned = DQuat::from_rotation_z(turn) * (position - focal_point);
            flat.camera.position = focal_point + turned;
            render(&flat)
        })
        .collect();
    let whole = |frame: &Frame| 1e3 * frame.secs;
    let median = print("frame", &runs, whole);
    let work = |frame: &Frame| 1e3 * (frame.secs - frame.stats.transfer_secs);
    print("without transfer", &runs, work);
    print("after a change of light", &lit, whole);
    print("after a change of camera", &seen, whole);
    let mrays_per_s = runs[0].stats.rays.total() as f64 / median / 1e3;
    println!("  {:.1} frames/s, {mrays_per_s:.1} million rays/s", 1e3 / median);
}

/// Prints the median and the least of the times of pictures in milliseconds; returns the median.
fn print(name: &str, runs: &[Frame], millis: impl Fn(&Frame) -> f64) -> f64 {
    let mut times: Vec<f64> = runs.iter().map(millis).collect();
    times.sort_by(f64::total_cmp);
    let [median, least] = [times[times.len() / 2], times[0]];
    println!("  {name:24} {median:9.2} ms (median) {least:9.2} ms (least)");
    median
}

/// Renders the first picture, and prints how its points went to the GPU.
fn print_upload(gpu: &GpuRenderer, flat: &FlatScene, options: &Options) {
    let before = gpu.upload_time();
    let start = Instant::now();
    gpu.render(flat, &options.settings, &NoProgress).unwrap();
    let first_secs = start.elapsed().as_secs_f64();
    let after = gpu.upload_time();
    let (secs, gigabytes) =
        (after.secs - before.secs, (after.n_bytes - before.n_bytes) as f64 / 1e9);
    println!("  upload {gigabytes:.3} GB in {secs:.3} s, {:.2} GB/s", gigabytes / secs.max(1e-9));
    println!("  first frame {:.1} ms", 1e3 * first_secs);
}

/// Prints the work of each kernel in one picture.
fn print_kernels(gpu: &GpuRenderer, flat: &FlatScene, options: &Options) {
    gpu.measure_kernels(true);
    let n_runs = options.n_runs as f64;
    for _ in 0..options.n_runs {
        gpu.render(flat, &options.settings, &NoProgress).unwrap();
    }
    gpu.measure_kernels(false);
    println!("  {:24} {:>9} {:>9}", "kernel", "passes", "ms");
    let mut sum = 0.0;
    for (name, time) in gpu.kernel_times() {
        let millis = 1e3 * time.secs / n_runs;
        sum += millis;
        println!("  {name:24} {:9.1} {millis:9.3}", time.n_runs as f64 / n_runs);
    }
    println!("  {:24} {:9} {sum:9.3}", "all", "");
}
