//! Options of the program: the name of a key's option, and a description as words of a command line.

use super::SceneDescription;
use serde_json::Value;

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
    path != "views"
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
        let values = self.non_default().into_iter().filter(|(path, _)| has_option(path));
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
}
