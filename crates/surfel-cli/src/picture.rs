//! From files to a picture: load, choose, prepare, build, expose, render, save.

use crate::args::{Exposure, Global, SceneArgs, Usage};
use crate::assemble::{Assembly, name_files};
use crate::eye::{Eye, Sight, keep_camera};
use crate::light::{self, Lit};
use crate::memory::{Plan, n_points};
use crate::playback::{Playback, Prepared};
use crate::render::Args;
use crate::report::Report;
use crate::scene_file::{Line, is_scene_file};
use crate::sequence::is_read_in_turn;
use crate::stats::{Run, Seconds};
use crate::{dry_run, exposure, stats};
use anyhow::bail;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfel::flat::FlatScene;
use surfel::math::{DVec3, Vec3};
use surfel::points::SURFACE_VARIATION;
use surfel::progress::Progress;
use surfel::render::{CpuRenderer, Settings};
use surfel::scene::color::ColorSource;
use surfel::scene::{Background, Light, Scene, usual_bounds};
use surfel::surface::SurfaceKind;
use surfel_formats::{Alpha, BitDepth, ImageOptions, Source};

/// What was chosen from the data.
pub struct Choices {
    pub up: Vec3,
    pub eye: Eye,
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
    if let Some(stats) = &args.stats {
        check_stats(stats, output, &args.scene, line)?;
    }
    let mut seconds = Seconds::default();
    let assembly = timed(&mut seconds.load, || load(&args.scene, line, global, report))?;
    let choices = choose(&assembly, &args.scene, report)?;
    let prepared = timed(&mut seconds.prepare, || prepare(assembly, choices, &args.scene, report))?;
    let counts = prepared.scene.graph.counts();
    let settings = settings(&args.scene, output);
    let build = || Playback::new(prepared, settings, report);
    let mut playback = timed(&mut seconds.build, build)?;
    playback.expose(&args.scene, report)?;
    playback.tell_threads(report);
    playback.seek(args.time, report)?;
    let (image, rendered) = playback.render(report)?;
    report.end_stage();
    report.check()?;
    let options = image_options(playback.flat.origin, &args.scene);
    surfel_formats::save_image(output, &image, &options)?;
    if let Some(path) = &args.stats {
        seconds.total = start.elapsed().as_secs_f64();
        let resolution = args.scene.picture.resolution;
        let (flat, simd) = (&playback.flat, playback.simd());
        let run = Run { flat, counts, seconds, rendered, resolution, simd };
        stats::write(path, &run.json())?;
    }
    Ok(())
}

/// Prints what would be made, and makes nothing.
pub fn tell(args: &Args, line: &Line, global: &Global, report: &Report) -> anyhow::Result<()> {
    args.output.as_deref().map_or(Ok(()), check_output)?;
    let assembly = load(&args.scene, line, global, report)?;
    let choices = choose(&assembly, &args.scene, report)?;
    Ok(crate::report::print(&dry_run::resolved(&assembly, &choices, args, line))?)
}

/// Fails before the work where the output could not be written after it.
pub fn check_output(path: &Path) -> anyhow::Result<()> {
    surfel_formats::check_output(path).map_err(|error| match error {
        surfel_formats::Error::Unsupported { .. } => Usage(error.to_string()).into(),
        other => anyhow::Error::from(other),
    })?;
    check_kind(path)
}

/// Fails where the numbers would take the place of the picture, or of what it is made from.
fn check_stats(stats: &Path, output: &Path, args: &SceneArgs, line: &Line) -> anyhow::Result<()> {
    if stats == Path::new("-") {
        return Ok(());
    }
    surfel_formats::check_place(stats)?;
    check_kind(stats)?;
    let scenes = args.files.iter().map(PathBuf::as_path);
    let mut taken = files(args, line).into_iter().chain(scenes).chain([output]);
    match taken.find(|path| is_same_file(path, stats)) {
        Some(path) => {
            let name = path.display();
            let text = format!("--stats {name}: would take the place of that file; name another");
            Err(Usage(text).into())
        }
        None => Ok(()),
    }
}

/// By any name; a file that is not there yet by its folder.
fn is_same_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let parent = path.parent().filter(|parent| *parent != Path::new(""));
        let folder = parent.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(path.canonicalize().unwrap_or(folder.join(path.file_name()?)))
    };
    a == b || place(a).is_some_and(|a| Some(a) == place(b))
}

fn check_kind(path: &Path) -> anyhow::Result<()> {
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

/// Reads all files, if memory suffices and they have what is asked for, and sets all to second 0.
pub fn load<'a>(
    args: &'a SceneArgs,
    line: &'a Line,
    global: &Global,
    report: &Report,
) -> anyhow::Result<Assembly<'a>> {
    check_files(args, line, global)?;
    let mut assembly = Assembly::load(args, line, report)?;
    Plan::of(&assembly.graph, args.preparation.select, n_pixels(args)).check(global)?;
    check_color(&assembly)?;
    assembly.graph.pose(0.0);
    if let Some(name) = &args.camera_name {
        keep_camera(&mut assembly.graph, name)?;
    }
    Ok(assembly)
}

/// Fails where a file is missing or no file of its kind, and where all need more memory than they may take: before
/// the work.
pub fn check_files(args: &SceneArgs, line: &Line, global: &Global) -> anyhow::Result<()> {
    let files = files(args, line);
    if files.is_empty() {
        let scenes = name_files(&args.files);
        return Err(Usage(format!("{scenes}: no objects; add an [[object]] with a file")).into());
    }
    let names = line.scene.objects.iter().flat_map(|object| object.names());
    let names: Vec<&Path> = args.files.iter().map(PathBuf::as_path).chain(names).collect();
    args.material.check_names(&names)?;
    let inspected = files.into_iter().map(|file| Ok((file, surfel_formats::inspect(file)?)));
    let mut sources = inspected.collect::<surfel_formats::Result<BTreeMap<&Path, Source>>>()?;
    forget_what_comes_later(&mut sources, line)?;
    Plan::new(&sources, args.preparation.select, n_pixels(args)).check(global)
}

fn n_pixels(args: &SceneArgs) -> u64 {
    let (width, height) = args.picture.resolution;
    u64::from(width) * u64::from(height)
}

/// Those of the command line and of objects, each once: objects of the same file share what it holds.
fn files<'a>(args: &'a SceneArgs, line: &'a Line) -> BTreeSet<&'a Path> {
    let objects = line.scene.objects.iter().flat_map(|object| &object.files);
    let files = args.files.iter().filter(|file| !is_scene_file(file)).chain(objects);
    files.map(PathBuf::as_path).collect()
}

/// Of sequences that are read one by one, leaves the largest.
fn forget_what_comes_later(
    sources: &mut BTreeMap<&Path, Source>,
    line: &Line,
) -> anyhow::Result<()> {
    for object in line.scene.objects.iter().filter(|object| 1 < object.files.len()) {
        if is_read_in_turn(object, &line.for_object(&object.name, &object.options)?)? {
            let size = |file: &&PathBuf| {
                let source = sources.get(file.as_path())?;
                Some(source.n_triangles.unwrap_or_else(|| n_points(file, source)))
            };
            let largest = object.files.iter().max_by_key(size).cloned();
            let others = object.files.iter().filter(|file| Some(*file) != largest.as_ref());
            others.for_each(|file| _ = sources.remove(file.as_path()));
        }
    }
    Ok(())
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
            match shown(&assembly.source().columns) {
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
    let up = args.camera.up(&outline, &assembly.sources, report);
    let motion = assembly.camera_motion.clone();
    let bounds = usual_bounds(&outline);
    let sight = Sight { outline: &outline, bounds, up };
    let eye = Eye::choose(&assembly.graph, &sight, args, motion, report);
    let diagonal = (bounds.max - bounds.min).length();
    // Points as pixels are shaded by their depth alone.
    let is_shaded = args.surface.surface != SurfaceKind::Points;
    let lit = Lit { camera: eye.camera, up, diagonal };
    let environment = assembly.environment.as_ref();
    let lights = match is_shaded {
        true => light::lights(&args.light, environment, &lit, report)?,
        false => Vec::new(),
    };
    let sun_azimuth_deg = light::sun_azimuth_deg(&args.light, &lit);
    Ok(Choices { up, eye, lights, sun_azimuth_deg })
}

/// Makes all clouds ready for their trees.
pub fn prepare<'a>(
    assembly: Assembly<'a>,
    choices: Choices,
    args: &SceneArgs,
    report: &Report,
) -> anyhow::Result<Prepared<'a>> {
    let Choices { up, eye, lights, .. } = choices;
    let (graph, sequences) = assembly.make(up, report)?;
    let camera = eye.at(0.0, &graph);
    let scene = Scene { graph, lights, background: args.color.background(), camera };
    Ok(Prepared { scene, sequences, eye, up })
}

pub fn settings(args: &SceneArgs, output: &Path) -> Settings {
    let (width, height) = args.picture.resolution;
    Settings {
        width,
        height,
        samples_per_pixel: args.picture.spp,
        light_samples: args.picture.samples,
        max_depth: args.material.max_depth,
        seed: args.picture.seed,
        with_layers: output.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")),
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
            let stops = exposure::automatic(renderer, flat, settings, &report.muted())?;
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
