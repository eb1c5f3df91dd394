//! Options of the command line as keys: `spp = 16`, or `[camera]` with `position` in it.

use super::beside;
use super::fields::{Fields, nearest};
use clap::builder::ArgAction;
use clap::{Arg, ArgMatches, Command};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// Options by their long names, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    values: Vec<(String, Value)>,
    folder: PathBuf,
}

/// Options that name files to read.
const FILES: [&str; 1] = ["environment"];

impl Options {
    pub fn read(mut fields: Fields, folder: &Path) -> Result<Self, String> {
        let mut values = Vec::new();
        flatten("", fields.rest(), &mut values)?;
        Ok(Self { values, folder: folder.to_owned() })
    }

    /// As words that `command` parses, but for those that `given` says otherwise, or that do not go with
    /// what it says.
    pub fn words(
        &self,
        command: &Command,
        given: Option<&ArgMatches>,
    ) -> Result<Vec<String>, String> {
        let is_given = |arg: &Arg| {
            let source = given.and_then(|given| given.value_source(arg.get_id().as_str()));
            source == Some(clap::parser::ValueSource::CommandLine)
        };
        let mut words = Vec::new();
        for (key, value) in &self.values {
            let arg = find(command, key)?;
            let conflicting = command.get_arg_conflicts_with(arg);
            if is_given(arg) || conflicting.into_iter().any(is_given) {
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
        let takes_none = matches!(arg.get_action(), ArgAction::SetTrue | ArgAction::Count)
            || arg.get_num_args().is_some_and(|range| range.min_values() == 0);
        let several =
            matches!(arg.get_action(), ArgAction::Append) && arg.get_value_delimiter().is_none();
        match value {
            Value::Bool(true) if takes_none => words.push(format!("--{key}")),
            Value::Bool(false) if takes_none => {}
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

fn find<'c>(command: &'c Command, key: &str) -> Result<&'c Arg, String> {
    let known = || command.get_arguments().filter(|arg| arg.get_long().is_some());
    let found = known().find(|arg| arg.get_long() == Some(key));
    found.ok_or_else(|| {
        let tables = match command.get_name() {
            "object" => &super::object::KEYS[..],
            _ => &["object", "lamp", "animation"],
        };
        let names = known().filter_map(Arg::get_long).chain(tables.iter().copied());
        format!("unknown key `{key}`{}", nearest(key, names))
    })
}

fn text(value: &Value, key: &str) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Number(number) => Ok(number.to_string()),
        Value::Bool(flag) => Ok(flag.to_string()),
        other => Err(format!("{key}: found {other}, expected a text, a number or true")),
    }
}
