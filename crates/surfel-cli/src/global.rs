//! Options of all commands: messages, threads, memory, device.

use crate::options::{KeyOptions, Scope};
use crate::report::Verbosity;
use clap::Args;
use surfel::description::{Backend, RunSettings, Section};
use surfel::{SceneRenderer, start_global_threads};

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
        start_global_threads(&settings)?;
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
