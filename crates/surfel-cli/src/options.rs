//! Options from keys: each key of a scene description is an option of the commands that it concerns.

use clap::builder::ArgAction;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use serde_json::Value;
use std::marker::PhantomData;
use std::path::Path;
use surfel::SceneDescription;
use surfel::description::{Invalid, Key, option_name};

/// The keys that are options of a command.
pub trait Scope {
    /// Returns true if the command has the option of this key.
    fn has(path: &str) -> bool;
}

/// The options of a scope that the command line gives, by the paths of their keys.
#[derive(Clone, Debug)]
pub struct KeyOptions<S> {
    values: Vec<(String, Value)>,
    scope: PhantomData<S>,
}

impl<S: Scope> KeyOptions<S> {
    /// Returns a description in which the options are set, and nothing else.
    ///
    /// # Errors
    ///
    /// Fails with the path of the first value that is not valid.
    pub fn description(&self) -> Result<SceneDescription, Invalid> {
        let mut description = SceneDescription::default();
        for (path, value) in &self.values {
            description.set(path, value, Path::new(""))?;
        }
        description.check()?;
        Ok(description)
    }
}

/// Keys whose options `-h` shows; `--help` shows all.
const COMMON: [&str; 13] = [
    "resolution",
    "spp",
    "background",
    "surface",
    "radius",
    "camera.position",
    "camera.focal_point",
    "camera.azimuth_angle",
    "up",
    "light",
    "sun.azimuth",
    "color",
    "material",
];

/// The key of materials, which is no field of a part.
const MATERIAL: Key = Key {
    name: "material",
    doc: "Material: matte, metal, mirror, glass, plastic, emissive or unlit, for everything or for one file or object,\n\
          as in statue.ply=glass. Properties may follow: glass:ior=1.33,color=#88ccff. May be given several times.",
    value_name: "[FILE=]NAME",
    default: None,
};

/// The keys of a scope with their paths and headings.
fn keys<S: Scope>() -> Vec<(String, &'static str, Key)> {
    let description = SceneDescription::default();
    let parts = description.parts();
    let keys = parts.iter().flat_map(|part| {
        let keys = part.settings.keys().into_iter();
        keys.map(|key| (format!("{}{}", part.prefix, key.name), part.heading, key))
    });
    let all = keys.chain([("material".to_owned(), "Materials", MATERIAL)]);
    all.filter(|(path, ..)| S::has(path)).collect()
}

fn option(path: &str, heading: &'static str, key: &Key) -> Arg {
    let doc = key.doc.split_whitespace().collect::<Vec<_>>().join(" ");
    let default = match &key.default {
        Some(Value::Bool(false)) | None => String::new(),
        Some(default) => format!(" [default: {}]", value_text(default)),
    };
    let short = doc.split_once(". ").map_or(doc.as_str(), |(first, _)| first);
    let arg = Arg::new(path.to_owned())
        .long(option_name(path))
        .help_heading(heading)
        .help(format!("{}{default}", short.trim_end_matches('.')))
        .long_help(format!("{doc}{default}"))
        .hide_short_help(!COMMON.contains(&path))
        .action(if path == MATERIAL.name { ArgAction::Append } else { ArgAction::Set });
    let arg = if path == "threads" { arg.short('t') } else { arg };
    match key.value_name {
        "" | "BOOL" => {
            let arg = arg.value_name("BOOL").num_args(0..=1).require_equals(true);
            arg.default_missing_value("true")
        }
        "HEIGHT" => arg.value_name("HEIGHT").num_args(0..=1).default_missing_value("true"),
        name => arg
            .value_name(name)
            .allow_hyphen_values(name.contains(',') || ["AXIS", "BOUNDS"].contains(&name)),
    }
}

/// Writes a value as it is typed.
pub fn value_text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(value_text).collect::<Vec<_>>().join(","),
        Value::Number(number) => number
            .as_f64()
            .filter(|x| x.fract() == 0.0 && x.abs() < 1e15)
            .map_or_else(|| number.to_string(), |x| format!("{x:.0}")),
        other => other.to_string(),
    }
}

/// Writes keys and values as words of a command line.
pub fn words(values: &[(String, Value)]) -> Vec<String> {
    let words = values.iter().flat_map(|(path, value)| {
        let option = option_name(path);
        match value {
            Value::Bool(true) => vec![format!("--{option}")],
            Value::Array(list) if path == MATERIAL.name => {
                list.iter().map(|value| format!("--{option}={}", value_text(value))).collect()
            }
            value => vec![format!("--{option}={}", value_text(value))],
        }
    });
    words.collect()
}

impl<S: Scope> Args for KeyOptions<S> {
    fn augment_args(command: Command) -> Command {
        keys::<S>().iter().fold(command, |command, (path, heading, key)| {
            let is_global = *heading == "Everywhere";
            command.arg(option(path, heading, key).global(is_global))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<S: Scope> FromArgMatches for KeyOptions<S> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let known: Vec<String> = matches.ids().map(ToString::to_string).collect();
        let is_given = |path: &str| {
            known.iter().any(|id| id == path)
                && matches.value_source(path) == Some(ValueSource::CommandLine)
        };
        let given = keys::<S>().into_iter().filter(|(path, ..)| is_given(path));
        let values = given.map(|(path, ..)| {
            let mut words = matches.get_many::<String>(&path).into_iter().flatten().cloned();
            let value = match path == MATERIAL.name {
                true => words.map(Value::String).collect(),
                false => as_value(words.next_back().unwrap_or_default()),
            };
            (path, value)
        });
        Ok(Self { values: values.collect(), scope: PhantomData })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// A flag without a value is true; everything else is text.
fn as_value(word: String) -> Value {
    match word.as_str() {
        "true" => Value::Bool(true),
        "false" => Value::Bool(false),
        _ => Value::String(word),
    }
}

/// Defines a scope by the keys that it leaves out of all, or by the headings that it has.
macro_rules! scopes {
    ($( $(#[$meta:meta])* $name:ident: $has:expr; )*) => { $(
        $(#[$meta])*
        #[derive(Clone, Debug)]
        pub struct $name;

        impl Scope for $name {
            fn has(path: &str) -> bool {
                let has: fn(&str) -> bool = $has;
                has(path)
            }
        }
    )* };
}

scopes! {
    /// Options of all commands: threads, memory, device.
    RunScope: |path| ["threads", "memory_limit", "backend"].contains(&path);
    /// Options of a picture.
    RenderScope: |path| is_of_scene(path) && !["frames", "fps", "turntable"].contains(&path);
    /// Options of a movie.
    AnimateScope: |path| is_of_scene(path) && path != "time";
    /// Options of the viewer.
    ViewScope: |path| is_of_scene(path) && !is_of_output(path);
    /// Options of prepared clouds.
    PrepareScope: |path| (is_of_points(path) && path != "vertices") || path == "seed";
    /// Options of the benchmark.
    BenchScope: |path| {
        let is_of_camera = path.starts_with("camera.") && !["camera.name", "camera.lock"].contains(&path);
        let is_of_surface = ["surface", "edge_test", "radius_scale", "up"].contains(&path);
        is_of_points(path) || is_of_camera || is_of_surface
    };
}

fn is_of_scene(path: &str) -> bool {
    !RunScope::has(path) && path != "output"
}

fn is_of_output(path: &str) -> bool {
    ["output", "time", "frames", "fps", "turntable"].contains(&path)
}

/// Whether the key decides how points are prepared.
fn is_of_points(path: &str) -> bool {
    let description = SceneDescription::default();
    let [_, preparation, _] = description.objects_default.parts();
    path != "animation_name" && preparation.settings.keys().iter().any(|key| key.name == path)
}

#[cfg(test)]
mod tests {
    //! Words of a command line become values, and values words.

    use super::*;
    use serde_json::json;

    fn parse(words: &[&str]) -> KeyOptions<RenderScope> {
        let command =
            KeyOptions::<RenderScope>::augment_args(Command::new("test").no_binary_name(true));
        KeyOptions::from_arg_matches(&command.get_matches_from(words)).unwrap()
    }

    #[test]
    fn words_set_keys() {
        let words = [
            "--camera-position",
            "-1,2,3",
            "--camera-orthographic",
            "--spp",
            "7",
            "--vertices",
            "--material",
            "mirror",
            "--material=a.ply=glass",
        ];
        let description = parse(&words).description().unwrap();
        assert_eq!(description.camera.position.map(|p| p.to_array()), Some([-1.0, 2.0, 3.0]));
        assert_eq!(description.get("camera.orthographic"), Some(json!(true)));
        assert_eq!((description.picture.spp(), description.materials.len()), (7, 2));
        assert_eq!(description.objects_default.preparation.vertices, Some(true));
    }

    #[test]
    fn values_that_are_written_as_words_read_back_equal() {
        let description = SceneDescription::parse(
            "spp = 7\nrange = [-1, 2.5]\nvertices = true\nmaterial = [\"mirror\", \"a=glass:ior=1.3\"]\n\
             [camera]\nfocal-point = [1, 2, 3]\npanorama = true",
            false,
            Path::new(""),
        );
        let description = description.unwrap();
        let words = words(&description.non_default());
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        assert_eq!(parse(&words).description().unwrap(), description);
    }
}
