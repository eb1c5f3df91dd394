//! Options of all commands: messages, threads, memory, device.

use crate::options::{KeyOptions, Scope};
use crate::report::Verbosity;
use anyhow::Context;
use clap::Args;
use surfel::SceneRenderer;
use surfel::description::{Backend, RunSettings, Section};

/// Options of all commands.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = Section::Everywhere.heading())]
pub struct Global {
    /// Shows nothing but errors.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Also shows how long each stage takes.
    #[arg(short, long, global = true, hide_short_help = true)]
    verbose: bool,
    /// Options of threads, memory and device.
    #[command(flatten)]
    pub run: KeyOptions<Self>,
}

impl Scope for Global {
    fn has(section: Section, _: &str) -> bool {
        section == Section::Everywhere
    }
}

impl Global {
    /// Returns how much is shown.
    pub fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        }
    }

    /// Starts the threads that the options ask for; returns the settings.
    pub fn start(&self) -> anyhow::Result<RunSettings> {
        let settings = self.run.description.clone()?.run;
        start_threads(&settings)?;
        Ok(settings)
    }
}

/// Fails if a GPU is demanded that is not there, before any file is read.
pub fn check_device(settings: &RunSettings) -> anyhow::Result<()> {
    if settings.chosen_backend() == Backend::Gpu {
        SceneRenderer::new(settings)?;
    }
    Ok(())
}

/// Starts the threads of all work to come.
pub fn start_threads(settings: &RunSettings) -> anyhow::Result<()> {
    let pool = rayon::ThreadPoolBuilder::new();
    pool.num_threads(settings.threads.unwrap_or(0) as usize)
        .build_global()
        .context("the threads cannot be started; ask for fewer with --threads")
}
