//! The program `surfel`: parses the command line, calls the libraries, reports.
//!
//! It is a library so that its scene files and its viewer can be tried from outside; `main.rs` only calls
//! [`main`].

mod animate;
mod args;
mod assemble;
mod bench;
mod cloud;
mod demo;
mod dry_run;
mod exposure;
mod eye;
mod gallery;
mod info;
mod interrupt;
mod light;
mod memory;
mod picture;
mod playback;
mod prepare;
mod render;
mod report;
pub mod scene_file;
mod sequence;
mod shell;
mod stats;
mod view;

use args::{Global, SceneArgs, Usage};
use clap::{Parser, Subcommand};
use report::{Report, Verbosity};
use scene_file::Line;
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
use surfel_web::Studio;

/// Turns point clouds into pictures and films by ray tracing the points themselves, as a continuous surface,
/// together with meshes.
#[derive(Parser)]
#[command(name = "surfel", version, after_help = EXAMPLES, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    global: Global,
}

const EXAMPLES: &str = "\
Examples:
  surfel demo                            a ruin to play with: demo.laz and demo.png, here
  surfel render scan.laz -o scan.png     a finished picture; every choice is told and is a flag
  surfel info scan.laz                   what is in a file
  surfel COMMAND --help                  all options of a command, with examples";

#[derive(Subcommand)]
enum Command {
    /// Render point clouds, meshes and scenes to a picture.
    Render(Box<render::Args>),
    /// Render a film of a scene that moves, or of a turn around anything.
    Animate(Box<animate::Args>),
    /// Look around in a scene, ray traced, in a browser.
    View(Box<view::Args>),
    /// Tell what is in a file.
    Info(info::Args),
    /// Clean a cloud, add normals and radii, write it to a file.
    Prepare(prepare::Args),
    /// Scan a ruin with a virtual scanner and render it: something to begin with.
    Demo(demo::Args),
    /// Measure how many rays a second are traced.
    Bench(Box<bench::Args>),
}

/// Runs the program by the words of its command line.
pub fn main() -> ExitCode {
    quiet_decoder();
    let (cli, line) = match Line::parse(std::env::args_os().collect()) {
        Ok(parsed) => parsed,
        Err(error) => {
            Report::new(Verbosity::Normal).error(&error);
            return exit_code(&error);
        }
    };
    let report = Report::new(cli.global.verbosity());
    match run(&cli, &line, &report) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            report.error(&error);
            exit_code(&error)
        }
    }
}

/// What `surfel view` with these words, the first of which is the program's name, gives its server.
pub fn studio(words: Vec<OsString>) -> anyhow::Result<Arc<dyn Studio>> {
    let (cli, line) = Line::parse(words)?;
    view::open_studio(line, &cli.global, &Report::new(Verbosity::Quiet))
}

fn exit_code(error: &anyhow::Error) -> ExitCode {
    ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
}

impl Cli {
    /// What is seen, of commands that show a scene.
    fn into_scene(self) -> Option<SceneArgs> {
        match self.command {
            Command::Render(args) => Some(args.scene),
            Command::Animate(args) => Some(args.scene),
            Command::View(args) => Some(args.with_all_columns()),
            _ => None,
        }
    }
}

fn run(cli: &Cli, line: &Line, report: &Report) -> anyhow::Result<()> {
    interrupt::listen(&report.cancellation())?;
    cli.global.start_threads()?;
    run_command(&cli.command, line, &cli.global, report)
}

fn run_command(
    command: &Command,
    line: &Line,
    global: &Global,
    report: &Report,
) -> anyhow::Result<()> {
    match command {
        Command::Render(args) => render::run(args, line, global, report),
        Command::Animate(args) => animate::run(args, line, global, report),
        Command::View(args) => view::run(args, line, global, report),
        Command::Info(args) => info::run(args, global, report),
        Command::Prepare(args) => prepare::run(args, global, report),
        Command::Demo(args) => demo::run(args, global, report),
        Command::Bench(args) => bench::run(args, global, report),
    }
}

/// The decoders of LAZ and EXR panic on bytes that no encoder writes. `surfel_formats` catches that and
/// returns an error that names the file; the panic's own message would only frighten.
fn quiet_decoder() {
    let default = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let is_decoder = |file: &str| file.contains("laz-") || file.contains("exr-");
        if !panic.location().is_some_and(|place| is_decoder(place.file())) {
            default(panic);
        }
    }));
}
