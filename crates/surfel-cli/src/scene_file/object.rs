//! Objects of a scene file: a file, how its points become a surface, what it is made of, where it stands.

use super::fields::Fields;
use super::{Options, beside};
use crate::args::{Choice, MaterialArgs, material};
use serde_json::Value;
use std::path::{Path, PathBuf};
use surfel::scene::{Material, Transform};

#[derive(Clone, Debug)]
pub struct Object {
    pub name: String,
    /// One, or a sequence of which one is seen at a time.
    pub files: Vec<PathBuf>,
    /// Of a sequence.
    pub fps: f64,
    /// Whether the files are clouds that together are one.
    pub is_merged: bool,
    /// Options of surface, preparation and colour that differ from the scene's.
    pub options: Options,
    pub material: Option<Material>,
    pub parent: Option<String>,
    pub transform: Transform,
    /// Further places where the same is seen, in the object's own coordinates; none for once, as it is.
    pub copies: Vec<Transform>,
    pub is_visible: bool,
}

impl Object {
    pub fn read(mut fields: Fields, folder: &Path) -> Result<Self, String> {
        let files = files(&mut fields, folder)?;
        let first = files[0].file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = fields.text("name")?.unwrap_or(first);
        let is_rate = |number: f64| (0.01..=1000.0).contains(&number);
        let fps = fields.number("fps", "frames a second from 0.01 to 1000", is_rate)?;
        let is_merged = fields.flag("merge")?.unwrap_or(false);
        let material = read_material(&mut fields)?;
        let parent = fields.text("parent")?;
        let transform = fields.transform()?;
        let mut copies = Vec::new();
        for mut copy in fields.tables("copies")? {
            copies.push(copy.transform()?);
            copy.finish()?;
        }
        let is_visible = fields.flag("visible")?.unwrap_or(true);
        let place = fields.name().to_owned();
        let options = Options::read(fields, folder).map_err(|error| format!("{place}: {error}"))?;
        Ok(Self {
            name,
            files,
            fps: fps.unwrap_or(10.0),
            is_merged,
            options,
            material,
            parent,
            transform,
            copies,
            is_visible,
        })
    }
}

impl Object {
    /// By which materials of the command line may be for it.
    pub fn names(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path).chain([Path::new(&self.name)])
    }

    /// What the command line makes it of: a material named for it, or, if it has none of its own, that for all.
    pub fn choice<'c>(&self, args: &'c MaterialArgs) -> Option<&'c Choice> {
        let named = self.names().find_map(|name| args.of_file(name));
        let has_own = self.material.is_some();
        named.or_else(|| args.for_all().filter(|_| !has_own))
    }

    pub fn material<'m>(&'m self, args: &'m MaterialArgs) -> Option<&'m Material> {
        let asked_for = self.choice(args).map(|choice| &choice.material);
        asked_for.or(self.material.as_ref())
    }

    /// Whether both show the same geometry, at whatever place.
    pub fn holds_the_same_as(&self, other: &Self) -> bool {
        let is_at_one_rate = self.files.len() == 1 || self.fps == other.fps;
        self.files == other.files
            && self.is_merged == other.is_merged
            && self.options == other.options
            && is_at_one_rate
    }
}

/// Keys that are no options; an unknown one may be meant for one of these.
pub const KEYS: [&str; 13] = [
    "name",
    "file",
    "files",
    "fps",
    "merge",
    "material",
    "parent",
    "matrix",
    "translate",
    "rotate",
    "scale",
    "copies",
    "visible",
];

fn files(fields: &mut Fields, folder: &Path) -> Result<Vec<PathBuf>, String> {
    let files = match (fields.text("file")?, fields.take("files")) {
        (Some(file), None) => vec![file],
        (None, Some(Value::String(pattern))) => {
            let found = matching(&beside(folder, &pattern));
            return found.map_err(|error| format!("{}: files: {error}", fields.name()));
        }
        (None, Some(Value::Array(files))) if !files.is_empty() => {
            let names = files.iter().map(|file| file.as_str().map(str::to_owned));
            let names: Option<Vec<String>> = names.collect();
            names.ok_or_else(|| format!("{}: files: expected names in quotes", fields.name()))?
        }
        _ => {
            let name = fields.name();
            return Err(format!(
                "{name}: expected `file = \"name\"`, or `files` with several or a `*`"
            ));
        }
    };
    Ok(files.iter().map(|file| beside(folder, file)).collect())
}

/// The files of a folder whose names fit a pattern with one `*`, in the order of their names.
fn matching(pattern: &Path) -> Result<Vec<PathBuf>, String> {
    let text = pattern.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let Some((start, end)) = text.split_once('*') else { return Ok(vec![pattern.to_owned()]) };
    let folder = match pattern.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let entries = std::fs::read_dir(folder)
        .map_err(|error| format!("{}: cannot be read: {error}", folder.display()))?;
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let fits = |name: &String| {
        start.len() + end.len() <= name.len() && name.starts_with(start) && name.ends_with(end)
    };
    let mut names: Vec<String> = names.filter(fits).collect();
    names.sort_by_cached_key(|name| natural(name));
    if names.is_empty() {
        return Err(format!("no file fits {}", pattern.display()));
    }
    Ok(names.into_iter().map(|name| folder.join(name)).collect())
}

/// So that `frame_10` comes after `frame_9`: runs of digits as numbers by their length.
fn natural(name: &str) -> Vec<(usize, String)> {
    let mut parts: Vec<(usize, String)> = Vec::new();
    for c in name.chars() {
        let is_digit = c.is_ascii_digit();
        match parts.last_mut() {
            Some((len, part)) if is_digit && 0 < *len => {
                part.push(c);
                *len += 1;
            }
            _ => parts.push((usize::from(is_digit), c.to_string())),
        }
    }
    parts
}

/// A name, or a table with `kind` and properties.
fn read_material(fields: &mut Fields) -> Result<Option<Material>, String> {
    let Some(value) = fields.take("material") else { return Ok(None) };
    let (kind, properties) = match value {
        Value::String(kind) => (kind, serde_json::Map::new()),
        Value::Object(mut table) => match table.remove("kind") {
            Some(Value::String(kind)) => (kind, table),
            None => ("matte".to_owned(), table),
            Some(other) => return Err(fields.error("material.kind", &other, "a name in quotes")),
        },
        other => return Err(fields.error("material", &other, "a name or a table")),
    };
    let place = format!("{}: material", fields.name());
    let mut made: Material =
        kind.parse().map_err(|error: surfel::Error| format!("{place}: {error}"))?;
    for (key, value) in properties {
        let text = match &value {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let key = key.replace('_', "-");
        material::set(&mut made, &key, &text).map_err(|error| {
            let nearest = super::fields::nearest(&key, material::PROPERTIES.into_iter());
            if material::PROPERTIES.contains(&key.as_str()) {
                format!("{place}: {key}: {error}")
            } else {
                format!("{place}: unknown key `{key}`{nearest}")
            }
        })?;
    }
    Ok(Some(made))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_order_of_their_numbers() {
        let mut names = ["f10.ply", "f9.ply", "f1.ply", "e2.ply"];
        names.sort_by_key(|name| natural(name));
        assert_eq!(names, ["e2.ply", "f1.ply", "f9.ply", "f10.ply"]);
    }
}
