//! `surfel animate`: a film of a scene that moves, frame by frame, or of a turn around anything.

use crate::args::{Global, SceneArgs, Usage};
use crate::picture::{self, camera_at};
use crate::report::{Muted, Report};
use crate::scene_file::{CameraMotion, Line};
use crate::{dry_run, light};
use anyhow::{Context, anyhow};
use std::path::{Path, PathBuf};
use surfel::flat::{FlatLamp, FlatScene};
use surfel::math::{DQuat, DVec3};
use surfel::progress::Progress;
use surfel::render::{CpuRenderer, Renderer};
use surfel::scene::{Camera, Graph, Light, Scene};
use surfel::trace::Simd;
use surfel_formats::{Movie, MovieOptions};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The film: .mp4, .mov, .mkv, .webm or .avi (by ffmpeg), .gif, .png (an animated one), or numbered
    /// pictures, as in frame_####.png or .exr.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Frames of the film; as many as the scene's movement lasts if not given.
    #[arg(long, value_name = "N", help_heading = "Film",
        value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    frames: Option<u32>,
    /// Frames a second.
    #[arg(long, value_name = "N", default_value = "25", help_heading = "Film",
        value_parser = crate::args::parse::number_in::<1, 240>)]
    fps: f64,
    /// Turns everything before the camera once in so many seconds, under light that stays.
    #[arg(long, value_name = "SECONDS", help_heading = "Film",
        value_parser = crate::args::parse::positive)]
    turntable: Option<f64>,
    /// Go on where an interrupted run of the same film has stopped.
    #[arg(long, help_heading = "Film")]
    resume: bool,
    /// Print what would be done as a scene file on stdout, and render nothing.
    #[arg(long, help_heading = "Film")]
    dry_run: bool,
    #[command(flatten)]
    pub scene: SceneArgs,
}

const EXAMPLES: &str = "\
Examples:
  surfel animate scene.toml -o film.mp4
  surfel animate scan.laz -o turn.mp4 --turntable 8 --resolution 1280x720
  surfel animate truck.gltf -o truck.gif --frames 50 --resolution 480x270
  surfel animate scene.toml -o frames/f_####.png --resume";

pub fn run(args: &Args, line: &Line, global: &Global, report: &Report) -> anyhow::Result<()> {
    args.scene.check()?;
    if args.output.is_none() && !args.dry_run {
        return Err(Usage("name the film with -o, as in -o film.mp4".into()).into());
    }
    let (width, height) = args.scene.picture.resolution;
    let mut options = MovieOptions {
        width,
        height,
        fps: args.fps,
        n_frames: 1,
        image: picture::image_options(DVec3::ZERO, &args.scene),
        fingerprint: String::new(),
    };
    args.output.as_deref().map_or(Ok(()), |output| check(output, &options))?;
    let mut assembly = picture::load(&args.scene, line, global, report)?;
    options.n_frames = n_frames(args, &assembly.graph, assembly.camera_motion.as_ref())?;
    assembly.graph.pose(0.0);
    let choices = picture::choose(&assembly, &args.scene, report)?;
    let mut resolved = dry_run::scene(&assembly, &choices, &args.scene, line);
    resolved["output"] = serde_json::json!(args.output);
    resolved["frames"] = serde_json::json!(options.n_frames);
    resolved["fps"] = serde_json::json!(args.fps);
    if let Some(seconds) = args.turntable {
        resolved["turntable"] = serde_json::json!(seconds);
    }
    let (Some(output), false) = (&args.output, args.dry_run) else {
        return Ok(crate::report::print(&format!("{resolved:#}"))?);
    };
    options.fingerprint = fingerprint(&resolved, &args.scene, line);
    let camera_of = |frame: u32| {
        let time_secs = f64::from(frame) / args.fps;
        assembly.graph.pose(time_secs);
        camera_at(time_secs, &assembly, &choices)
    };
    let cameras: Vec<Camera> = (0..options.n_frames).map(camera_of).collect();
    assembly.graph.pose(0.0);
    let turn_axis = choices.up.as_dvec3();
    let scene = picture::describe(assembly, choices, &args.scene, report)?;
    let mut film = Film::new(scene, args, report)?;
    options.image = picture::image_options(film.flat.origin, &args.scene);

    let mut movie = Movie::open(output, &options, args.resume)?;
    if 0 < movie.n_done() {
        report.note(&format!(
            "{} of {} frames are there already",
            movie.n_done(),
            options.n_frames
        ));
    }
    report.begin("animate", u64::from(options.n_frames));
    for frame in 0..options.n_frames {
        if !movie.has(frame) {
            let time_secs = f64::from(frame) / args.fps;
            let turn = args.turntable.map(|seconds| {
                DQuat::from_axis_angle(turn_axis, std::f64::consts::TAU * time_secs / seconds)
            });
            let image = film.frame(time_secs, cameras[frame as usize], turn, report);
            let kept = image.and_then(|image| Ok(movie.add(frame, &image)?));
            kept.map_err(|error| with_advice(error, movie.n_done(), options.n_frames))?;
        }
        report.advance(1);
    }
    report.end_stage();
    let n_done = movie.n_done();
    let finished = movie.finish(report).map_err(anyhow::Error::from);
    finished.map_err(|error| with_advice(error, n_done, options.n_frames))?;
    report.end_stage();
    Ok(())
}

/// Tells that what was made is not lost.
fn with_advice(error: anyhow::Error, n_done: u32, n_frames: u32) -> anyhow::Error {
    if n_done == 0 {
        return error;
    }
    anyhow!("{error:#}; {n_done} of {n_frames} frames are kept, go on from there with --resume")
}

fn check(output: &Path, options: &MovieOptions) -> anyhow::Result<()> {
    surfel_formats::check_movie(output, options).map_err(|error| match error {
        surfel_formats::Error::Unsupported { .. } => Usage(error.to_string()).into(),
        other => anyhow::Error::from(other),
    })
}

fn n_frames(args: &Args, graph: &Graph, camera: Option<&CameraMotion>) -> Result<u32, Usage> {
    if let Some(frames) = args.frames {
        return Ok(frames);
    }
    let camera = camera.map_or(0.0, CameraMotion::duration_secs);
    let duration = graph.animation.duration_secs().max(camera).max(args.turntable.unwrap_or(0.0));
    if duration <= 0.0 {
        let text = "nothing moves; give --turntable SECONDS, or --frames for a still film";
        return Err(Usage(text.into()));
    }
    Ok((duration * args.fps).round().clamp(1.0, 1e6) as u32)
}

/// Changes with all that frames depend on.
fn fingerprint(resolved: &serde_json::Value, args: &SceneArgs, line: &Line) -> String {
    let objects = line.scene.objects.iter().flat_map(|object| &object.files);
    let objects = objects.chain(&args.light.environment);
    let stamp = |file: &PathBuf| {
        let data = std::fs::metadata(file).ok()?;
        Some((file.clone(), data.len(), data.modified().ok()?))
    };
    let files: Vec<_> = args.files.iter().chain(objects).map(stamp).collect();
    let mut scene = resolved.clone();
    scene["info"]["threads"] = serde_json::Value::Null;
    scene["info"]["simd"] = serde_json::Value::Null;
    let text = format!("{} {scene} {files:?}", env!("CARGO_PKG_VERSION"));
    let hash = text.bytes().fold(0, |hash, byte| surfel::math::hash(hash ^ u64::from(byte)));
    format!("{hash:016x}")
}

/// A scene made ready once, of which each frame moves what moves.
struct Film<'a> {
    graph: Graph,
    flat: FlatScene,
    /// As they are at the start of a turntable's turn.
    lights: Vec<Light>,
    lamps: Vec<FlatLamp>,
    stops: f32,
    renderer: CpuRenderer,
    args: &'a SceneArgs,
    with_layers: bool,
}

impl<'a> Film<'a> {
    fn new(scene: Scene, args: &'a Args, report: &Report) -> anyhow::Result<Self> {
        let mut flat = FlatScene::new(&scene, report)?;
        report.end_stage();
        let renderer = CpuRenderer { simd: Simd::detect() };
        let settings = picture::settings(&args.scene);
        let stops = picture::exposure(&renderer, &flat, &settings, &args.scene, report)?;
        light::expose(&mut flat, stops);
        picture::tell_threads(&renderer, report);
        let output = args.output.as_deref().and_then(Path::extension);
        let mut graph = scene.graph;
        graph.forget_static();
        Ok(Self {
            graph,
            lights: flat.lights.clone(),
            lamps: flat.lamps.clone(),
            stops,
            flat,
            renderer,
            args: &args.scene,
            with_layers: output.is_some_and(|extension| extension.eq_ignore_ascii_case("exr")),
        })
    }

    fn frame(
        &mut self,
        time_secs: f64,
        camera: Camera,
        turn: Option<DQuat>,
        report: &Report,
    ) -> anyhow::Result<surfel::image::Image> {
        if !self.graph.animation.channels.is_empty() {
            self.graph.pose(time_secs);
            self.flat.update(&self.graph, report)?;
            light::expose_lamps(&mut self.flat.lamps, self.stops);
            self.lamps.clone_from(&self.flat.lamps);
        }
        self.flat.camera = camera;
        if let Some(turn) = turn {
            // Camera and light go round together: to turn everything else would move every tree.
            self.flat.camera = camera.turned(turn);
            self.flat.lights = self.lights.iter().map(|light| light.turned(turn)).collect();
            let center = (camera.focal_point - self.flat.origin).as_vec3();
            self.flat.lamps = self.lamps.iter().map(|lamp| lamp.turned(turn, center)).collect();
        }
        let settings = picture::settings(self.args);
        let settings = surfel::render::Settings { with_layers: self.with_layers, ..settings };
        let (image, _) = self
            .renderer
            .render(&self.flat, &settings, &Muted(report))
            .with_context(|| format!("at {time_secs:.3} s"))?;
        Ok(image)
    }
}
