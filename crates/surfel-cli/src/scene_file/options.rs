//! Options of the command line as keys: `spp = 16`, or `[camera]` with `position` in it.

use super::beside;
use super::fields::{Fields, nearest};
use clap::builder::ArgAction;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};
use serde_json::{Map, Value};
use std::any::TypeId;
use std::path::{Path, PathBuf};

/// Options by their long names, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    values: Vec<(String, Value)>,
    folder: PathBuf,
}

/// What keys may mean to a command.
pub struct Known<'c> {
    pub command: &'c Command,
    /// Keys that are no options, for messages.
    pub others: &'c [&'c str],
    /// Commands whose own options are no mistake here, but mean nothing.
    pub elsewhere: Vec<&'c Command>,
}

/// Options that name files to read.
const FILES: [&str; 1] = ["environment"];

impl Options {
    pub fn read(mut fields: Fields, folder: &Path) -> Result<Self, String> {
        let mut values = Vec::new();
        flatten("", fields.rest(), &mut values)?;
        Ok(Self { values, folder: folder.to_owned() })
    }

    /// As words that the command parses, but for those that `given` says otherwise, or that do not go with
    /// what it says.
    pub fn words(&self, known: &Known, given: Option<&ArgMatches>) -> Result<Vec<String>, String> {
        let command = known.command;
        let given: Vec<&Arg> = given
            .map_or(Vec::new(), |given| command.get_arguments().filter(is_in(given)).collect());
        // Of two options that do not go together, one says so.
        let excludes = |a: &Arg, b: &Arg| command.get_arg_conflicts_with(a).contains(&b);
        let mut words = Vec::new();
        for (key, value) in &self.values {
            let Some(arg) = find(known, key)? else { continue };
            let is_overruled =
                |other: &&Arg| *other == arg || excludes(arg, other) || excludes(other, arg);
            if given.iter().any(is_overruled) {
                continue;
            }
            self.add_words(arg, key, value, &mut words)?;
        }
        Ok(words)
    }

    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    pub fn append(&mut self, other: Self) {
        self.values.extend(other.values);
    }

    fn add_words(
        &self,
        arg: &Arg,
        key: &str,
        value: &Value,
        words: &mut Vec<String>,
    ) -> Result<(), String> {
        let is_flag = matches!(arg.get_action(), ArgAction::SetTrue | ArgAction::Count);
        let may_be_bare = arg.get_num_args().is_some_and(|range| range.min_values() == 0);
        let takes_none = is_flag || (may_be_bare && !takes_bool(arg));
        let several =
            matches!(arg.get_action(), ArgAction::Append) && arg.get_value_delimiter().is_none();
        match value {
            Value::Bool(true) if takes_none => words.push(format!("--{key}")),
            Value::Bool(false) if takes_none => {}
            other if is_flag => {
                return Err(format!("{key}: found {other}, expected true or false"));
            }
            Value::Array(values) if several => {
                for value in values {
                    words.push(format!("--{key}={}", text(value, key)?));
                }
            }
            Value::Array(values) => {
                let values: Result<Vec<String>, String> =
                    values.iter().map(|value| text(value, key)).collect();
                words.push(format!("--{key}={}", values?.join(",")));
            }
            value if FILES.contains(&key) => {
                words.push(format!(
                    "--{key}={}",
                    beside(&self.folder, &text(value, key)?).display()
                ));
            }
            value => words.push(format!("--{key}={}", text(value, key)?)),
        }
        Ok(())
    }
}

/// Whether `=false` switches an option off that is on elsewhere.
fn takes_bool(arg: &Arg) -> bool {
    arg.get_value_parser().type_id() == TypeId::of::<bool>()
}

/// Tables in tables are one name: `[camera] position` is `camera-position`.
fn flatten(
    prefix: &str,
    map: Map<String, Value>,
    values: &mut Vec<(String, Value)>,
) -> Result<(), String> {
    for (key, value) in map {
        let key = format!("{prefix}{}", key.replace('_', "-"));
        match value {
            Value::Object(inner) => flatten(&format!("{key}-"), inner, values)?,
            Value::Null => {}
            value => values.push((key, value)),
        }
    }
    Ok(())
}

/// Whether the words that were parsed say something about an option.
pub fn is_in(given: &ArgMatches) -> impl Fn(&&Arg) -> bool {
    // Asked of an option that the command has not, clap would panic.
    let known: Vec<&clap::Id> = given.ids().collect();
    move |arg| {
        let source = || given.value_source(arg.get_id().as_str());
        known.contains(&arg.get_id()) && source() == Some(ValueSource::CommandLine)
    }
}

/// None for what means nothing here.
fn find<'c>(known: &Known<'c>, key: &str) -> Result<Option<&'c Arg>, String> {
    let is_asked_for = |arg: &&Arg| arg.get_long() == Some(key);
    if let Some(arg) = known.command.get_arguments().find(is_asked_for) {
        return Ok(Some(arg));
    }
    if known.elsewhere.iter().any(|command| command.get_arguments().any(|arg| is_asked_for(&arg))) {
        return Ok(None);
    }
    let options = known.command.get_arguments().filter_map(Arg::get_long);
    Err(format!("unknown key `{key}`{}", nearest(key, options.chain(known.others.iter().copied()))))
}

fn text(value: &Value, key: &str) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Number(number) => Ok(number.to_string()),
        Value::Bool(flag) => Ok(flag.to_string()),
        other => Err(format!("{key}: found {other}, expected a text, a number or true")),
    }
}
