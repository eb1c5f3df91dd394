//! From files to a picture: load, choose, prepare, build, expose, render, save.

use crate::args::{Exposure, Global, Usage};
use crate::assemble::{Assembly, Making, name_files};
use crate::light::{self, Lit};
use crate::memory::Plan;
use crate::render::Args;
use crate::report::{Muted, Report};
use crate::stats::{Run, Seconds};
use crate::{dry_run, exposure, stats};
use anyhow::bail;
use std::path::Path;
use std::time::Instant;
use surfel::flat::FlatScene;
use surfel::image::Image;
use surfel::math::Vec3;
use surfel::points::{PointCloud, SURFACE_VARIATION};
use surfel::progress::Progress;
use surfel::render::{CpuRenderer, Renderer, Settings};
use surfel::scene::color::ColorSource;
use surfel::scene::{Background, Camera, Light, Scene, usual_bounds};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_formats::{Alpha, BitDepth, ImageOptions, Source};

/// What was chosen from the data.
pub struct Choices {
    pub up: Vec3,
    pub camera: Camera,
    pub lights: Vec<Light>,
}

pub fn make(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let start = Instant::now();
    check_output(&args.output)?;
    let mut seconds = Seconds::default();
    let assembly = timed(&mut seconds.load, || load(args, global, report))?;
    check_color(&assembly, args)?;
    let choices = choose_from(&assembly.outline(), &assembly.source, args, report)?;
    if args.dry_run {
        return Ok(crate::report::print(&dry_run::resolved(&assembly, &choices, args))?);
    }
    let scene = timed(&mut seconds.prepare, || describe(assembly, choices, args, report))?;
    let counts = scene.graph.counts();
    let mut flat = timed(&mut seconds.build, || Ok(FlatScene::new(&scene, report)?))?;
    drop(scene);

    let renderer = CpuRenderer { simd: Simd::detect() };
    let settings = settings(args);
    expose(&renderer, &mut flat, &settings, args, report)?;
    report.choice(
        &format!("{} threads, {}", rayon::current_num_threads(), renderer.simd.name()),
        "--threads",
    );
    let (image, rendered) = renderer.render(&flat, &settings, report)?;
    report.end_stage();
    report.check()?;
    save(&image, &flat, args)?;
    if let Some(path) = &args.stats {
        seconds.total = start.elapsed().as_secs_f64();
        let resolution = args.picture.resolution;
        let run = Run { flat: &flat, counts, seconds, rendered, resolution, simd: renderer.simd };
        stats::write(path, &run.json())?;
    }
    Ok(())
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

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    let start = Instant::now();
    let result = work();
    *seconds = start.elapsed().as_secs_f64();
    result
}

fn load(args: &Args, global: &Global, report: &Report) -> anyhow::Result<Assembly> {
    let (width, height) = args.picture.resolution;
    let n_pixels = u64::from(width) * u64::from(height);
    let inspected = args.files.iter().map(|file| surfel_formats::inspect(file));
    let sources = inspected.collect::<Result<Vec<_>, _>>()?;
    Plan::new(&sources, &args.files, args.preparation.select, n_pixels).check(global)?;
    let columns = args.preparation.columns(args.color.color.as_ref());
    Assembly::load(&args.files, columns, &args.preparation, &args.material, report)
}

/// Fails before the preparation if no file has the column asked for. The library knows only the columns
/// that were loaded, which are those asked for.
fn check_color(assembly: &Assembly, args: &Args) -> anyhow::Result<()> {
    let Some(color) = &args.color.color else { return Ok(()) };
    let is_prepared = match color {
        ColorSource::Normal => true,
        ColorSource::Column(name) => name == SURFACE_VARIATION,
        _ => false,
    };
    if is_prepared || assembly.clouds().all(|cloud| color.is_in(cloud)) {
        return Ok(());
    }
    bail!(
        "{}: no column {color}; --color takes elevation, normal, {SURFACE_VARIATION}, #RRGGBB and \
         what the file has: {}",
        name_files(&args.files),
        match shown(&assembly.source.columns) {
            none if none.is_empty() => "only positions".to_owned(),
            columns => columns.join(", "),
        },
    )
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

fn choose_from(
    outline: &PointCloud,
    source: &Source,
    args: &Args,
    report: &Report,
) -> anyhow::Result<Choices> {
    let up = args.camera.up(outline, source, report);
    let (width, height) = args.picture.resolution;
    let camera = args.camera.camera(outline, up, f64::from(width) / f64::from(height), report);
    let bounds = usual_bounds(outline);
    let diagonal = (bounds.max - bounds.min).length();
    // Points as pixels are shaded by their depth alone.
    let is_shaded = args.surface.surface != SurfaceKind::Points;
    let lit = Lit { camera, up, diagonal };
    let lights = if is_shaded { light::lights(&args.light, &lit, report)? } else { Vec::new() };
    Ok(Choices { up, camera, lights })
}

fn describe(
    assembly: Assembly,
    choices: Choices,
    args: &Args,
    report: &Report,
) -> anyhow::Result<Scene> {
    let making = Making {
        surface: &args.surface,
        preparation: &args.preparation,
        color: &args.color,
        material: &args.material,
        light: &args.light,
        seed: args.picture.seed,
        up: choices.up,
    };
    Ok(Scene {
        graph: assembly.make(&making, report)?,
        lights: choices.lights,
        background: args.color.background(),
        camera: choices.camera,
    })
}

fn settings(args: &Args) -> Settings {
    let (width, height) = args.picture.resolution;
    let extension = args.output.extension().unwrap_or_default();
    Settings {
        width,
        height,
        samples_per_pixel: args.picture.spp,
        light_samples: args.picture.samples,
        max_depth: args.material.max_depth,
        seed: args.picture.seed,
        with_layers: extension.eq_ignore_ascii_case("exr"),
    }
}

fn expose(
    renderer: &CpuRenderer,
    flat: &mut FlatScene,
    settings: &Settings,
    args: &Args,
    report: &Report,
) -> anyhow::Result<()> {
    let stops = match args.light.exposure {
        Exposure::Stops(stops) => stops as f32,
        Exposure::Auto if flat.lights.is_empty() && flat.lamps.is_empty() => {
            return Ok(());
        }
        Exposure::Auto => {
            let stops = exposure::automatic(renderer, flat, settings, &Muted(report))?;
            report.choice(&format!("exposure {stops:+.2} stops"), "--exposure");
            stops
        }
    };
    light::expose(flat, stops);
    Ok(())
}

fn save(image: &Image, flat: &FlatScene, args: &Args) -> anyhow::Result<()> {
    let is_opaque = flat.background != Background::Transparent;
    let options = ImageOptions {
        depth: if args.picture.bit_depth == "16" { BitDepth::Sixteen } else { BitDepth::Eight },
        alpha: if is_opaque { Alpha::Drop } else { Alpha::Keep },
        origin: flat.origin,
    };
    Ok(surfel_formats::save_image(&args.output, image, &options)?)
}
