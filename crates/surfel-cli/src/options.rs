//! Options from keys: each key of a scene description is an option of the commands that it concerns.

use clap::builder::ArgAction;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use serde_json::Value;
use std::marker::PhantomData;
use std::path::Path;
use surfel::SceneDescription;
use surfel::description::rule::Arity;
use surfel::description::{Invalid, Key, Section, has_option, is_list, option_name, value_text};

/// Arguments of a command, some of which are keys of a scene description.
pub trait Scope {
    /// Returns true if the command has the option of a key, by the section and the path of the key.
    fn has(section: Section, path: &str) -> bool;
}

/// The options of a command that are keys.
#[derive(Clone, Debug)]
pub struct KeyOptions<S> {
    /// A description in which the options are set, and nothing else; or the first value that is not valid.
    pub description: Result<SceneDescription, Invalid>,
    scope: PhantomData<S>,
}

/// The keys of a scope with their paths and sections.
fn keys<S: Scope>() -> impl Iterator<Item = (String, Section, Key)> {
    let keys = SceneDescription::keys().into_iter();
    keys.filter(|(path, section, _)| has_option(path) && S::has(*section, path))
}

fn option(path: &str, section: Section, key: &Key) -> Arg {
    let doc = key.doc.split_whitespace().collect::<Vec<_>>().join(" ");
    let default = match &key.default {
        Some(Value::Bool(false)) | None => String::new(),
        Some(default) => format!(" [default: {}]", value_text(default)),
    };
    let short = doc.split_once(". ").map_or(doc.as_str(), |(first, _)| first);
    let arg = Arg::new(path.to_owned())
        .long(option_name(path))
        .short((path == "threads").then_some('t'))
        .global(section == Section::Everywhere)
        .help_heading(section.heading())
        .value_name(key.value_name)
        .allow_hyphen_values(key.may_begin_with_hyphen)
        .help(format!("{}{default}", short.trim_end_matches('.')))
        .long_help(format!("{doc}{default}"))
        .hide_short_help(!key.is_common)
        .action(if is_list(path) { ArgAction::Append } else { ArgAction::Set });
    match key.arity {
        Arity::One => arg,
        // A file may follow: a value needs an equals sign.
        Arity::Optional => arg.num_args(0..=1).require_equals(true).default_missing_value("true"),
    }
}

impl<S: Scope> Args for KeyOptions<S> {
    fn augment_args(command: Command) -> Command {
        command.args(keys::<S>().map(|(path, section, key)| option(&path, section, &key)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<S: Scope> FromArgMatches for KeyOptions<S> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let read = || {
            let mut description = SceneDescription::default();
            for (path, ..) in keys::<S>() {
                let Some(words) = matches.get_many::<String>(&path) else { continue };
                let mut values = words.cloned().map(Value::String);
                let value = match is_list(&path) {
                    true => values.collect(),
                    false => values.next_back().unwrap_or_default(),
                };
                description.set(&path, &value, Path::new(""))?;
            }
            description.check()?;
            Ok(description)
        };
        Ok(Self { description: read(), scope: PhantomData })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    //! Words of a command line become values, and values words.

    use super::*;
    use serde_json::json;

    struct AllKeys;

    impl Scope for AllKeys {
        fn has(_: Section, _: &str) -> bool {
            true
        }
    }

    fn parse<'w>(words: impl IntoIterator<Item = &'w str>) -> SceneDescription {
        let command =
            KeyOptions::<AllKeys>::augment_args(Command::new("test").no_binary_name(true));
        let matches = command.get_matches_from(words);
        KeyOptions::<AllKeys>::from_arg_matches(&matches).unwrap().description.unwrap()
    }

    #[test]
    fn words_set_keys() {
        let words = "--camera-position -1,2,3 --camera-orthographic --spp 7 --vertices \
                     --camera-panorama=false --material mirror --material=a.ply=glass";
        let description = parse(words.split_whitespace());
        assert_eq!(description.camera.position.map(|p| p.to_array()), Some([-1.0, 2.0, 3.0]));
        assert_eq!(description.get("camera.orthographic"), Some(json!(true)));
        assert_eq!(description.camera.panorama, Some(false));
        assert_eq!((description.picture.spp(), description.materials.choices().len()), (7, 2));
        assert_eq!(description.objects_default.preparation.vertices, Some(true));
        let high = parse(["--camera-orthographic=2.5"]);
        assert_eq!(high.get("camera.orthographic"), Some(json!(2.5)));
        let off = parse(["--camera-orthographic=false"]);
        assert_eq!(off.get("camera.orthographic"), Some(json!(false)));
    }

    #[test]
    fn values_may_begin_with_a_hyphen() {
        let words = "--crop -10,-10,10,10 --clip-box -1,-2,-3,1,2,3 --up -Y --range -5,5 --clip-plane -1,0,0,-1,0,0 \
                     --columns -,y,x,z --place -33.9,18.4 --camera-direction -1,0,0";
        let description = parse(words.split_whitespace());
        for key in [
            "crop",
            "clip_box",
            "up",
            "range",
            "clip_plane",
            "columns",
            "place",
            "camera.direction",
        ] {
            assert!(description.get(key).is_some(), "{key}");
        }
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
        assert_eq!(parse(description.to_options().iter().map(String::as_str)), description);
    }
}
