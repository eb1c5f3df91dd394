//! Scene files: options by their names, objects, lamps and what moves, in TOML or JSON.

mod fields;
mod lamp;
mod line;
mod motion;
mod object;
mod options;
mod settings;

pub(crate) use line::Line;
pub use motion::{CameraMotion, Motion};
pub use object::Object;
pub use options::Options;

use crate::args::Usage;
use fields::Fields;
use serde_json::Value;
use std::path::{Path, PathBuf};
use surfel::scene::Node;

/// A scene file, read and checked; files that it names are found from where it lies.
#[derive(Clone, Debug, Default)]
pub struct SceneFile {
    pub options: Options,
    pub objects: Vec<Object>,
    pub lamps: Vec<Node>,
    pub motions: Vec<Motion>,
    pub camera_motion: Option<CameraMotion>,
    /// Tables of objects, lamps and animations as they were written, with files in full.
    raw: [Vec<Value>; 3],
}

/// Of `raw`.
pub(crate) const TABLES: [&str; 3] = ["object", "lamp", "animation"];

/// Bytes of the largest scene file: it names data, it does not hold them.
const MOST_BYTES: usize = 64 << 20;

/// Whether a file is a scene file, by its name.
pub fn is_scene_file(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    ["toml", "json"].contains(&extension.as_str())
}

impl SceneFile {
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = surfel_formats::load_text(path, MOST_BYTES)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        Self::parse(&text, is_json, &folder)
            .map_err(|error| Usage(format!("{}: {error}", path.display())).into())
    }

    /// `folder` is where the files lie that the scene names.
    pub fn parse(text: &str, is_json: bool, folder: &Path) -> Result<Self, String> {
        let value: Value = if is_json {
            serde_json::from_str(text).map_err(|error| error.to_string())?
        } else {
            toml::from_str(text).map_err(|error| toml_error(text, &error))?
        };
        // TOML knows no null: it stands for numbers that JSON does not know.
        if !is_json && let Some(place) = place_of_null(&value) {
            let place = place.trim_start_matches(": ");
            return Err(format!("{place}: found nan or inf, expected a number"));
        }
        let Value::Object(map) = value else { return Err("expected keys and values".into()) };
        let mut fields = Fields::new(String::new(), map);
        let raw = TABLES.map(|key| raw(&fields, key, folder));
        let mut scene = Self { raw, ..Self::default() };
        for object in fields.tables("object")? {
            scene.objects.push(Object::read(object, folder)?);
        }
        for lamp in fields.tables("lamp")? {
            scene.lamps.push(lamp::read(lamp)?);
        }
        for motion in fields.tables("animation")? {
            motion::read(motion, &mut scene)?;
        }
        // What a dry run tells about the data.
        fields.take("info");
        scene.options = Options::read(fields, folder)?;
        scene.check_names()?;
        Ok(scene)
    }

    /// Tables of objects as they were written, with files in full.
    pub fn raw_objects(&self) -> &[Value] {
        &self.raw[0]
    }

    /// The same of lamps and animations, by their keys.
    pub fn raw_others(&self) -> impl Iterator<Item = (&'static str, &Vec<Value>)> {
        TABLES.into_iter().zip(&self.raw).skip(1).filter(|(_, tables)| !tables.is_empty())
    }

    /// Takes `other` in behind what is here.
    pub fn append(&mut self, other: Self) {
        self.options.append(other.options);
        self.objects.extend(other.objects);
        self.lamps.extend(other.lamps);
        self.motions.extend(other.motions);
        for (tables, more) in self.raw.iter_mut().zip(other.raw) {
            tables.extend(more);
        }
        self.camera_motion = other.camera_motion.or(self.camera_motion.take());
    }

    /// Fails where a parent or an animation names nothing, or several things.
    fn check_names(&self) -> Result<(), String> {
        let names = self.objects.iter().map(|object| object.name.as_str());
        let objects: Vec<(String, &str)> = numbered("object", names).collect();
        for (object, before) in self.objects.iter().zip(0..) {
            let Some(parent) = &object.parent else { continue };
            let place = format!("object `{}`", object.name);
            if !is_one_of(&objects[..before], parent, &place)? {
                return Err(format!("{place}: no object `{parent}` before it to be its parent"));
            }
        }
        let lamps = numbered("lamp", self.lamps.iter().map(|lamp| lamp.name.as_str()));
        let all: Vec<(String, &str)> = objects.into_iter().chain(lamps).collect();
        for Motion { object, .. } in &self.motions {
            if !is_one_of(&all, object, "animation")? {
                let nearest = fields::nearest(object, all.iter().map(|(_, name)| *name));
                return Err(format!("animation: no object `{object}`{nearest}"));
            }
        }
        Ok(())
    }
}

/// Names with what bears them: `object 1` and so on.
fn numbered<'n>(
    kind: &str,
    names: impl Iterator<Item = &'n str>,
) -> impl Iterator<Item = (String, &'n str)> {
    (1..).zip(names).map(move |(number, name)| (format!("{kind} {number}"), name))
}

/// Whether something bears a name; fails if it cannot be told which of several is meant.
fn is_one_of(named: &[(String, &str)], wanted: &str, place: &str) -> Result<bool, String> {
    let bearers = named.iter().filter(|(_, name)| *name == wanted);
    let bearers: Vec<&str> = bearers.map(|(bearer, _)| bearer.as_str()).collect();
    if bearers.len() < 2 {
        return Ok(!bearers.is_empty());
    }
    let bearers = bearers.join(" and ");
    Err(format!("{place}: `{wanted}` is the name of {bearers}; give each one of its own"))
}

/// In one line, with the place.
fn toml_error(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
    let Some(span) = error.span() else { return message };
    let Some((before, found)) = text.get(..span.start).zip(text.get(span)) else { return message };
    let line = 1 + before.matches('\n').count();
    let column = 1 + before.chars().rev().take_while(|c| *c != '\n').count();
    let is_short = !found.is_empty() && found.len() < 40 && !found.contains('\n');
    let found = if is_short { format!(" at `{found}`") } else { String::new() };
    format!("line {line}, column {column}: {message}{found}")
}

/// The keys that lead to a null.
fn place_of_null(value: &Value) -> Option<String> {
    match value {
        Value::Null => Some(String::new()),
        Value::Array(values) => values.iter().enumerate().find_map(|(i, value)| {
            let place = place_of_null(value)?;
            // Tables are counted, as elsewhere; of numbers, the key is enough.
            let number = if value.is_object() { format!(" {}", i + 1) } else { String::new() };
            Some(format!("{number}{place}"))
        }),
        Value::Object(map) => map.iter().find_map(|(key, value)| {
            let place = place_of_null(value)?;
            Some(format!(": {key}{place}"))
        }),
        _ => None,
    }
}

fn raw(fields: &Fields, key: &str, folder: &Path) -> Vec<Value> {
    let mut tables = match fields.peek(key) {
        Some(Value::Array(tables)) => tables.clone(),
        Some(table) => vec![table.clone()],
        None => Vec::new(),
    };
    let in_full = |file: &mut Value| {
        if let Value::String(path) = file {
            *path = crate::dry_run::in_full(&beside(folder, path));
        }
    };
    for table in tables.iter_mut().filter_map(Value::as_object_mut) {
        table.get_mut("file").into_iter().for_each(in_full);
        match table.get_mut("files") {
            Some(Value::Array(files)) => files.iter_mut().for_each(in_full),
            Some(pattern) => in_full(pattern),
            None => {}
        }
    }
    tables
}

/// `path` as it is seen from `folder`.
fn beside(folder: &Path, path: &str) -> PathBuf {
    folder.join(path)
}
