//! Settings of a page as a scene description, and back.

use crate::options::words;
use crate::shell::quoted;
use serde_json::{Map, Value, json};
use std::path::Path;
use surfel::SceneDescription;
use surfel::description::{Invalid, MaterialChoice, TABLES, parse_table};
use surfel::names::file_name;
use surfel_web::{Error, Export, Limits, SettingsMap};

/// Keys that name files: they stay as the program was started.
const READ_ONLY_KEYS: [&str; 1] = ["environment"];

/// Keys of the program's run and of its output, which are no settings of a page.
const OUTPUT_KEYS: [&str; 9] = [
    "info",
    "output",
    "frames",
    "fps",
    "turntable",
    "bit_depth",
    "threads",
    "memory_limit",
    "backend",
];

/// Target of a material for everything, where a page names a target.
pub const EVERYTHING: &str = "*";

/// Reads the settings of a page, which may say anything, over the files and objects of `startup`.
pub fn read(
    startup: &SceneDescription,
    startup_settings: &SettingsMap,
    settings: &SettingsMap,
) -> Result<SceneDescription, Error> {
    for key in READ_ONLY_KEYS {
        if settings.contains_key(key) && settings.get(key) != startup_settings.get(key) {
            return Err(Error::invalid_value(key, "a page cannot change this setting"));
        }
    }
    for key in OUTPUT_KEYS.iter().filter(|key| **key != "bit_depth") {
        if settings.contains_key(*key) {
            return Err(Error::invalid_value(*key, "is not a setting of a page"));
        }
    }
    let mut description = SceneDescription {
        files: startup.files.clone(),
        objects: startup.objects.clone(),
        lamps: startup.lamps.clone(),
        animations: startup.animations.clone(),
        run: startup.run.clone(),
        ..SceneDescription::default()
    };
    description.merge(settings).map_err(invalid)?;
    for choice in &mut description.materials {
        choice.target.take_if(|target| target == EVERYTHING);
    }
    let max_samples = Limits::default().max_samples;
    let picture = &description.picture;
    for (key, found) in [("spp", picture.spp()), ("light_samples", picture.light_samples())] {
        if max_samples < found {
            let text = format!("found {found}, expected at most {max_samples}");
            return Err(Error::invalid_value(key, text));
        }
    }
    Ok(description)
}

/// Returns the settings that the program was started with, without automatic choices.
pub fn startup_settings(startup: &SceneDescription) -> SettingsMap {
    let mut settings = startup.to_table();
    settings.shift_remove("time");
    without_files(settings)
}

/// Returns a complete description as a page may see it: without files. `requested` has the materials as the page
/// names them.
pub fn complete_settings(complete: &SceneDescription, requested: &SceneDescription) -> SettingsMap {
    let mut settings = without_files(complete.to_table());
    settings.insert("time".into(), json!(requested.output.time()));
    settings.extend(requested.get("material").map(|value| ("material".to_owned(), value)));
    settings
}

fn without_files(mut settings: Map<String, Value>) -> SettingsMap {
    for key in TABLES.iter().chain(&OUTPUT_KEYS) {
        settings.shift_remove(*key);
    }
    settings
}

/// Fails for pictures that would fill the memory or take days.
pub fn check_work(description: &SceneDescription) -> Result<(), Error> {
    let picture = &description.picture;
    let (width, height) = picture.resolution();
    Limits::default().check_save_size(width, height)?;
    let max_rays = Limits::default().max_rays;
    let rays = u64::from(picture.spp()) + u64::from(picture.light_samples());
    let rays = u64::from(width) * u64::from(height) * rays;
    if max_rays < rays {
        let text = format!("{rays} rays, expected at most {max_rays}; choose fewer samples");
        return Err(Error::invalid_value("resolution", text));
    }
    Ok(())
}

/// Reads the settings of a scene file that a page sends, if its objects are those that are `served`. No file is opened.
pub fn from_file(name: &str, text: &str, served: &[String]) -> Result<SettingsMap, Error> {
    let rejected = |error: Invalid| Error::invalid_request(error.in_file(name).to_string());
    let is_json = name.to_ascii_lowercase().ends_with(".json");
    let table = parse_table(text, is_json).map_err(rejected)?;
    let is_served = |file: &str| {
        served.iter().any(|known| known == file || known.ends_with(&format!("/{file}")))
    };
    // Before the objects are read: a pattern would list the files of a folder.
    if let Some(file) = object_files(&table).into_iter().find(|file| !is_served(file)) {
        return Err(rejected(Invalid::at("object", format!("`{file}` is not shown here"))));
    }
    let mut description = SceneDescription::from_table(&table, Path::new("")).map_err(rejected)?;
    for object in std::mem::take(&mut description.objects) {
        let only = (object.files.len() == 1).then(|| file_name(&object.files[0]));
        let target = object.name.or(only).unwrap_or(EVERYTHING.to_owned());
        let choice = |material| MaterialChoice { target: Some(target), material };
        description.materials.extend(object.material.map(choice));
    }
    let mut settings = without_files(description.to_table());
    if table.contains_key("object") {
        // Objects without a material have none, whatever the page chose before.
        settings.entry("material").or_insert(json!([]));
    }
    Ok(settings)
}

/// Returns the files that the objects of a scene file name.
fn object_files(table: &SettingsMap) -> Vec<&str> {
    fn elements(value: &Value) -> &[Value] {
        value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice)
    }
    let objects = table.get("object").map_or(&[][..], elements).iter();
    let named = objects.flat_map(|object| [object.get("file"), object.get("files")]);
    named.flatten().flat_map(elements).filter_map(Value::as_str).collect()
}

/// Writes a description for use elsewhere: as words of a command line, and as the text of a scene file.
pub fn export(
    requested: &SceneDescription,
    files: &[String],
    complete: &SceneDescription,
    scene: &Value,
) -> Result<Export, Error> {
    let mut all = files.to_vec();
    all.extend(words(&requested.non_default()));
    let all: Vec<String> = all.iter().map(|word| quoted(word)).collect();
    let toml = toml::to_string_pretty(complete);
    Ok(Export {
        command: format!("surfel render {} -o picture.png", all.join(" ")),
        toml: toml.map_err(|error| Error::invalid_request(error.to_string()))?,
        json: format!("{scene:#}"),
    })
}

/// Returns an error as a page shows it, with the key of the control that it belongs to.
pub fn rejection(error: surfel::Error) -> Error {
    match error {
        error if error.is_cancelled() => Error::Cancelled,
        surfel::Error::Invalid(error) => invalid(error),
        error => Error::invalid_request(error.to_string().replace('\n', " ")),
    }
}

fn invalid(error: Invalid) -> Error {
    let text = error.reason();
    match error.path.as_str() {
        "" => Error::invalid_request(text),
        path => Error::invalid_value(path, text),
    }
}

#[cfg(test)]
mod tests {
    //! Scene files that a page sends.

    use super::*;

    #[test]
    fn materials_of_objects_are_named_by_their_targets() {
        let text = r##"{ "material": "metal", "object": [
            { "file": "/data/a.ply", "material": { "kind": "glass", "ior": 1.3, "color": "#88ccff" } },
            { "name": "b", "file": "/data/b.obj", "material": "mirror" },
            { "files": ["/data/c.ply", "/data/d.ply"], "material": { "roughness": "0.4" } },
            { "file": "/data/e.ply" } ] }"##;
        let served =
            ["a.ply", "b.obj", "c.ply", "d.ply", "e.ply"].map(|name| format!("/data/{name}"));
        let settings = from_file("a.json", text, &served).unwrap();
        let expected = json!([
            "metal",
            "a.ply=glass:color=#88ccff,ior=1.3",
            "b=mirror",
            "*=matte:roughness=0.4"
        ]);
        assert_eq!(settings["material"], expected);
    }

    #[test]
    fn a_scene_file_of_other_objects_is_rejected() {
        let served = ["/data/scan.laz".to_owned()];
        let settings = from_file("a.toml", "spp = 9\n[[object]]\nfile = \"scan.laz\"", &served);
        assert_eq!(Value::Object(settings.unwrap()), json!({ "spp": 9, "material": [] }));
        for wrong in ["[[object]]\nfile = \"/etc/passwd\"", "object = { files = [\"x\"] }", "spp ="]
        {
            assert!(from_file("a.toml", wrong, &served).is_err(), "{wrong}");
        }
    }
}
