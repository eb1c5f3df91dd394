//! `surfel render`: from files to a picture.

use crate::global::{Global, check_device};
use crate::options::Scope;
use crate::output::{
    check_height_map, check_picture, check_picture_size, check_replaces_nothing, check_stats,
};
use crate::report::{Report, print};
use crate::scene_args::SceneArgs;
use crate::stats::{self, RunStats, Seconds};
use crate::usage::Usage;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfel::animate;
use surfel::description::{Backend, Section};
use surfel::resolve::{AutoSettings, KeepOptions, LoadedScene, report_coverage};
use surfel::{SceneDescription, start_global_threads};
use surfel_core::progress::Progress;
use surfel_core::trace::Simd;
use surfel_core::words::counted;

/// Arguments of `surfel render`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The picture: .png, .jpg, .webp, .tif, .exr (linear, with all layers) or - for PNG on stdout.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Writes numbers about the run as JSON; - for stdout.
    #[arg(long, value_name = "FILE", help_heading = Section::Output.heading(), hide_short_help = true)]
    stats: Option<PathBuf>,
    /// Prints what would be done as a scene file on stdout, and renders nothing.
    #[arg(long, help_heading = Section::Output.heading(), hide_short_help = true)]
    dry_run: bool,
    #[command(flatten)]
    scene: SceneArgs<Args>,
}

impl Scope for Args {
    fn has(section: Section, path: &str) -> bool {
        section != Section::Everywhere && !["output", "frames", "fps", "turntable"].contains(&path)
    }
}

const EXAMPLES: &str = "\
Examples:
  surfel render scan.laz -o scan.png
  surfel render scan.laz -o close.png --camera-azimuth-angle 60 --camera-zoom-factor 1.5
  surfel render scan.laz -o plan.tif --gsd 0.1 --height-map heights.tif
  surfel render facade.e57 -o elevation.png --scale 1:50 --camera-elevation-angle 0
  surfel render scan.laz -o classes.png --color class --light sky
  surfel render north.las south.las -o heights.png --color elevation --cmap terrain
  surfel render 'tiles/*.laz' -o tiles.png
  surfel render site.laz house.glb statue.ply -o plan.png --material statue.ply=glass
  surfel render scene.toml -o scene.png
  surfel render statue.ply -o statue.exr --up +Y --spp 64 --no-background
  surfel render huge.laz -o quick.png --subsample random:2000000 --spp 1 --stats -

Not the picture you expected? Each choice is shown with the option that overrides it.
  Holes or blur: --radius-scale 1.5 or 0.7. On its side: --up +Y or +Z.
  The wrong side: --camera-azimuth-angle 180. Colours or light: --color, --gamma, --exposure.";

/// Renders a picture.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let mut description = args.scene.description(global, report)?;
    if args.output.is_some() {
        description.output.output.clone_from(&args.output);
    }
    start_global_threads(&description.run)?;
    check_device(&description.run)?;
    if args.dry_run {
        return print_dry_run(&description, report);
    }
    let stdout = Path::new("-");
    let Some(output) = description.output.output.clone() else {
        return Err(Usage("name the picture with -o, as in -o picture.png".into()).into());
    };
    if output == stdout && args.stats.as_deref() == Some(stdout) {
        let text = "picture and stats cannot both go to stdout; name a file for one";
        return Err(Usage(text.into()).into());
    }
    check_outputs(args, &description, &output)?;
    render_to_file(&description, &output, args.stats.as_deref(), report)
}

/// Fails where a result could not be written, or would replace a file.
fn check_outputs(args: &Args, description: &SceneDescription, output: &Path) -> anyhow::Result<()> {
    let heights = description.plan.height_map.as_deref();
    let stats = args.stats.as_deref();
    check_picture(output)?;
    check_picture_size(output, description.picture.resolution())?;
    stats.map_or(Ok(()), check_stats)?;
    heights.map_or(Ok(()), check_height_map)?;
    let others = [("--height-map", heights), ("--stats", stats)];
    let others = others.into_iter().filter_map(|(option, path)| Some((option, path?)));
    let outputs: Vec<(&str, &Path)> = [("-o", output)].into_iter().chain(others).collect();
    check_replaces_nothing(&outputs, description.named_files().chain(&args.scene.files))
}

/// Renders a description to a file, and writes numbers about the run to another.
pub fn render_to_file(
    description: &SceneDescription,
    output: &Path,
    stats: Option<&Path>,
    report: &Report,
) -> anyhow::Result<()> {
    let start = Instant::now();
    let mut seconds = Seconds::default();
    let read = || LoadedScene::read(description, KeepOptions::default(), report);
    let loaded = timed(&mut seconds.load, read)?;
    let auto = AutoSettings::choose(&loaded, description, report)?;
    // The pixels of a plan are chosen from the data.
    check_picture_size(output, auto.complete_description(&loaded).picture.resolution())?;
    let resolved = timed(&mut seconds.prepare, || loaded.into_resolved(auto, report))?;
    let counts = resolved.scene.graph.n_points_and_triangles();
    let mut scene = timed(&mut seconds.build, || resolved.build_trees(report))?;
    scene.choose_exposure(report)?;
    report_threads(scene.simd(), report);
    animate::seek(&mut scene, description.output.time(), report)?;
    let (image, rendered) = scene.render_with(report)?;
    report.end();
    report.check()?;
    report_coverage(&image, report);
    let heights = description.plan.height_map.as_deref();
    let heights = heights.map(|path| Ok((path, scene.height_map(report)?)));
    let heights = heights.transpose().map_err(|error: surfel::Error| error)?;
    image.save(output)?;
    if output != Path::new("-") {
        let (width, height) = scene.description().picture.resolution();
        report.note(&format!("{}: {width}x{height} pixels", output.display()));
    }
    if let Some((path, map)) = heights {
        surfel_formats::save_height_map(path, &map)?;
    }
    if let Some(path) = stats {
        seconds.total = start.elapsed().as_secs_f64();
        let resolution = scene.description().picture.resolution();
        let (flat, simd) = (scene.flat(), scene.simd());
        let gpu = scene.gpu_name();
        let run = RunStats { flat, counts, seconds, rendered, resolution, simd, gpu };
        stats::write(path, &run.json())?;
    }
    Ok(())
}

/// Reports the threads and the SIMD level.
pub fn report_threads(simd: Simd, progress: &dyn Progress) {
    let threads = counted(rayon::current_num_threads(), "thread");
    let line = format!("{threads}, {}", simd.name());
    progress.choice(&line, &["threads"]);
}

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> surfel::Result<T>) -> surfel::Result<T> {
    let start = Instant::now();
    let result = work();
    *seconds = start.elapsed().as_secs_f64();
    result
}

fn print_dry_run(description: &SceneDescription, report: &Report) -> anyhow::Result<()> {
    description.output.output.as_deref().map_or(Ok(()), check_picture)?;
    let loaded = LoadedScene::read(description, KeepOptions::default(), report)?;
    loaded.check_surfaces(description, description.output.time())?;
    let auto = AutoSettings::choose(&loaded, description, report)?;
    let mut complete = auto.complete_description(&loaded);
    complete.output.time = Some(description.output.time());
    if let Some(output) = &description.output.output {
        check_picture_size(output, complete.picture.resolution())?;
    }
    Ok(print(&format!("{:#}", with_info(&complete, &loaded)))?)
}

fn backend_word(backend: Backend) -> &'static str {
    match backend {
        Backend::Auto => "auto",
        Backend::Cpu => "cpu",
        Backend::Gpu => "gpu",
    }
}

/// Returns a complete description as a scene file, with facts about the data and the machine.
pub fn with_info(complete: &SceneDescription, loaded: &LoadedScene) -> Value {
    let (n_points, n_triangles) = loaded.graph.n_points_and_triangles();
    let mut table = complete.to_table();
    table.insert(
        "info".into(),
        json!({
            "points": n_points,
            "triangles": n_triangles,
            "threads": rayon::current_num_threads(),
            "simd": Simd::detect().name(),
            "backend": backend_word(complete.run.chosen_backend()),
        }),
    );
    Value::Object(table)
}
