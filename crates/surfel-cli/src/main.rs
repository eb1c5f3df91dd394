//! The program `surfel`: parses the command line, calls the libraries, reports.

mod args;
mod assemble;
mod bench;
mod demo;
mod dry_run;
mod exposure;
mod info;
mod interrupt;
mod light;
mod memory;
mod picture;
mod prepare;
mod render;
mod report;
mod stats;

use args::{Global, Usage};
use clap::{Parser, Subcommand};
use report::Report;
use std::process::ExitCode;

/// Turns point clouds into pictures by ray tracing the points themselves, as a continuous surface.
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
    /// Render point clouds to a picture.
    Render(Box<render::Args>),
    /// Tell what is in a file.
    Info(info::Args),
    /// Clean a cloud, add normals and radii, write it to a file.
    Prepare(prepare::Args),
    /// Scan a ruin with a virtual scanner and render it: something to begin with.
    Demo(demo::Args),
    /// Measure how many rays a second are traced.
    Bench(Box<bench::Args>),
}

fn main() -> ExitCode {
    quiet_decoder();
    let cli = Cli::parse();
    let report = Report::new(cli.global.verbosity());
    match run(&cli, &report) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            report.error(&error);
            ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
        }
    }
}

fn run(cli: &Cli, report: &Report) -> anyhow::Result<()> {
    interrupt::listen(&report.cancellation())?;
    cli.global.start_threads()?;
    match &cli.command {
        Command::Render(args) => render::run(args, &cli.global, report),
        Command::Info(args) => info::run(args, report),
        Command::Prepare(args) => prepare::run(args, &cli.global, report),
        Command::Demo(args) => demo::run(args, &cli.global, report),
        Command::Bench(args) => bench::run(args, &cli.global, report),
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
