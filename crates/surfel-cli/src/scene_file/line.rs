//! The command line together with the options of a scene file: one set of options, parsed in one place.

use super::options::Known;
use super::{Options, SceneFile, TABLES, is_scene_file, object};
use crate::Cli;
use crate::args::{SceneArgs, Usage};
use crate::assemble::name_files;
use clap::error::ErrorKind;
use clap::{Arg, ArgMatches, Command, CommandFactory, FromArgMatches, Id};
use std::ffi::OsString;
use std::path::PathBuf;

/// The words that were parsed, those of the scene file among them.
#[derive(Clone)]
pub struct Line {
    pub(super) words: Vec<OsString>,
    files: Vec<PathBuf>,
    /// Of the scene files named.
    pub scene: SceneFile,
}

/// Groups of options that an object may have for itself.
pub(super) const OF_OBJECTS: [&str; 3] = ["Surface", "Preparation", "Colour"];
/// Commands that show scenes.
const OF_SCENES: [&str; 3] = ["render", "animate", "view"];
/// Those of them that belong to the picture all the same.
pub(super) const OF_PICTURES: [&str; 2] = ["background", "no-background"];

impl Line {
    /// Parses the program's own words, the first of which is its name. Options of scene files count where
    /// the command line says nothing.
    pub fn parse(mut words: Vec<OsString>) -> anyhow::Result<(Cli, Self)> {
        let matches = command().get_matches_from(&words);
        let mut scene = SceneFile::default();
        let mut scene_files = Vec::new();
        if let Some((name, given)) =
            matches.subcommand().filter(|(name, _)| OF_SCENES.contains(name))
        {
            let mut added = Vec::new();
            let files = given.get_many::<PathBuf>("files").into_iter().flatten();
            for file in files.filter(|file| is_scene_file(file)) {
                let read = SceneFile::read(file)?;
                let wrong = |error: String| Usage(format!("{}: {error}", file.display()));
                check_objects(&read).map_err(wrong)?;
                added.extend(option_words(&read.options, name, given).map_err(wrong)?);
                scene.append(read);
                scene_files.push(file.clone());
            }
            let place = place_of_options(&words, name);
            words.splice(place..place, added.into_iter().map(OsString::from));
            let wrong = |error| Usage(format!("{}: {error}", name_files(&scene_files)));
            if 1 < scene_files.len() {
                scene.check_names().map_err(wrong)?;
            }
        }
        let line = Self { words, files: scene_files, scene };
        let cli = line.cli()?;
        for object in line.scene.objects.iter().filter(|object| !object.options.is_empty()) {
            line.for_object(&object.name, &object.options)?;
        }
        Ok((cli, line))
    }

    /// The scene's options with those of one object put over them.
    pub fn for_object(&self, name: &str, options: &Options) -> anyhow::Result<SceneArgs> {
        let wrong = |error: String| Usage(format!("{}: object `{name}`: {error}", self.names()));
        let of_objects = of_objects();
        let words = options.words(&known_to_objects(&of_objects), None).map_err(wrong)?;
        let alone = of_objects.clone().no_binary_name(true).try_get_matches_from(&words);
        alone.map_err(|error| wrong(short(&error)))?;
        let command = overruled_by(&of_objects, command());
        let cli = self.parsed(command, &words).map_err(|error| wrong(short(&error)))?;
        Ok(cli.into_scene().ok_or_else(|| wrong("no scene".into()))?)
    }

    /// What is seen, as the words say.
    pub fn scene_args(&self) -> anyhow::Result<SceneArgs> {
        let cli = self.parsed(command(), &[]).map_err(|error| Usage(short(&error)))?;
        Ok(cli.into_scene().ok_or_else(|| Usage("no scene".into()))?)
    }

    fn cli(&self) -> anyhow::Result<Cli> {
        self.parsed(command(), &[]).map_err(|error| {
            if self.files.is_empty() || error.kind() == ErrorKind::DisplayHelp {
                error.exit();
            }
            // The command line alone was right: it is the file's, or does not go with it.
            Usage(format!("{}: {}", self.names(), short(&error))).into()
        })
    }

    fn parsed(&self, command: Command, more: &[String]) -> Result<Cli, clap::Error> {
        let mut words = self.words.clone();
        // Behind all other options; what follows `--` is files.
        let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
        words.splice(end..end, more.iter().map(OsString::from));
        Cli::from_arg_matches(&command.try_get_matches_from(words)?)
    }

    fn names(&self) -> String {
        name_files(&self.files)
    }
}

/// Where options of scene files go: behind the command and files, before what begins with a dash. Right
/// before a file, an option whose value may be left out would take it for its value.
fn place_of_options(words: &[OsString], name: &str) -> usize {
    let after_name = 1 + words.iter().position(|word| word == name).unwrap_or(0);
    let is_option = |word: &OsString| word != "-" && word.as_encoded_bytes().starts_with(b"-");
    let first = words[after_name..].iter().position(is_option);
    first.map_or(words.len(), |first| after_name + first)
}

/// What clap says, in one line and without advice on the command line.
fn short(error: &clap::Error) -> String {
    let text = error.to_string();
    let text = text.trim_start_matches("error: ");
    let text = ["\n\nUsage", "\n\nFor more"]
        .iter()
        .fold(text, |text, end| text.split(end).next().unwrap_or(text));
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Fails at the first key of an object that is none.
fn check_objects(scene: &SceneFile) -> Result<(), String> {
    let command = of_objects();
    for (object_idx, object) in scene.objects.iter().enumerate() {
        let words = object.options.words(&known_to_objects(&command), None);
        words.map_err(|error| format!("object {}: {error}", object_idx + 1))?;
    }
    Ok(())
}

fn known_to_objects(command: &Command) -> Known<'_> {
    Known { command, others: &object::KEYS, elsewhere: Vec::new() }
}

/// The last of several values counts: those of the command line stand behind those of files. Numbers below zero
/// are values, not options: who does not want any says what is expected.
pub(super) fn command() -> Command {
    let taking_numbers = |arg: Arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    };
    let ruled = |command: Command| command.args_override_self(true).mut_args(taking_numbers);
    ruled(Cli::command()).mut_subcommands(ruled)
}

/// One in which of options that do not go together the last one counts, if objects may have them.
fn overruled_by(of_objects: &Command, command: Command) -> Command {
    let overriding = |mut command: Command| {
        for arg in of_objects.get_arguments() {
            let others = of_objects.get_arg_conflicts_with(arg).into_iter();
            let others: Vec<Id> = others.map(|other| other.get_id().clone()).collect();
            command = command.mut_arg(arg.get_id(), |arg| arg.overrides_with_all(others));
        }
        command
    };
    OF_SCENES.into_iter().fold(command, |command, name| command.mut_subcommand(name, overriding))
}

/// One with the options that objects may have.
fn of_objects() -> Command {
    let render = command().find_subcommand("render").cloned().unwrap_or_default();
    let is_of_object = |arg: &&Arg| {
        arg.get_help_heading().is_some_and(|heading| OF_OBJECTS.contains(&heading))
            && arg.get_long().is_some_and(|long| !OF_PICTURES.contains(&long))
    };
    let args: Vec<Arg> = render.get_arguments().filter(is_of_object).cloned().collect();
    Command::new("object").args(args)
}

fn option_words(options: &Options, name: &str, given: &ArgMatches) -> Result<Vec<String>, String> {
    let root = command();
    let Some(command) = root.find_subcommand(name) else { return Ok(Vec::new()) };
    // Threads and the like are the whole program's.
    let global: Vec<Arg> = root.get_arguments().cloned().collect();
    let elsewhere = OF_SCENES.iter().filter_map(|name| root.find_subcommand(name)).collect();
    let known = Known { command: &command.clone().args(global), others: &TABLES, elsewhere };
    options.words(&known, Some(given))
}
