//! The command line together with the options of a scene file: one set of options, parsed in one place.

use super::{Options, SceneFile, is_scene_file};
use crate::Cli;
use crate::args::{SceneArgs, Usage};
use clap::error::ErrorKind;
use clap::{ArgMatches, Command, CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::path::PathBuf;

/// The words that were parsed, those of the scene file among them.
pub struct Line {
    words: Vec<OsString>,
    /// Of the scene files named.
    pub scene: SceneFile,
}

/// Groups of options that an object may have for itself.
const OF_OBJECTS: [&str; 3] = ["Surface", "Preparation", "Colour"];
/// Those of them that belong to the picture all the same.
const OF_PICTURES: [&str; 2] = ["background", "no-background"];

impl Line {
    /// Parses the program's own words, the first of which is its name. Options of scene files count where
    /// the command line says nothing.
    pub fn parse(mut words: Vec<OsString>) -> anyhow::Result<(Cli, Self)> {
        let matches = command().get_matches_from(&words);
        let mut scene = SceneFile::default();
        if let Some((name, given)) = matches.subcommand()
            && let Ok(Some(files)) = given.try_get_many::<PathBuf>("files")
        {
            let after_name = 1 + words.iter().position(|word| word == name).unwrap_or(0);
            let mut added = Vec::new();
            for file in files.filter(|file| is_scene_file(file)) {
                let read = SceneFile::read(file)?;
                added.extend(
                    option_words(&read.options, name, given)
                        .map_err(|error| Usage(format!("{}: {error}", file.display())))?,
                );
                scene.append(read);
            }
            words.splice(after_name..after_name, added.into_iter().map(OsString::from));
        }
        let line = Self { words, scene };
        let cli = line.cli(&[])?;
        Ok((cli, line))
    }

    /// The scene's options with those of one object put over them.
    pub fn for_object(&self, name: &str, options: &Options) -> anyhow::Result<SceneArgs> {
        let wrong = |error: String| Usage(format!("object `{name}`: {error}"));
        let command = of_objects();
        let words = options.words(&command, None).map_err(wrong)?;
        Ok(self.cli(&words)?.into_scene().ok_or_else(|| wrong("no scene".into()))?)
    }

    fn cli(&self, more: &[String]) -> anyhow::Result<Cli> {
        let words = self.words.iter().cloned().chain(more.iter().map(OsString::from));
        let parsed = command().try_get_matches_from(words).and_then(|m| Cli::from_arg_matches(&m));
        parsed.map_err(|error| {
            if self.scene.is_empty() || error.kind() == ErrorKind::DisplayHelp {
                error.exit();
            }
            let text = error.to_string();
            let text = text.trim_start_matches("error: ");
            let text = text.split("\n\nUsage").next().unwrap_or(text);
            let text: Vec<&str> = text.split_whitespace().collect();
            Usage(format!("the options of the scene file and the command line: {}", text.join(" ")))
                .into()
        })
    }
}

/// The last of several values counts: those of the command line stand behind those of files.
fn command() -> Command {
    let overriding = |command: Command| command.args_override_self(true);
    overriding(Cli::command()).mut_subcommands(overriding)
}

/// One with the options that objects may have.
fn of_objects() -> Command {
    let render = Cli::command().find_subcommand("render").cloned().unwrap_or_default();
    let is_of_object = |arg: &&clap::Arg| {
        arg.get_help_heading().is_some_and(|heading| OF_OBJECTS.contains(&heading))
            && arg.get_long().is_some_and(|long| !OF_PICTURES.contains(&long))
    };
    let args: Vec<clap::Arg> = render.get_arguments().filter(is_of_object).cloned().collect();
    Command::new("object").args(args)
}

fn option_words(options: &Options, name: &str, given: &ArgMatches) -> Result<Vec<String>, String> {
    let root = Cli::command();
    let Some(command) = root.find_subcommand(name) else { return Ok(Vec::new()) };
    // Threads and the like are the whole program's.
    let global: Vec<clap::Arg> = root.get_arguments().cloned().collect();
    options.words(&command.clone().args(global), Some(given))
}
