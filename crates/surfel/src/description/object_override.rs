//! Settings of files and objects by their names, as in `scan.laz:color=class`.

use super::keys::{KeyedSettings, settings};
use super::material::is_named;
use super::rule::Rule;
use super::table::key_advice;
use super::{
    Invalid, ObjectDescription, ObjectSettings, SceneDescription, value_text, write_table,
};
use serde_json::{Value, json};
use std::path::Path;

settings! {
    /// Settings of single files and objects.
    pub struct OverrideSettings {
        /// Sets one key of one file or object, as in scan.laz:color=class or house.obj:visible=false: visible, label, or a
        /// key of surface, preparation and colour. May be given several times.
        object_settings: Vec<ObjectOverride>, ObjectOverrides, "FILE:KEY=VALUE";
    }
}

/// One setting of a file or object, in place of its own and of the scene's.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectOverride {
    /// Name of the object, or path, name or stem of the file.
    pub target: String,
    /// The key, as in `color`.
    pub key: String,
    /// The value, as a scene file has it.
    pub value: Value,
}

/// Name of the key that hides objects.
const VISIBLE: &str = "visible";

/// Name of the key that names objects in the viewer's list.
const LABEL: &str = "label";

impl ObjectOverride {
    /// Writes the setting as text, as in `scan.laz:color=class`.
    pub fn text(&self) -> String {
        format!("{}:{}={}", self.target, self.key.replace('_', "-"), value_text(&self.value))
    }

    /// Returns the settings of an object under a name.
    pub fn all_of(object: &ObjectDescription, target: &str) -> Vec<Self> {
        let own = [VISIBLE, LABEL].into_iter();
        let own = own.filter_map(|key| Some((key.to_owned(), object.get(key)?)));
        let parts = object.settings.parts().into_iter();
        let keys = own.chain(parts.flat_map(|part| write_table(part.settings)));
        keys.map(|(key, value)| Self { target: target.to_owned(), key, value }).collect()
    }

    /// Returns true if a file is meant: by its path, its name, or its name without extension.
    pub fn names_file(&self, file: &Path) -> bool {
        is_named(file, &self.target)
    }

    /// Returns true if the setting is a label, for which a file need not become an object.
    pub fn is_label(&self) -> bool {
        self.key == LABEL
    }

    fn names(&self, object: &ObjectDescription) -> bool {
        object.names().iter().any(|name| self.names_file(name))
    }

    fn apply(&self, object: &mut ObjectDescription) -> Result<(), Invalid> {
        let ObjectSettings { surface, preparation, color } = &mut object.settings;
        let parts: [&mut dyn KeyedSettings; 3] = [surface, preparation, color];
        let folder = Path::new("");
        for part in parts {
            if part.keys().iter().any(|key| key.name == self.key) {
                return part.set(&self.key, &self.value, folder);
            }
        }
        KeyedSettings::set(object, &self.key, &self.value, folder)
    }
}

/// Text, or a list of texts.
pub(super) struct ObjectOverrides;

impl Rule<Vec<ObjectOverride>> for ObjectOverrides {
    fn read(&self, value: &Value, _: &Path) -> Result<Vec<ObjectOverride>, Invalid> {
        let all = match value {
            Value::Array(all) => &all[..],
            only => std::slice::from_ref(only),
        };
        let read = |value: &Value| {
            let text = value.as_str().ok_or_else(|| Invalid::new(EXPECTED))?;
            parse(text).map_err(|error| error.found_unless_nested(value))
        };
        all.iter().map(read).collect()
    }

    fn write(&self, value: &Vec<ObjectOverride>) -> Value {
        value.iter().map(|one| Value::String(one.text())).collect()
    }
}

const EXPECTED: &str = "expected a file or object, a key and its value as in scan.laz:color=class";

/// The keys that an object may have by its name.
fn known_keys() -> Vec<&'static str> {
    let settings = ObjectSettings::default();
    let of_parts = settings.parts().into_iter().flat_map(|part| part.settings.keys());
    of_parts.map(|key| key.name).chain([VISIBLE, LABEL]).collect()
}

/// Reads `NAME:KEY=VALUE`. Names may contain colons, and values all signs.
fn parse(text: &str) -> Result<ObjectOverride, Invalid> {
    let keys = known_keys();
    let found = text.match_indices(':').find_map(|(at, _)| {
        let (key, value) = text[at + 1..].split_once('=')?;
        let key = key.trim().replace('-', "_");
        keys.contains(&key.as_str()).then(|| (&text[..at], key, value.trim()))
    });
    let (target, key, value) =
        found.filter(|(target, ..)| !target.is_empty()).ok_or_else(|| unreadable(text, &keys))?;
    let mut object = ObjectDescription::default();
    let read = ObjectOverride { target: target.into(), key, value: json!(value) };
    read.apply(&mut object).map_err(|error| error.within(&read.key))?;
    // The value as its rule writes it: a page compares texts.
    let value = match read.key.as_str() {
        VISIBLE | LABEL => object.get(&read.key),
        key => object.settings.parts().iter().find_map(|part| part.settings.get(key)),
    };
    Ok(ObjectOverride { value: value.unwrap_or(read.value), ..read })
}

/// Returns the error of a text that has no known key: that of the word in the place of the key, if there is one.
fn unreadable(text: &str, keys: &[&str]) -> Invalid {
    let word = text.split_once('=').and_then(|(start, _)| start.rsplit_once(':'));
    match word {
        Some((target, key)) if !target.is_empty() && !key.is_empty() => {
            Invalid::new(format!("unknown key `{key}`{}", key_advice(key.trim(), keys)))
        }
        _ => Invalid::new(format!("{EXPECTED}; the keys are {}", keys.join(", "))),
    }
}

impl OverrideSettings {
    /// Returns the settings in their order; the last one of a key counts.
    pub fn all(&self) -> &[ObjectOverride] {
        self.object_settings.as_deref().unwrap_or_default()
    }
}

impl SceneDescription {
    /// Gives the materials and settings of files and objects other targets.
    pub fn rename_targets(&mut self, renamed: impl Fn(&str) -> String) {
        let choices = self.materials.material.iter_mut().flatten();
        let materials = choices.filter_map(|choice| choice.target.as_mut());
        let settings = self.overrides.object_settings.iter_mut().flatten();
        for target in materials.chain(settings.map(|one| &mut one.target)) {
            *target = renamed(target);
        }
    }

    /// Gives files and objects their settings by name: a file becomes an object, which holds them, unless it is a label.
    /// Doing so twice changes nothing more.
    ///
    /// # Errors
    ///
    /// Fails for names that no file or object has.
    pub fn apply_object_settings(&mut self) -> Result<(), Invalid> {
        let mut all = self.overrides.all().to_vec();
        // Once the files with other settings are objects.
        all.sort_by_key(ObjectOverride::is_label);
        for one in all {
            let within = |error: Invalid| error.within("object_settings");
            let is_label = one.is_label();
            let own = self.files.extract_if(.., |file| !is_label && one.names_file(file));
            let own: Vec<ObjectDescription> = own.map(ObjectDescription::new).collect();
            self.objects.extend(own);
            let mut is_known = self.files.iter().any(|file| one.names_file(file));
            let meant = self.objects.iter_mut().filter(|object| one.names(object));
            // A file among those of an object has a label of its own.
            let mut meant = meant.inspect(|_| is_known = true).filter(|object| {
                !is_label || object.files.len() == 1 || one.names_file(Path::new(&object.name()))
            });
            meant.try_for_each(|object| one.apply(object)).map_err(within)?;
            if !is_known {
                return Err(within(self.unknown_target(&one.target)));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    //! Settings by name as text, and the objects that they make of files.

    use super::*;
    use std::path::PathBuf;

    fn described(settings: &[&str]) -> SceneDescription {
        let mut description = SceneDescription::of_files(["/data/a.laz", "/data/b.ply"]);
        description.set("object_settings", &json!(settings), Path::new("")).unwrap();
        description
    }

    #[test]
    fn texts_read_back_equal() {
        let texts = [
            "a.laz:visible=false",
            "C:\\scans\\a:b.laz:color=intensity",
            "a.laz:filter=z < 3 && intensity != 5",
            "x=y.ply:range=1,2.5",
            "b.ply:radius-scale=1.5",
            "b.ply:color=#ff8000",
            "b.ply:label=East: wall = 2",
        ];
        let read = ObjectOverrides.read(&json!(texts), Path::new("")).unwrap();
        assert_eq!(read[1].target, "C:\\scans\\a:b.laz");
        assert_eq!(ObjectOverrides.write(&read), json!(texts));
    }

    #[test]
    fn wrong_texts_are_rejected() {
        for text in
            ["", "a", "a:visible", ":visible=false", "a:visible=2", "a:size=3", "a:radius-scale=-1"]
        {
            assert!(ObjectOverrides.read(&json!(text), Path::new("")).is_err(), "{text}");
        }
        let error = ObjectOverrides.read(&json!("a.ply:colour=class"), Path::new("")).unwrap_err();
        assert_eq!(error.message, "unknown key `colour`; here it is `color`");
    }

    #[test]
    fn labels_leave_files_as_they_are() {
        let mut description = described(&["b:label=East", "a.laz:label=West"]);
        description.objects.push(ObjectDescription::new("/data/c.obj"));
        let settings = json!(["b:label=East", "a.laz:label=West", "c:label=House"]);
        description.set("object_settings", &settings, Path::new("")).unwrap();
        description.apply_object_settings().unwrap();
        assert_eq!(description.files.len(), 2);
        assert_eq!(description.objects[0].label.as_deref(), Some("House"));
        let mut both = described(&["b.ply:label=East", "b.ply:visible=false"]);
        both.apply_object_settings().unwrap();
        let object = &both.objects[0];
        assert_eq!((object.label.as_deref(), object.visible), (Some("East"), Some(false)));
        let error = described(&["d.ply:label=x"]).apply_object_settings().unwrap_err().to_string();
        assert!(error.contains("no file or object `d.ply`"), "{error}");
    }

    #[test]
    fn files_with_settings_become_objects() {
        let mut description = described(&["b.ply:color=class", "b:visible=false"]);
        description.apply_object_settings().unwrap();
        let once = description.clone();
        description.apply_object_settings().unwrap();
        assert_eq!(description, once);
        assert_eq!(description.files, [PathBuf::from("/data/a.laz")]);
        let [object] = &description.objects[..] else { panic!("one object is expected") };
        assert_eq!(object.files, [PathBuf::from("/data/b.ply")]);
        assert!(!object.visible() && object.settings.color.color.is_some());
        let error = described(&["c.ply:visible=false"]).apply_object_settings().unwrap_err();
        assert!(
            error.to_string().contains("object_settings: no file or object `c.ply`"),
            "{error}"
        );
    }
}
