//! From files to a picture: load, choose, prepare, build, expose, render, save.

use crate::args::{Exposure, Global, SceneArgs, Usage};
use crate::assemble::{Assembly, name_files};
use crate::light::{self, Lit};
use crate::memory::Plan;
use crate::render::Args;
use crate::report::{Muted, Report};
use crate::scene_file::{Line, is_scene_file};
use crate::stats::{Run, Seconds};
use crate::{dry_run, exposure, stats};
use anyhow::bail;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfel::flat::FlatScene;
use surfel::math::{DVec3, Vec3};
use surfel::points::SURFACE_VARIATION;
use surfel::progress::Progress;
use surfel::render::{CpuRenderer, Renderer, Settings};
use surfel::scene::color::ColorSource;
use surfel::scene::{Background, Camera, Light, Scene, usual_bounds};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_formats::{Alpha, BitDepth, ImageOptions};

/// What was chosen from the data.
pub struct Choices {
    pub up: Vec3,
    pub camera: Camera,
    /// Whether that is a camera of the files, which may move.
    pub is_of_file: bool,
    pub lights: Vec<Light>,
    pub sun_azimuth_deg: f64,
}

pub fn make(
    args: &Args,
    output: &Path,
    line: &Line,
    global: &Global,
    report: &Report,
) -> anyhow::Result<()> {
    let start = Instant::now();
    check_output(output)?;
    let mut seconds = Seconds::default();
    let mut assembly = timed(&mut seconds.load, || load(&args.scene, line, global, report))?;
    assembly.graph.pose(args.time);
    let choices = choose(&assembly, &args.scene, report)?;
    let camera = camera_at(args.time, &assembly, &choices);
    let scene = timed(&mut seconds.prepare, || describe(assembly, choices, &args.scene, report))?;
    let scene = Scene { camera, ..scene };
    let counts = scene.graph.counts();
    let mut flat = timed(&mut seconds.build, || Ok(FlatScene::new(&scene, report)?))?;
    drop(scene);

    let renderer = CpuRenderer { simd: Simd::detect() };
    let with_layers = output.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    let settings = Settings { with_layers, ..settings(&args.scene) };
    let stops = exposure(&renderer, &flat, &settings, &args.scene, report)?;
    light::expose(&mut flat, stops);
    tell_threads(&renderer, report);
    let (image, rendered) = renderer.render(&flat, &settings, report)?;
    report.end_stage();
    report.check()?;
    let options = image_options(flat.origin, &args.scene);
    surfel_formats::save_image(output, &image, &options)?;
    if let Some(path) = &args.stats {
        seconds.total = start.elapsed().as_secs_f64();
        let resolution = args.scene.picture.resolution;
        let run = Run { flat: &flat, counts, seconds, rendered, resolution, simd: renderer.simd };
        stats::write(path, &run.json())?;
    }
    Ok(())
}

/// Prints what would be made, and makes nothing.
pub fn tell(args: &Args, line: &Line, global: &Global, report: &Report) -> anyhow::Result<()> {
    args.output.as_deref().map_or(Ok(()), check_output)?;
    let mut assembly = load(&args.scene, line, global, report)?;
    assembly.graph.pose(args.time);
    let choices = choose(&assembly, &args.scene, report)?;
    Ok(crate::report::print(&dry_run::resolved(&assembly, &choices, args, line))?)
}

pub fn tell_threads(renderer: &CpuRenderer, report: &Report) {
    let n_threads = rayon::current_num_threads();
    report.choice(&format!("{n_threads} threads, {}", renderer.simd.name()), "--threads");
}

/// Fails before the work where the output could not be written after it.
pub fn check_output(path: &Path) -> anyhow::Result<()> {
    surfel_formats::check_output(path).map_err(|error| match error {
        surfel_formats::Error::Unsupported { .. } => Usage(error.to_string()).into(),
        other => anyhow::Error::from(other),
    })?;
    // A finished file takes the place of its name, and would end a pipe or a device there.
    if path.metadata().is_ok_and(|found| !found.is_file()) {
        bail!("{}: a device or a pipe stands there; name a file", path.display());
    }
    Ok(())
}

pub fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    let start = Instant::now();
    let result = work();
    *seconds = start.elapsed().as_secs_f64();
    result
}

/// Reads all files, if memory suffices and they have what is asked for.
pub fn load<'a>(
    args: &'a SceneArgs,
    line: &'a Line,
    global: &Global,
    report: &Report,
) -> anyhow::Result<Assembly<'a>> {
    let (width, height) = args.picture.resolution;
    let n_pixels = u64::from(width) * u64::from(height);
    let objects = line.scene.objects.iter().flat_map(|object| &object.files);
    let files = args.files.iter().filter(|file| !is_scene_file(file)).chain(objects);
    // Each once: objects of the same file share what it holds.
    let files: BTreeSet<PathBuf> = files.cloned().collect();
    let files: Vec<PathBuf> = files.into_iter().collect();
    if files.is_empty() {
        let scenes = name_files(&args.files);
        return Err(Usage(format!("{scenes}: no objects; add an [[object]] with a file")).into());
    }
    let names = line.scene.objects.iter().flat_map(|object| object.names());
    let names: Vec<&Path> = args.files.iter().map(PathBuf::as_path).chain(names).collect();
    args.material.check_names(&names)?;
    let inspected = files.iter().map(|file| surfel_formats::inspect(file));
    let sources = inspected.collect::<Result<Vec<_>, _>>()?;
    Plan::new(&sources, &files, args.preparation.select, n_pixels).check(global)?;
    let assembly = Assembly::load(args, line, report)?;
    check_color(&assembly)?;
    Ok(assembly)
}

/// Fails before the preparation if no file has the column asked for. The library knows only the columns
/// that were loaded, which are those asked for.
fn check_color(assembly: &Assembly) -> anyhow::Result<()> {
    for (cloud, of_cloud, files) in assembly.clouds() {
        let Some(color) = &of_cloud.color.color else { continue };
        let is_prepared = match color {
            ColorSource::Normal => true,
            ColorSource::Column(name) => name == SURFACE_VARIATION,
            _ => false,
        };
        if is_prepared || color.is_in(cloud) {
            continue;
        }
        bail!(
            "{}: no column {color}; --color takes elevation, normal, {SURFACE_VARIATION}, #RRGGBB \
             and what the file has: {}",
            name_files(files),
            match shown(&assembly.source.columns) {
                none if none.is_empty() => "only positions".to_owned(),
                columns => columns.join(", "),
            },
        )
    }
    Ok(())
}

/// Columns of a file as `--color` takes them.
fn shown(columns: &[String]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for column in columns {
        let name = match column.to_ascii_lowercase().as_str() {
            "x" | "y" | "z" | "nx" | "ny" | "nz" | "normal" | "radius" => continue,
            "red" | "green" | "blue" | "r" | "g" | "b" | "rgb" => "rgb",
            "classification" => "class",
            _ => column,
        };
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Up, camera and lights from the options and the data.
pub fn choose(assembly: &Assembly, args: &SceneArgs, report: &Report) -> anyhow::Result<Choices> {
    let outline = assembly.outline();
    let up = args.camera.up(&outline, &assembly.source, report);
    let (width, height) = args.picture.resolution;
    let of_file = assembly.graph.camera().filter(|_| args.camera.is_automatic());
    let camera = match of_file {
        Some((node, camera)) => {
            let name = &assembly.graph.nodes[node].name;
            report.choice(&format!("camera `{name}` of the file"), "--camera-position");
            camera
        }
        None => {
            let aspect = f64::from(width) / f64::from(height);
            args.camera.camera(&outline, up, aspect, report)
        }
    };
    let bounds = usual_bounds(&outline);
    let diagonal = (bounds.max - bounds.min).length();
    // Points as pixels are shaded by their depth alone.
    let is_shaded = args.surface.surface != SurfaceKind::Points;
    let lit = Lit { camera, up, diagonal };
    let lights = if is_shaded { light::lights(&args.light, &lit, report)? } else { Vec::new() };
    let sun_azimuth_deg = light::sun_azimuth_deg(&args.light, &lit);
    let is_of_file = of_file.is_some();
    Ok(Choices { up, camera, is_of_file, lights, sun_azimuth_deg })
}

/// The camera as its motion, or that of its node, has it at a time, at which the graph is posed.
pub fn camera_at(time_secs: f64, assembly: &Assembly, choices: &Choices) -> Camera {
    let of_file = assembly.graph.camera().filter(|_| choices.is_of_file);
    let camera = of_file.map_or(choices.camera, |(_, camera)| camera);
    match &assembly.camera_motion {
        Some(motion) => motion.at(time_secs, camera, choices.up),
        None => camera,
    }
}

pub fn describe(
    assembly: Assembly,
    choices: Choices,
    args: &SceneArgs,
    report: &Report,
) -> anyhow::Result<Scene> {
    Ok(Scene {
        graph: assembly.make(choices.up, report)?,
        lights: choices.lights,
        background: args.color.background(),
        camera: choices.camera,
    })
}

pub fn settings(args: &SceneArgs) -> Settings {
    let (width, height) = args.picture.resolution;
    Settings {
        width,
        height,
        samples_per_pixel: args.picture.spp,
        light_samples: args.picture.samples,
        max_depth: args.material.max_depth,
        seed: args.picture.seed,
        with_layers: false,
    }
}

/// Stops by which all light is to be brighter.
pub fn exposure(
    renderer: &CpuRenderer,
    flat: &FlatScene,
    settings: &Settings,
    args: &SceneArgs,
    report: &Report,
) -> anyhow::Result<f32> {
    match args.light.exposure {
        Exposure::Stops(stops) => Ok(stops as f32),
        Exposure::Auto if flat.lights.is_empty() && flat.lamps.is_empty() => Ok(0.0),
        Exposure::Auto => {
            let stops = exposure::automatic(renderer, flat, settings, &Muted(report))?;
            report.choice(&format!("exposure {stops:+.2} stops"), "--exposure");
            Ok(stops)
        }
    }
}

pub fn image_options(origin: DVec3, args: &SceneArgs) -> ImageOptions {
    let is_opaque = args.color.background() != Background::Transparent;
    ImageOptions {
        depth: if args.picture.bit_depth == "16" { BitDepth::Sixteen } else { BitDepth::Eight },
        alpha: if is_opaque { Alpha::Drop } else { Alpha::Keep },
        origin,
    }
}
