//! `surfel animate`: a movie of an animated scene, frame by frame, or of a turn around anything.

use crate::cluster;
use crate::global::{Global, check_device};
use crate::options::Scope;
use crate::output::check_replaces_nothing;
use crate::render::{report_threads, with_info};
use crate::report::{Report, print};
use crate::scene_args::SceneArgs;
use crate::usage::Usage;
use std::path::{Path, PathBuf};
use surfel::animate::{PlannedMovie, check_movie};
use surfel::description::Section;
use surfel::{SceneDescription, start_global_threads};
use surfel_core::progress::Progress;
use surfel_core::trace::Simd;
use surfel_core::words::counted;

/// Arguments of `surfel animate`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The movie: .mp4, .mov, .mkv, .webm or .avi (by ffmpeg), .gif, .png (an animated one), or numbered
    /// pictures, as in frame_####.png or .exr.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Continues an interrupted run of the same movie.
    #[arg(long, help_heading = Section::Output.heading())]
    resume: bool,
    /// Renders the frames on the workers of a Dask scheduler, as in tcp://scheduler:8786. They need the files under the
    /// same names and the Python package, which this machine needs too.
    #[arg(long, value_name = "ADDRESS", help_heading = Section::Output.heading(), hide_short_help = true)]
    cluster: Option<String>,
    /// Prints what would be done as a scene file on stdout, and renders nothing.
    #[arg(long, help_heading = Section::Output.heading(), hide_short_help = true)]
    dry_run: bool,
    #[command(flatten)]
    scene: SceneArgs<Args>,
}

impl Scope for Args {
    fn has(section: Section, path: &str) -> bool {
        ![Section::Everywhere, Section::Plans].contains(&section)
            && !["output", "time"].contains(&path)
    }
}

const EXAMPLES: &str = "\
Examples:
  surfel animate scene.toml -o movie.mp4
  surfel animate scan.laz -o turn.mp4 --turntable 8 --resolution 1280x720
  surfel animate truck.gltf -o truck.gif --frames 50 --resolution 480x270
  surfel animate scene.toml -o frames/f_####.png --resume";

/// Renders a movie.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let mut description = args.scene.description(global, report)?;
    if args.output.is_some() {
        description.output.output.clone_from(&args.output);
    }
    start_global_threads(&description.run)?;
    check_device(&description.run)?;
    if description.output.output.is_none() && !args.dry_run {
        return Err(Usage("name the movie with -o, as in -o movie.mp4".into()).into());
    }
    if let Some(output) = &description.output.output {
        check_replaces_nothing(
            &[("-o", output)],
            description.named_files().chain(&args.scene.files),
        )?;
    }
    match (&args.cluster, &description.output.output) {
        (Some(address), Some(output)) if !args.dry_run => {
            animate_on_cluster(&description, output, (address, args.resume), report)
        }
        _ => animate_description(&description, args.resume, args.dry_run, report),
    }
}

/// Renders the movie of a description to its output, or prints what would be done.
pub fn animate_description(
    description: &SceneDescription,
    resumes: bool,
    is_dry_run: bool,
    report: &Report,
) -> anyhow::Result<()> {
    let output = description.output.output.as_deref();
    output.map_or(Ok(()), |output| check(output, description))?;
    let movie = plan(description, report)?;
    let (Some(output), false) = (output, is_dry_run) else {
        movie.loaded.check_surfaces(description, 0.0)?;
        return Ok(print(&format!("{:#}", with_info(&movie.complete, &movie.loaded)))?);
    };
    report_threads(Simd::detect(), report);
    let line = movie_line(output, &movie.complete);
    movie.render(output, resumes, report)?;
    report.note(&line);
    Ok(())
}

/// Returns a line about a finished movie: its name, length and size.
fn movie_line(output: &Path, complete: &SceneDescription) -> String {
    let (width, height) = complete.picture.resolution();
    let frames = counted(complete.output.frames.unwrap_or(1), "frame");
    format!("{}: {frames} of {width}x{height} pixels", output.display())
}

/// Renders the movie of a description on the workers of the scheduler at `address`.
fn animate_on_cluster(
    description: &SceneDescription,
    output: &Path,
    (address, resumes): (&str, bool),
    report: &Report,
) -> anyhow::Result<()> {
    check(output, description)?;
    let movie = plan(description, report)?;
    let mut recipe = description.clone();
    // The workers render frames of a movie whose length the data of this machine decide.
    recipe.output.frames = movie.complete.output.frames;
    recipe.output.output = None;
    movie.collect(output, resumes, report, |frames, format, add| {
        cluster::render_frames(address, &recipe, (frames, format), add, report)
    })?;
    report.note(&movie_line(output, &movie.complete));
    Ok(())
}

fn plan(description: &SceneDescription, report: &Report) -> anyhow::Result<PlannedMovie> {
    PlannedMovie::new(description, report).map_err(|error| match error {
        surfel::Error::Invalid(invalid) if invalid.path == "frames" => anyhow::Error::from(Usage(
            "nothing moves; add --turntable SECONDS, or --frames N for a still movie".into(),
        )),
        error => error.into(),
    })
}

fn check(output: &Path, description: &SceneDescription) -> anyhow::Result<()> {
    check_movie(output, description).map_err(|error| match error {
        surfel::Error::File(surfel_formats::Error::Unsupported { .. }) => {
            Usage(error.to_string()).into()
        }
        other => anyhow::Error::from(other),
    })
}
