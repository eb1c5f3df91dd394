//! The program `surfel`: turns command lines into scene descriptions, calls the libraries, reports.
//!
//! It is a library so that its options and its viewer can be fuzzed; `main.rs` only calls [`main`].

mod usage;
mod stdin_copy;
mod report;
mod interrupt;
mod cleanup;
mod shell;
mod stats;
pub mod options;
mod tips;
mod inputs;
mod global;
mod scene_args;
mod output;
mod render;
mod cluster;
mod animate;
mod view;
mod info;
mod prepare;
mod gallery;
mod demo;
mod bench;
mod completions;
mod devices;

use clap::builder::Styles;
use clap::{Arg, Command as ClapCommand, CommandFactory, FromArgMatches, Parser, Subcommand};
use global::Global;
use report::{Report, Verbosity};
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
pub use surfel_web::FrameAncestors;
use surfel_web::{Limits, SceneProvider};
use usage::Usage;
pub use view::RunningViewer;

/// Turns point clouds into pictures and movies by ray tracing the points themselves, as a continuous surface,
/// together with meshes.
#[derive(Parser)]
#[command(name = "surfel", version, after_help = EXAMPLES, max_term_width = 100, styles = Styles::plain())]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    global: Global,
}

const EXAMPLES: &str = "\
Examples:
  surfel demo                            a ruin to try things on: demo.laz and demo.png, here
  surfel render scan.laz -o scan.png     a finished picture; every choice is shown and is an option
  surfel info scan.laz                   what a file holds
  surfel COMMAND -h                      the most used options of a command
  surfel COMMAND --help                  all options of a command";

#[derive(Subcommand)]
enum Command {
    /// Renders point clouds, meshes and scenes to a picture.
    Render(Box<render::Args>),
    /// Renders a movie of an animated scene, or of a turn around anything.
    Animate(Box<animate::Args>),
    /// Shows a scene, ray traced, in a browser.
    View(Box<view::Args>),
    /// Shows what a file holds.
    Info(Box<info::Args>),
    /// Cleans a cloud, adds normals and radii, and writes it to a file.
    Prepare(Box<prepare::Args>),
    /// Scans a ruin with a virtual scanner and renders it: something to begin with.
    Demo(demo::Args),
    /// Measures how many rays per second are traced.
    Bench(Box<bench::Args>),
    /// Lists the devices that can render.
    Devices(devices::Args),
    /// Prints completions for a shell.
    Completions(completions::Args),
    /// Prints the manual page.
    #[command(hide = true)]
    Man,
}

/// Runs the program by its command line.
pub fn main() -> ExitCode {
    ExitCode::from(run_program(std::env::args_os()))
}

/// Runs the program with these words, the first of which is its name; returns its exit code.
pub fn run_program(words: impl IntoIterator<Item = OsString>) -> u8 {
    silence_decoder_panics();
    let cli = match parse(words) {
        Ok(cli) => cli,
        Err(error) => {
            // Nothing can be said about a closed stream.
            let _ = error.print();
            return error.exit_code() as u8;
        }
    };
    let report = Report::new(cli.global.verbosity());
    let result = run(&cli, &report);
    cleanup::remove_files();
    match result {
        Ok(()) => 0,
        Err(error) => {
            report.error(&error);
            exit_code(&error)
        }
    }
}

/// Returns the scene provider that `surfel view` with these words, the first of which is the program's name, gives to
/// its server.
///
/// # Errors
///
/// Fails for wrong options and for files that cannot be read.
pub fn scene_provider(words: Vec<OsString>) -> anyhow::Result<Arc<dyn SceneProvider>> {
    let cli = parse(words)?;
    let Command::View(args) = &cli.command else { anyhow::bail!("expected `surfel view`") };
    let report = Report::new(Verbosity::Quiet);
    let description = args.scene.description(&cli.global, &report)?;
    let files = args.scene.files.clone();
    Ok(view::open_scene_provider(description, files, Limits::default(), &report)?)
}

fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Cli, clap::Error> {
    let words: Vec<OsString> = words.into_iter().collect();
    let matches = command().try_get_matches_from(&words);
    Cli::from_arg_matches(&matches.map_err(|error| tips::with_tip(error, &words, &command()))?)
}

/// The last of several values counts, and numbers below zero are values, not options.
fn command() -> ClapCommand {
    let takes_numbers = |arg: Arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    };
    let lenient = |command: ClapCommand| command.args_override_self(true).mut_args(takes_numbers);
    lenient(Cli::command()).mut_subcommands(lenient)
}

fn exit_code(error: &anyhow::Error) -> u8 {
    let is_cancelled = error.chain().any(|cause| {
        cause.downcast_ref().is_some_and(surfel::Error::is_cancelled)
            || cause.downcast_ref().is_some_and(surfel_formats::Error::is_cancelled)
            || cause.downcast_ref() == Some(&surfel_core::Error::Cancelled)
    });
    if is_cancelled {
        return interrupt::exit_code();
    }
    let is_invalid = |cause: &(dyn std::error::Error + 'static)| {
        cause.is::<Usage>()
            || cause.is::<surfel::description::Invalid>()
            || matches!(cause.downcast_ref(), Some(surfel::Error::Invalid(_)))
    };
    if error.chain().any(is_invalid) { 2 } else { 1 }
}

fn run(cli: &Cli, report: &Report) -> anyhow::Result<()> {
    interrupt::listen(&report.cancellation())?;
    let global = &cli.global;
    match &cli.command {
        Command::Render(args) => render::run(args, global, report),
        Command::Animate(args) => animate::run(args, global, report),
        Command::View(args) => view::run(args, global, report),
        Command::Info(args) => info::run(args, global, report),
        Command::Prepare(args) => prepare::run(args, global, report),
        Command::Demo(args) => demo::run(args, global, report),
        Command::Bench(args) => bench::run(args, global, report),
        Command::Devices(args) => devices::run(args),
        Command::Completions(args) => completions::run(args, command()),
        Command::Man => completions::man(command()),
    }
}

/// Silences panics of the decoders of LAZ and EXR, which panic on bytes that no encoder writes. `surfel_formats`
/// returns an error that names the file instead.
pub fn silence_decoder_panics() {
    let default = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let is_decoder = |file: &str| file.contains("laz-") || file.contains("exr-");
        if !panic.location().is_some_and(|location| is_decoder(location.file())) {
            default(panic);
        }
    }));
}

#[cfg(test)]
mod tests {
    //! Exit codes follow from errors.

    use super::*;

    #[test]
    fn cancelled_work_of_every_library_has_the_code_of_the_signal() {
        let cancelled = || surfel_core::Error::Cancelled;
        let file = || surfel_formats::Error::from(cancelled());
        let errors: [anyhow::Error; 4] = [
            cancelled().into(),
            file().into(),
            surfel::Error::File(file()).into(),
            anyhow::Error::from(file()).context("demo.laz"),
        ];
        assert_eq!(errors.map(|error| exit_code(&error)), [130; 4]);
        assert_eq!(exit_code(&surfel_formats::Error::NoInput.into()), 1);
    }
}
