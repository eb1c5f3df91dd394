//! The description of a picture as plain structs: objects with their files, camera, light, quality.
//!
//! A command line, a scene file, a page's message, a Python keyword and a Rust caller are ways to fill a
//! [`SceneDescription`]. Each field of its parts is a key of scene files and an option of the program; what is `None`
//! is a default, or is chosen from the data by [`crate::resolve()`].

mod animation;
mod camera;
mod clip_rule;
mod color_rule;
mod crop;
mod exclusive;
mod file;
mod invalid;
mod keys;
mod lamp;
mod light;
mod material;
mod measurement;
mod named_view;
mod spelling;
mod object;
mod object_override;
mod object_settings;
mod option;
pub mod pattern;
mod picture;
mod place;
mod plan;
mod point_filter;
mod preparation_rule;
pub mod rule;
mod section;
mod table;
mod vector_rule;

pub use animation::{AnimationDescription, AnimationKind, CameraMotion, ObjectMotion, Orbit};
pub use camera::{CameraSettings, Interior, OrthographicHeight, WorldSettings};
pub use crop::Crop;
pub use file::{is_scene_file, parse_table};
pub use invalid::Invalid;
pub use keys::{Key, KeyedSettings};
pub use lamp::{LampDescription, LampShape};
pub use light::{LIGHT_KINDS, LightKind, LightSettings, SkySettings, SunSettings};
pub use material::{MaterialChoice, MaterialDescription, MaterialSettings, names_of};
pub use measurement::{Measurement, MeasurementKind};
pub use named_view::{NamedView, ViewSettings};
pub use object::{ObjectDescription, Placement, Rotation, twins};
pub use object_override::{ObjectOverride, OverrideSettings};
pub use object_settings::{
    ColorSettings, ObjectSettings, PreparationSettings, READ_ONCE, SurfaceSettings,
};
pub use option::{has_option, is_list, option_name, value_text};
pub use picture::{Backend, Exposure, OutputSettings, PictureSettings, RunSettings};
pub use plan::PlanSettings;
pub use point_filter::Returns;
pub use section::{Part, Section};
pub use spelling::{misspelled, nearest, nearest_if_any, synonym, with_nearest};
pub(crate) use table::write_parts;
pub use table::write_table;

use crate::memory_files::MemoryFiles;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use table::{
    flatten, is_unique, numbered, read_table, read_value, take_normalized, take_tables, unknown_key,
};

/// Everything that decides what a picture shows. The default is an empty scene under automatic light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneDescription {
    /// Files without an object of their own, shown where their coordinates say. Clouds among them become one cloud.
    pub files: Vec<PathBuf>,
    /// Objects; parents stand before their children.
    pub objects: Vec<ObjectDescription>,
    /// Lights at places.
    pub lamps: Vec<LampDescription>,
    /// Movements of objects, lamps and the camera.
    pub animations: Vec<AnimationDescription>,
    /// Files, here and of objects, that are in memory instead. No scene file holds them.
    pub memory: MemoryFiles,
    /// File of the picture or movie, and the time that it shows.
    pub output: OutputSettings,
    /// Size, quality and background of the picture.
    pub picture: PictureSettings,
    /// Plans to scale.
    pub plan: PlanSettings,
    /// The camera.
    pub camera: CameraSettings,
    /// Directions of the world.
    pub world: WorldSettings,
    /// Lights of the whole scene, and the exposure.
    pub light: LightSettings,
    /// The sun.
    pub sun: SunSettings,
    /// The sky.
    pub sky: SkySettings,
    /// Surface, preparation and colour of everything that has no settings of its own.
    pub objects_default: ObjectSettings,
    /// Threads, memory and device.
    pub run: RunSettings,
    /// Materials for everything, or for files and objects by their names.
    pub materials: MaterialSettings,
    /// Settings of files and objects by their names.
    pub overrides: OverrideSettings,
    /// Views that were saved under names, and measurements.
    pub views: ViewSettings,
}

impl std::fmt::Debug for dyn KeyedSettings + '_ {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_map().entries(write_table(self)).finish()
    }
}

/// Tables of scene files that may stand there several times.
pub const TABLES: [&str; 3] = ["object", "lamp", "animation"];

/// The table of `--dry-run` that describes the data and changes nothing.
const INFO: &str = "info";

impl SceneDescription {
    /// Describes a scene of these files.
    pub fn of_files(files: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        Self { files: files.into_iter().map(Into::into).collect(), ..Self::default() }
    }

    /// Returns this description about the files, objects, lamps and animations of another.
    #[must_use]
    pub fn with_content_of(self, other: &Self) -> Self {
        Self {
            files: other.files.clone(),
            objects: other.objects.clone(),
            lamps: other.lamps.clone(),
            animations: other.animations.clone(),
            memory: other.memory.clone(),
            ..self
        }
    }

    /// Returns the parts with their keys.
    pub fn parts(&self) -> [Part<&dyn KeyedSettings>; 15] {
        let [surface, preparation, color] = self.objects_default.parts();
        let part = |section, prefix, settings| Part { section, prefix, settings };
        [
            part(Section::Output, "", &self.output as &dyn KeyedSettings),
            part(Section::Picture, "", &self.picture),
            surface,
            part(Section::Plans, "", &self.plan),
            part(Section::Camera, "camera.", &self.camera),
            part(Section::World, "", &self.world),
            part(Section::Light, "", &self.light),
            part(Section::Light, "sun.", &self.sun),
            part(Section::Light, "sky.", &self.sky),
            color,
            preparation,
            part(Section::Everywhere, "", &self.run),
            part(Section::Materials, "", &self.materials),
            part(Section::Materials, "", &self.overrides),
            part(Section::Views, "", &self.views),
        ]
    }

    fn parts_mut(&mut self) -> [(&'static str, &mut dyn KeyedSettings); 15] {
        let ObjectSettings { surface, preparation, color } = &mut self.objects_default;
        [
            ("", &mut self.output),
            ("", &mut self.picture),
            ("", surface),
            ("", &mut self.plan),
            ("camera.", &mut self.camera),
            ("", &mut self.world),
            ("", &mut self.light),
            ("sun.", &mut self.sun),
            ("sky.", &mut self.sky),
            ("", color),
            ("", preparation),
            ("", &mut self.run),
            ("", &mut self.materials),
            ("", &mut self.overrides),
            ("", &mut self.views),
        ]
    }

    /// Returns all keys outside of objects, lamps and animations, with their paths and sections.
    pub fn keys() -> Vec<(String, Section, Key)> {
        let description = Self::default();
        let parts = description.parts().into_iter();
        let keys = parts.flat_map(|Part { prefix, section, settings }| {
            let keys = settings.keys().into_iter();
            keys.map(move |key| (format!("{prefix}{}", key.name), section, key))
        });
        keys.collect()
    }

    /// Sets the value of a key, named by its path or its option, from a value as a scene file has it.
    ///
    /// Paths in the value start at `folder`. `null` makes the key automatic again. Other keys stay as they are, also those
    /// that this one excludes; [`Self::check`] finds them.
    ///
    /// # Errors
    ///
    /// Fails for an unknown key and a value that is not valid.
    pub fn set(&mut self, path: &str, value: &Value, folder: &Path) -> Result<(), Invalid> {
        let option = option_name(path);
        for (prefix, settings) in self.parts_mut() {
            let Some(key) = settings
                .keys()
                .into_iter()
                .find(|key| option_name(&format!("{prefix}{}", key.name)) == option)
            else {
                continue;
            };
            let path = format!("{prefix}{}", key.name);
            if value.is_null() || is_empty_list(&path, value) {
                settings.unset(key.name);
                return Ok(());
            }
            settings.set(key.name, value, folder).map_err(|error| error.within(&path))?;
            return Ok(());
        }
        let keys = Self::keys();
        Err(unknown_key(path, keys.iter().map(|(path, ..)| path.as_str()).chain(TABLES)))
    }

    /// Returns the value of a key by its path, or `None` if it is not set.
    pub fn get(&self, path: &str) -> Option<Value> {
        self.parts().iter().find_map(|part| part.settings.get(path.strip_prefix(part.prefix)?))
    }

    /// Reads a table of keys, as of a scene file. Files that it names start at `folder`.
    ///
    /// # Errors
    ///
    /// Fails for unknown keys, values that are not valid, keys that exclude each other, and names without an object.
    pub fn from_table(table: &Map<String, Value>, folder: &Path) -> Result<Self, Invalid> {
        let mut description = Self::default();
        let mut table = table.clone();
        table.shift_remove(INFO);
        for (i, object) in take_tables(&mut table, "object")?.iter().enumerate() {
            let object = ObjectDescription::read(object, folder);
            description
                .objects
                .push(object.map_err(|error| error.within(&format!("object[{i}]")))?);
        }
        for (i, lamp) in take_tables(&mut table, "lamp")?.iter().enumerate() {
            let lamp = LampDescription::read(lamp, i + 1);
            description.lamps.push(lamp.map_err(|error| error.within(&format!("lamp[{i}]")))?);
        }
        for (i, animation) in take_tables(&mut table, "animation")?.iter().enumerate() {
            let animation = AnimationDescription::read(animation);
            description
                .animations
                .push(animation.map_err(|error| error.within(&format!("animation[{i}]")))?);
        }
        let mut values = Vec::new();
        flatten("", &table, &mut values);
        for (path, value) in values {
            description.set(&path, value, folder)?;
        }
        description.check()?;
        Ok(description)
    }

    /// Adds an object from a table, as of `[[object]]` in a scene file. Files that it names start at `folder`.
    ///
    /// # Errors
    ///
    /// Fails for unknown keys, values that are not valid, and a parent that is not there; then nothing is added.
    pub fn add_object(&mut self, table: &Map<String, Value>, folder: &Path) -> Result<(), Invalid> {
        self.objects.push(ObjectDescription::read(table, folder)?);
        self.check().inspect_err(|_| drop(self.objects.pop()))
    }

    /// Lays another description over this one: its keys count, its objects, lamps and animations are added.
    ///
    /// Keys of this one that exclude a key of the other are unset; keys that are false exclude nothing. A direction of view
    /// takes the place of a position and a focal point, beside which it would have no effect, and a zoom that of a height.
    pub fn overlay(&mut self, over: Self) {
        for part in over.parts() {
            let keys = part.settings.keys();
            for key in keys.iter().filter(|key| exclusive::is_set(part.settings, key.name)) {
                for excluded in exclusive::excluded_by(&format!("{}{}", part.prefix, key.name)) {
                    self.unset(excluded);
                }
            }
        }
        self.run.unset_excluded_by(&over.run);
        self.camera.unset_excluded_by(&over.camera);
        self.output.overlay(&over.output);
        self.picture.overlay(&over.picture);
        self.plan.overlay(&over.plan);
        self.camera.overlay(&over.camera);
        self.world.overlay(&over.world);
        self.light.overlay(&over.light);
        self.sun.overlay(&over.sun);
        self.sky.overlay(&over.sky);
        self.objects_default = over.objects_default.over(&self.objects_default);
        self.run.overlay(&over.run);
        self.materials.overlay(&over.materials);
        self.overrides.overlay(&over.overrides);
        self.views.overlay(&over.views);
        self.files.extend(over.files);
        self.objects.extend(over.objects);
        self.lamps.extend(over.lamps);
        self.animations.extend(over.animations);
        self.memory.extend(over.memory);
    }

    fn unset(&mut self, path: &str) {
        for (prefix, settings) in self.parts_mut() {
            if let Some(name) = path.strip_prefix(prefix) {
                settings.unset(name);
            }
        }
    }

    /// Changes keys by a merge patch (RFC 7396) with paths as keys: `null` makes a key automatic again.
    ///
    /// # Errors
    ///
    /// Fails for unknown keys, values that are not valid, and keys that exclude each other; then nothing is changed.
    pub fn merge(&mut self, patch: &Map<String, Value>) -> Result<(), Invalid> {
        let mut merged = self.clone();
        let mut values = Vec::new();
        flatten("", patch, &mut values);
        for (path, value) in values {
            merged.set(&path, value, Path::new(""))?;
        }
        merged.check()?;
        *self = merged;
        Ok(())
    }

    /// Checks what no single value shows: keys that exclude each other, and names without an object.
    ///
    /// # Errors
    ///
    /// Fails with the path of the first such key.
    pub fn check(&self) -> Result<(), Invalid> {
        exclusive::check(&self.parts())?;
        self.run.check()?;
        self.camera.check()?;
        let has_others = self.light.light.as_ref().is_some_and(|kinds| 1 < kinds.len());
        if self.light.has(LightKind::None) && has_others {
            return Err(Invalid::at("light", "none excludes all other lights; leave them out"));
        }
        self.check_names()
    }

    /// Checks that there is something to show.
    ///
    /// # Errors
    ///
    /// Fails without a file and without an object.
    pub fn check_is_not_empty(&self) -> Result<(), Invalid> {
        if self.files.is_empty() && self.objects.is_empty() {
            return Err(Invalid::at("object", "no objects; add an [[object]] with a file"));
        }
        Ok(())
    }

    /// Returns the error of a name that no file and no object has.
    pub(crate) fn unknown_target(&self, target: &str) -> Invalid {
        let names = self.objects.iter().flat_map(ObjectDescription::names);
        let names = self.files.iter().cloned().chain(names);
        let mut known: Vec<String> = names.map(|name| name.display().to_string()).collect();
        known.dedup();
        let advice = match nearest_if_any(target, known.iter().map(String::as_str)) {
            none if none.is_empty() => format!("; there is {}", known.join(", ")),
            advice => advice,
        };
        Invalid::new(format!("no file or object `{target}`{advice}"))
    }

    /// Fails where a parent or an animation names nothing, or several things.
    fn check_names(&self) -> Result<(), Invalid> {
        let objects: Vec<(String, String)> =
            numbered("object", self.objects.iter().map(ObjectDescription::name));
        for (i, object) in self.objects.iter().enumerate() {
            let Some(parent) = &object.parent else { continue };
            let path = format!("object[{i}].parent");
            if !is_unique(&objects[..i], parent, &path)? {
                return Err(Invalid::at(
                    path,
                    format!("no object `{parent}` stands before this one"),
                ));
            }
        }
        let lamps = self.lamps.iter().map(|lamp| lamp.name.clone().unwrap_or_default());
        let all: Vec<(String, String)> =
            objects.into_iter().chain(numbered("lamp", lamps)).collect();
        for (i, animation) in self.animations.iter().enumerate().filter(|(_, a)| !a.is_of_camera())
        {
            let path = format!("animation[{i}].object");
            let object = animation.object.as_deref().unwrap_or_default();
            if !is_unique(&all, object, &path)? {
                let advice = nearest(object, all.iter().map(|(_, name)| name.as_str()));
                return Err(Invalid::at(path, format!("no object `{object}`{advice}")));
            }
        }
        Ok(())
    }

    /// Writes the keys that are set, with objects, lamps and animations, as a scene file has them.
    pub fn to_table(&self) -> Map<String, Value> {
        let mut table = write_parts(&self.parts());
        let objects: Vec<Value> = self.objects.iter().map(ObjectDescription::write).collect();
        let lamps: Vec<Value> = self.lamps.iter().map(LampDescription::write).collect();
        let animations: Vec<Value> =
            self.animations.iter().map(AnimationDescription::write).collect();
        for (name, tables) in TABLES.into_iter().zip([objects, lamps, animations]) {
            if !tables.is_empty() {
                table.insert(name.into(), Value::Array(tables));
            }
        }
        table
    }

    /// Returns the paths and values of the keys that are set and differ from their defaults.
    pub fn non_default(&self) -> Vec<(String, Value)> {
        let mut values = Vec::new();
        for Part { prefix, settings, .. } in self.parts() {
            for key in settings.keys() {
                let value =
                    settings.get(key.name).filter(|value| Some(value) != key.default.as_ref());
                values.extend(value.map(|value| (format!("{prefix}{}", key.name), value)));
            }
        }
        values
    }
}

impl Serialize for SceneDescription {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.to_table().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for SceneDescription {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let table = Map::deserialize(deserializer)?;
        Self::from_table(&table, Path::new("")).map_err(serde::de::Error::custom)
    }
}

/// Returns true for an empty list of a key that has several values: it says that there is none.
fn is_empty_list(path: &str, value: &Value) -> bool {
    (is_list(path) || !has_option(path)) && value.as_array().is_some_and(Vec::is_empty)
}

#[cfg(test)]
mod tests;
