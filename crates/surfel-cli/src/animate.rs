//! `surfel animate`: a film of a scene that moves, frame by frame, or of a turn around anything.

use crate::args::{Global, SceneArgs, Usage};
use crate::playback::Playback;
use crate::report::Report;
use crate::scene_file::Line;
use crate::{dry_run, picture};
use anyhow::{Context, anyhow};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use surfel::image::Image;
use surfel::math::DVec3;
use surfel::progress::Progress;
use surfel_formats::{Movie, MovieOptions, Source};

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
    let assembly = picture::load(&args.scene, line, global, report)?;
    options.n_frames = n_frames(args, assembly.duration_secs())?;
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
    options.fingerprint = fingerprint(&resolved, &args.scene, line, &assembly.sources);
    let prepared = picture::prepare(assembly, choices, &args.scene, report)?;
    let settings = picture::settings(&args.scene, output);
    let mut playback = Playback::new(prepared, settings, report)?;
    playback.expose(&args.scene, report)?;
    playback.tell_threads(report);
    options.image = picture::image_options(playback.flat.origin, &args.scene);

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
            let image = make_frame(&mut playback, f64::from(frame) / args.fps, args, report);
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

fn make_frame(
    playback: &mut Playback,
    time_secs: f64,
    args: &Args,
    report: &Report,
) -> anyhow::Result<Image> {
    let muted = report.muted();
    playback.seek(time_secs, &muted)?;
    if let Some(seconds) = args.turntable {
        playback.turn(TAU * time_secs / seconds);
    }
    let rendered = playback.render(&muted);
    let (image, _) = rendered.with_context(|| format!("at {time_secs:.3} s"))?;
    Ok(image)
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

fn n_frames(args: &Args, moving_secs: f64) -> Result<u32, Usage> {
    if let Some(frames) = args.frames {
        return Ok(frames);
    }
    let duration = moving_secs.max(args.turntable.unwrap_or(0.0));
    if duration <= 0.0 {
        let text = "nothing moves; give --turntable SECONDS, or --frames for a still film";
        return Err(Usage(text.into()));
    }
    Ok((duration * args.fps).round().clamp(1.0, 1e6) as u32)
}

/// Changes with all that frames depend on.
fn fingerprint(
    resolved: &serde_json::Value,
    args: &SceneArgs,
    line: &Line,
    sources: &[Source],
) -> String {
    let objects = line.scene.objects.iter().flat_map(|object| &object.files);
    let beside = sources.iter().flat_map(|source| &source.beside);
    let named = objects.chain(&args.light.environment).chain(beside);
    let stamp = |file: &PathBuf| {
        let data = std::fs::metadata(file).ok()?;
        Some((file.clone(), data.len(), data.modified().ok()?))
    };
    let files: Vec<_> = args.files.iter().chain(named).map(stamp).collect();
    let mut scene = resolved.clone();
    scene["info"]["threads"] = serde_json::Value::Null;
    scene["info"]["simd"] = serde_json::Value::Null;
    let text = format!("{} {scene} {files:?}", env!("CARGO_PKG_VERSION"));
    let hash = text.bytes().fold(0, |hash, byte| surfel::math::hash(hash ^ u64::from(byte)));
    format!("{hash:016x}")
}
