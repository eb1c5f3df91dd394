//! The options of a line as settings that may be changed: what a viewer works with.

use super::fields::Fields;
use super::line::{OF_OBJECTS, OF_PICTURES, command};
use super::options::{Known, is_in};
use super::{Line, Options};
use crate::Cli;
use crate::args::SceneArgs;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, CommandFactory};
use serde_json::{Map, Number, Value};
use std::ffi::OsString;
use std::path::Path;
use surfel::points::SURFACE_VARIATION;

/// Options beside those of surface, preparation and colour that decide what the trees hold.
const OF_TREES: [&str; 2] = ["material", "light"];

impl Line {
    /// All that was said about what is seen, as keys and values.
    pub fn settings(&self) -> Map<String, Value> {
        let command = scene_command();
        let is_known = |arg: &Arg| command.get_arguments().any(|known| known == arg);
        self.said(is_known).into_iter().collect()
    }

    /// What was said about surface, preparation and colour, as keys and values.
    pub fn given(&self) -> Vec<(String, Value)> {
        self.said(|arg| arg.get_help_heading().is_some_and(|name| OF_OBJECTS.contains(&name)))
    }

    fn said(&self, is_wanted: impl Fn(&Arg) -> bool) -> Vec<(String, Value)> {
        let Ok(matches) = command().try_get_matches_from(&self.words) else { return Vec::new() };
        let Some((name, given)) = matches.subcommand() else { return Vec::new() };
        let root = Cli::command();
        let args = root.find_subcommand(name).into_iter().flat_map(Command::get_arguments);
        let said = args.filter(|arg| is_wanted(arg)).filter(is_in(given));
        let pair = |arg: &Arg| Some((arg.get_long()?.replace('-', "_"), value(arg, given)?));
        said.filter_map(pair).collect()
    }

    /// The same files under these settings and no others.
    pub fn under(&self, settings: &Map<String, Value>) -> Result<(SceneArgs, Self), String> {
        let options = Options::read(Fields::new(String::new(), settings.clone()), Path::new(""))?;
        let command = scene_command();
        let known = Known { command: &command, others: &[], elsewhere: Vec::new() };
        let mut words: Vec<OsString> = ["surfel", "view"].map(OsString::from).into();
        words.extend(options.words(&known, None)?.into_iter().map(OsString::from));
        words.push("--".into());
        words.extend(self.inputs().map_err(|error| error.to_string())?);
        let mut line = self.clone();
        line.words = words;
        let args = line.scene_args().map_err(|error| format!("{error:#}"))?;
        Ok((args, line))
    }

    fn inputs(&self) -> anyhow::Result<impl Iterator<Item = OsString>> {
        Ok(self.scene_args()?.files.into_iter().map(OsString::from))
    }

    /// Options of a line made by `under` that differ from what they are by themselves.
    pub fn told(&self) -> Vec<String> {
        let command = scene_command();
        let is_default = |word: &String| {
            let pair = word.trim_start_matches('-').split_once('=');
            pair.is_some_and(|(name, value)| {
                let arg = command.get_arguments().find(|arg| arg.get_long() == Some(name));
                arg.is_some_and(|arg| arg.get_default_values().iter().any(|known| known == value))
            })
        };
        self.option_words().filter(|word| !is_default(word)).collect()
    }

    /// What decides how clouds are prepared.
    pub fn preparation_key(&self) -> String {
        self.key(|heading, name, value| {
            // One column is made by the preparation, and only where it is asked for.
            let is_made = name == "color" && value == SURFACE_VARIATION;
            heading == "Preparation" || name == "seed" || is_made
        })
    }

    /// What decides what the trees hold; all else can change without building them anew.
    pub fn tree_key(&self) -> String {
        self.key(|heading, name, _| {
            let is_of_objects = OF_OBJECTS.contains(&heading) && !OF_PICTURES.contains(&name);
            is_of_objects || OF_TREES.contains(&name)
        })
    }

    /// The options that decide, by their heading, name and value. What objects say of themselves stays.
    fn key(&self, decides: impl Fn(&str, &str, &str) -> bool) -> String {
        let command = scene_command();
        let is_meant = |word: &String| {
            let word = word.trim_start_matches('-');
            let (name, value) = word.split_once('=').unwrap_or((word, ""));
            let arg = command.get_arguments().find(|arg| arg.get_long() == Some(name));
            decides(arg.and_then(Arg::get_help_heading).unwrap_or_default(), name, value)
        };
        self.option_words().filter(is_meant).collect::<Vec<_>>().join("\n")
    }

    fn option_words(&self) -> impl Iterator<Item = String> {
        let options = self.words.iter().skip(2).take_while(|word| *word != "--");
        options.map(|word| word.to_string_lossy().into_owned())
    }
}

/// One with the options that say what is seen.
fn scene_command() -> Command {
    SceneArgs::augment_args(Command::new("scene"))
}

/// What was said of an option.
fn value(arg: &Arg, given: &ArgMatches) -> Option<Value> {
    if matches!(arg.get_action(), ArgAction::SetTrue) {
        return Some(Value::Bool(true));
    }
    let words: Vec<String> = given
        .get_raw(arg.get_id().as_str())?
        .map(|word| word.to_string_lossy().into_owned())
        .collect();
    let is_list = matches!(arg.get_action(), ArgAction::Append);
    match words.last() {
        // One that may stand without a value.
        None => Some(Value::Bool(true)),
        Some(_) if is_list => Some(words.into()),
        Some(last) => Some(as_in_a_file(last)),
    }
}

/// Numbers and lists of them as a scene file has them; everything else as it was typed.
fn as_in_a_file(word: &str) -> Value {
    let numbers: Option<Vec<Value>> = word.split(',').map(number).collect();
    match numbers {
        Some(mut only) if only.len() == 1 => only.remove(0),
        Some(several) => Value::Array(several),
        None => Value::String(word.to_owned()),
    }
}

fn number(text: &str) -> Option<Value> {
    let text = text.trim();
    let usual = serde_json::from_str::<Number>(text).ok();
    // As in `.5`; `inf` and `nan`, which JSON does not know, stay words.
    let short = || text.parse().ok().and_then(Number::from_f64);
    usual.or_else(short).map(Value::Number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn words_are_typed_as_in_scene_files() {
        for (word, value) in [
            ("2", json!(2)),
            (".5", json!(0.5)),
            ("147,152.5", json!([147, 152.5])),
            ("562316.125,4183187.5,0,0,0,-1", json!([562316.125, 4183187.5, 0, 0, 0, -1])),
            ("inf", json!("inf")),
            ("", json!("")),
            ("#102030", json!("#102030")),
            ("([0,1],[2,3])", json!("([0,1],[2,3])")),
        ] {
            assert_eq!(as_in_a_file(word), value, "{word}");
        }
    }
}
