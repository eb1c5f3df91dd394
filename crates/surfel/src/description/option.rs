//! Options of the program: the name of a key's option, and a description as words of a command line.

use super::{SceneDescription, exclusive};
use serde_json::{Value, json};

/// Returns the name of the option for the path of a key: `camera-view-angle` for `camera.view_angle`.
///
/// The date of the sun is the option `sun`; a scene file may say so too.
pub fn option_name(path: &str) -> String {
    match path {
        "sun.date" => "sun".to_owned(),
        path => path.replace(['.', '_'], "-"),
    }
}

/// Returns true for the keys whose option may be given several times.
pub fn is_list(path: &str) -> bool {
    ["material", "object_settings"].contains(&path)
}

/// Returns true for the keys that are options too; some are for scene files and pages alone.
pub fn has_option(path: &str) -> bool {
    !["views", "measurements"].contains(&path)
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

impl SceneDescription {
    /// Writes the keys that differ from their defaults as words of a command line, without files and objects.
    pub fn to_options(&self) -> Vec<String> {
        self.to_options_over(&Self::default())
    }

    /// Writes the keys as words of a command line, without files and objects, whose files set the keys of `base`: those
    /// that differ from their defaults, and those at their defaults that `base` sets otherwise.
    pub fn to_options_over(&self, base: &Self) -> Vec<String> {
        let values = self.non_default().into_iter().chain(self.defaults_over(base));
        let values = values.filter(|(path, _)| has_option(path));
        let options = values.flat_map(|(path, value)| {
            let option = option_name(&path);
            match value {
                Value::Bool(true) => vec![format!("--{option}")],
                Value::Array(choices) if is_list(&path) => choices
                    .iter()
                    .map(|value| format!("--{option}={}", value_text(value)))
                    .collect(),
                value => vec![format!("--{option}={}", value_text(&value))],
            }
        });
        options.collect()
    }

    /// Returns the keys that are at their defaults here and not in `base`, with their defaults. Keys that a key of this
    /// description excludes are left out: they do not count.
    fn defaults_over(&self, base: &Self) -> Vec<(String, Value)> {
        let is_excluded = |path: &str| {
            let mut values = exclusive::excluded_by(path).filter_map(|other| self.get(other));
            let is_stated = path == "camera.azimuth_angle" && self.camera.has_both_ends();
            is_stated || values.any(|value| value != json!(false))
        };
        let keys = Self::keys().into_iter();
        let defaults = keys.filter_map(|(path, _, key)| Some((path, key.default?)));
        let restored = defaults.filter(|(path, default)| {
            self.get(path).is_none_or(|value| value == *default)
                && base.get(path).is_some_and(|value| value != *default)
                && !is_excluded(path)
        });
        restored.collect()
    }
}
