//! From files to a picture: load, choose, prepare, build, expose, render, save.

use crate::args::{Exposure, Global, LightKind, Usage};
use crate::light::{self, Lit};
use crate::memory::Plan;
use crate::render::Args;
use crate::report::{Muted, Report};
use crate::stats::{Run, Seconds};
use crate::{dry_run, exposure, stats};
use anyhow::{Context, bail};
use std::path::Path;
use std::time::Instant;
use surfel::flat::FlatScene;
use surfel::image::Image;
use surfel::math::Vec3;
use surfel::points::{self, PointCloud, SURFACE_VARIATION, prepare};
use surfel::progress::Progress;
use surfel::render::{CpuRenderer, Renderer, Settings};
use surfel::scene::color::{ColorSource, colorize};
use surfel::scene::{Background, Camera, Light, Material, Scene, usual_bounds};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_formats::{Alpha, BitDepth, ImageOptions, Loaded, Source};

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
    let Loaded { cloud, source } = timed(&mut seconds.load, || load(args, global, report))?;
    check_color(&cloud, &source, args)?;
    let choices = choose_from(&cloud, &source, args, report);
    if args.dry_run {
        return Ok(crate::report::print(&dry_run::resolved(&cloud, &choices, args))?);
    }
    let scene = timed(&mut seconds.prepare, || describe(cloud, choices, args, report))?;
    let n_points = scene.cloud.len();
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
        let run = Run { flat: &flat, n_points, seconds, rendered, resolution, simd: renderer.simd };
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

fn load(args: &Args, global: &Global, report: &Report) -> anyhow::Result<Loaded> {
    let (width, height) = args.picture.resolution;
    let n_pixels = u64::from(width) * u64::from(height);
    let inspected = args.files.iter().map(|file| surfel_formats::inspect(file));
    let sources = inspected.collect::<Result<Vec<_>, _>>()?;
    Plan::new(&sources, &args.files, args.preparation.select, n_pixels).check(global)?;
    let options =
        args.preparation.load_options(args.preparation.columns(args.color.color.as_ref()));
    let (loaded, _) = surfel_formats::load_all(&args.files, &options, report)?;
    report.end_stage();
    if loaded.cloud.is_empty() {
        return Err(surfel::Error::EmptyCloud).context(name_files(args));
    }
    report.note(&format!(
        "{}: {} points, {}",
        name_files(args),
        loaded.cloud.len(),
        loaded.source.format
    ));
    Ok(loaded)
}

/// Fails before the preparation if no file has the column asked for. The library knows only the columns
/// that were loaded, which are those asked for.
fn check_color(cloud: &PointCloud, source: &Source, args: &Args) -> anyhow::Result<()> {
    let Some(color) = &args.color.color else { return Ok(()) };
    let is_prepared = match color {
        ColorSource::Normal => true,
        ColorSource::Column(name) => name == SURFACE_VARIATION,
        _ => false,
    };
    if is_prepared || color.is_in(cloud) {
        return Ok(());
    }
    bail!(
        "{}: no column {color}; --color takes elevation, normal, {SURFACE_VARIATION}, #RRGGBB and \
         what the file has: {}",
        name_files(args),
        match shown(&source.columns) {
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

fn name_files(args: &Args) -> String {
    let more = args.files.len() - 1;
    let first = args.files[0].display();
    if more == 0 { first.to_string() } else { format!("{first} and {more} more") }
}

fn choose_from(cloud: &PointCloud, source: &Source, args: &Args, report: &Report) -> Choices {
    let up = args.camera.up(cloud, source, report);
    let (width, height) = args.picture.resolution;
    let camera = args.camera.camera(cloud, up, f64::from(width) / f64::from(height), report);
    let bounds = usual_bounds(cloud);
    let diagonal = (bounds.max - bounds.min).length();
    // Points as pixels are shaded by their depth alone.
    let is_shaded = args.surface.surface != SurfaceKind::Points;
    let lit = Lit { camera, up, diagonal };
    let lights = if is_shaded { light::lights(&args.light, &lit, report) } else { Vec::new() };
    Choices { up, camera, lights }
}

fn describe(
    cloud: PointCloud,
    choices: Choices,
    args: &Args,
    report: &Report,
) -> anyhow::Result<Scene> {
    let color = args.color.color.as_ref();
    let preparation = args.preparation.preparation(args.picture.seed, color);
    let (cloud, prepared) =
        prepare(cloud, &preparation, report).with_context(|| name_files(args))?;
    report.end_stage();
    tell_prepared(&prepared, args, report);
    let coloring = args.color.coloring(choices.up);
    let colors = colorize(&cloud, &coloring, &report.with_flag("--color, --cmap, --range"))
        .with_context(|| name_files(args))?;
    let is_lit = !args.light.has(LightKind::None);
    Ok(Scene {
        cloud,
        surface: args.surface.surface,
        boundary: args.surface.boundary,
        colors,
        material: if is_lit { Material::MATTE } else { Material::UNLIT },
        lights: choices.lights,
        background: args.color.background(),
        camera: choices.camera,
    })
}

fn tell_prepared(prepared: &points::Report, args: &Args, report: &Report) {
    if prepared.normals.is_none() {
        report.choice("normals as in the file", "--normals-k");
    }
    args.preparation.tell_normals(prepared, report);
    if prepared.radii.is_none() {
        report.choice("radii as in the file", "--radius");
    }
    args.preparation.tell_radii(prepared, report);
}

fn settings(args: &Args) -> Settings {
    let (width, height) = args.picture.resolution;
    let extension = args.output.extension().unwrap_or_default();
    Settings {
        width,
        height,
        samples_per_pixel: args.picture.spp,
        light_samples: args.picture.samples,
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
        Exposure::Auto if flat.lights.is_empty() => {
            return Ok(());
        }
        Exposure::Auto => {
            let stops = exposure::automatic(renderer, flat, settings, &Muted(report))?;
            report.choice(&format!("exposure {stops:+.2} stops"), "--exposure");
            stops
        }
    };
    light::expose(&mut flat.lights, stops);
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
