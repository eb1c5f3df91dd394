//! Views of a scene that were saved under names, and the measurements of the viewer.

use super::keys::settings;
use super::measurement::{Measurement, Measurements};
use super::rule::Rule;
use super::{CameraSettings, Invalid, OrthographicHeight, read_table, write_table};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::Path;

settings! {
    /// Saved views and measurements.
    pub struct ViewSettings {
        /// Views to which the viewer goes by their names. They change no picture.
        views: Vec<NamedView>, NamedViews, "VIEWS";
        /// Measurements and annotations that the viewer shows. They change no picture.
        measurements: Vec<Measurement>, Measurements, "MEASUREMENTS";
    }
}

/// A camera under a name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedView {
    /// Name, different from those of other views.
    pub name: String,
    /// The camera.
    pub camera: CameraSettings,
}

/// Maximum number of views.
const MAX_VIEWS: usize = 200;
/// Maximum number of characters of a name.
const MAX_NAME_LENGTH: usize = 100;

/// Tables `{ name = "north", camera = { ... } }`.
struct NamedViews;

impl Rule<Vec<NamedView>> for NamedViews {
    fn read(&self, value: &Value, folder: &Path) -> Result<Vec<NamedView>, Invalid> {
        let tables = value.as_array().filter(|tables| tables.len() <= MAX_VIEWS);
        let tables = tables.ok_or_else(|| {
            Invalid::new(format!("expected tables with a name and a camera, {MAX_VIEWS} at most"))
        })?;
        let views = tables.iter().enumerate().map(|(i, table)| {
            read_view(table, folder).map_err(|error| error.within(&format!("[{i}]")))
        });
        let views: Vec<NamedView> = views.collect::<Result<_, _>>()?;
        let names: BTreeSet<&str> = views.iter().map(|view| view.name.as_str()).collect();
        match names.len() == views.len() {
            true => Ok(views),
            false => Err(Invalid::new("expected a different name for each view")),
        }
    }

    fn write(&self, value: &Vec<NamedView>) -> Value {
        let table =
            |view: &NamedView| json!({ "name": view.name, "camera": write_table(&view.camera) });
        value.iter().map(table).collect()
    }
}

fn read_view(value: &Value, folder: &Path) -> Result<NamedView, Invalid> {
    let none = Map::new();
    let table = value.as_object().unwrap_or(&none);
    let name = table.get("name").and_then(Value::as_str);
    let name = name.filter(|name| (1..=MAX_NAME_LENGTH).contains(&name.chars().count()));
    let camera = table.get("camera").and_then(Value::as_object);
    let (Some(name), Some(camera), 2) = (name, camera, table.len()) else {
        let text = format!(
            "expected a name of 1 to {MAX_NAME_LENGTH} characters, and a camera, as in \
             {{ name = \"north\", camera = {{ position = [0, 90, 2] }} }}"
        );
        return Err(Invalid::new(text).found(value));
    };
    let mut settings = CameraSettings::default();
    read_table(&mut settings, camera, folder).map_err(|error| error.within("camera"))?;
    settings.orthographic.take_if(|height| *height == OrthographicHeight::Off);
    Ok(NamedView { name: name.to_owned(), camera: settings })
}

#[cfg(test)]
mod tests {
    //! Views that are read back, and those that are rejected.

    use super::*;

    fn read(value: &Value) -> Result<Vec<NamedView>, Invalid> {
        NamedViews.read(value, Path::new(""))
    }

    #[test]
    fn views_read_back_equal() {
        let views = json!([
            { "name": "Nordseite №1", "camera": { "position": [1.0, 2.0, 3.0], "view_angle": 40.0 } },
            { "name": "map", "camera": { "orthographic": 12.5 } },
        ]);
        assert_eq!(NamedViews.write(&read(&views).unwrap()), views);
    }

    #[test]
    fn wrong_views_are_rejected() {
        let long = "a".repeat(MAX_NAME_LENGTH + 1);
        for wrong in [
            json!("north"),
            json!([7]),
            json!([{ "name": "a" }]),
            json!([{ "name": "", "camera": {} }]),
            json!([{ "name": long, "camera": {} }]),
            json!([{ "name": "a", "camera": { "position": "here" } }]),
            json!([{ "name": "a", "camera": {}, "color": "rgb" }]),
            json!([{ "name": "a", "camera": {} }, { "name": "a", "camera": {} }]),
            vec![json!({ "name": "a", "camera": {} }); MAX_VIEWS + 1].into(),
        ] {
            assert!(read(&wrong).is_err(), "{wrong}");
        }
    }
}
