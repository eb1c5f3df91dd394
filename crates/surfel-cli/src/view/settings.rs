//! Settings of a page as options of the program, and back.

use crate::args::{SceneArgs, Usage};
use crate::scene_file::{Line, TABLES};
use crate::shell::quoted;
use serde_json::{Value, json};
use std::path::Path;
use surfel_web::limits::{MOST_RAYS, MOST_SAMPLES, MOST_SAVED_PIXELS, check_size};
use surfel_web::{Error, Keys, Written};

/// Keys that name files: they stay as the program was started.
const FIXED: [&str; 1] = ["environment"];
/// Keys of a dry run that say nothing about what is seen.
const TOLD: [&str; 3] = ["info", "output", "bit_depth"];
/// Stands for all that is seen, where a material is for an object.
pub const EVERYTHING: &str = "*";

/// Settings as options.
pub struct Asked {
    pub args: SceneArgs,
    pub line: Line,
    pub time: f64,
    pub materials: Option<Value>,
}

/// Reads the settings of a page, which may say anything.
pub fn read(line: &Line, given: &Keys, settings: &Keys) -> Result<Asked, Error> {
    let mut settings = settings.clone();
    for key in FIXED {
        if settings.contains_key(key) && settings.get(key) != given.get(key) {
            return Err(Error::Refused(format!("{key}: is not to be changed from a page")));
        }
    }
    let time = match settings.shift_remove("time") {
        None => 0.0,
        Some(time) => time_of(&time)?,
    };
    let materials = settings.get("material").cloned();
    settings.get_mut("material").into_iter().for_each(for_everything);
    let (args, line) = line.under(&settings).map_err(Error::Refused)?;
    args.check().map_err(|Usage(text)| Error::Refused(text))?;
    let most = args.picture.spp.max(args.picture.samples);
    if MOST_SAMPLES < most {
        let text = format!("spp, samples: found {most}, expected at most {MOST_SAMPLES}");
        return Err(Error::Refused(text));
    }
    Ok(Asked { args, line, time, materials })
}

fn time_of(value: &Value) -> Result<f64, Error> {
    let number = match value {
        Value::String(text) => text.parse().ok(),
        value => value.as_f64(),
    };
    let time = number.filter(|time| (0.0..1e6).contains(time));
    time.ok_or_else(|| Error::Refused(format!("time: found {value}, expected seconds")))
}

/// Takes the name away of materials that are for all.
fn for_everything(materials: &mut Value) {
    let strip = |value: &mut Value| {
        let plain = value.as_str().and_then(|text| text.strip_prefix("*="));
        if let Some(plain) = plain.map(str::to_owned) {
            *value = Value::String(plain);
        }
    };
    match materials {
        Value::Array(list) => list.iter_mut().for_each(strip),
        other => strip(other),
    }
}

/// Fails for pictures that would fill the memory or take days.
pub fn check_work(args: &SceneArgs) -> Result<(), Error> {
    let (width, height) = args.picture.resolution;
    check_size(width, height, MOST_SAVED_PIXELS).map_err(Error::Refused)?;
    let rays = u64::from(args.picture.spp) + u64::from(args.picture.samples);
    let rays = u64::from(width) * u64::from(height) * rays;
    if MOST_RAYS < rays {
        let text = format!("resolution, spp, samples: {rays} rays, expected at most {MOST_RAYS}");
        return Err(Error::Refused(text));
    }
    Ok(())
}

/// What a dry run tells, as a page may see it: without files.
pub fn complete(told: Value, asked: &Asked, stops: f32) -> Keys {
    let Value::Object(mut settings) = told else { return Keys::new() };
    for key in TABLES.iter().chain(&TOLD) {
        settings.shift_remove(*key);
    }
    settings.insert("exposure".into(), json!(stops));
    settings.insert("time".into(), json!(asked.time));
    if let Some(materials) = &asked.materials {
        settings.insert("material".into(), materials.clone());
    }
    settings
}

/// A scene file's settings, if its objects are those that `served` holds.
pub fn from_file(name: &str, text: &str, served: &[String]) -> Result<Keys, Error> {
    let refused = |text: String| Error::Refused(format!("{name}: {text}"));
    let is_json = name.to_ascii_lowercase().ends_with(".json");
    let value: Value = if is_json {
        serde_json::from_str(text).map_err(|error| refused(error.to_string()))?
    } else {
        toml::from_str(text).map_err(|error| refused(error.message().to_owned()))?
    };
    let Value::Object(mut settings) = value else {
        return Err(refused("expected keys and values".into()));
    };
    let objects = listed(settings.get("object"));
    let files = objects.iter().flat_map(|object| [object.get("file"), object.get("files")]);
    for file in files.flat_map(listed).filter_map(Value::as_str) {
        if !served.iter().any(|known| known == file || known.ends_with(&format!("/{file}"))) {
            return Err(refused(format!("object `{file}` is not what is viewed here")));
        }
    }
    if !objects.is_empty() {
        let of_all = listed(settings.get("material")).into_iter().cloned();
        let of_objects = objects.iter().filter_map(|object| material_of(object));
        let materials = of_all.chain(of_objects.map(Value::String)).collect();
        settings.insert("material".into(), Value::Array(materials));
    }
    for key in TABLES.iter().chain(&TOLD) {
        settings.shift_remove(*key);
    }
    Ok(settings)
}

/// A list, or the only one in its place.
fn listed(value: Option<&Value>) -> Vec<&Value> {
    match value {
        Some(Value::Array(several)) => several.iter().collect(),
        only => only.into_iter().collect(),
    }
}

/// An object's own material, as `--material` names it.
fn material_of(object: &Value) -> Option<String> {
    let file = || Path::new(object.get("file")?.as_str()?).file_name()?.to_str();
    let name = object.get("name").and_then(Value::as_str).or_else(file).unwrap_or(EVERYTHING);
    let material = match object.get("material")? {
        Value::Object(table) => {
            let kind = table.get("kind").and_then(Value::as_str).unwrap_or("matte");
            let others = table.iter().filter(|(key, _)| *key != "kind");
            let pairs: Vec<String> =
                others.map(|(key, value)| format!("{key}={}", word(value))).collect();
            if pairs.is_empty() { kind.to_owned() } else { format!("{kind}:{}", pairs.join(",")) }
        }
        kind => word(kind),
    };
    Some(format!("{name}={material}"))
}

fn word(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Settings for use elsewhere: words of a command line, and a scene file's text.
pub fn written(asked: &Asked, files: &[String], scene: &Value) -> Result<Written, Error> {
    let mut words: Vec<String> = files.iter().cloned().chain(asked.line.told()).collect();
    if 0.0 < asked.time {
        words.push(format!("--time={}", asked.time));
    }
    let words: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    let toml = toml::to_string_pretty(scene).map_err(|error| Error::Refused(error.to_string()))?;
    Ok(Written {
        command: format!("surfel render {} -o picture.png", words.join(" ")),
        toml,
        json: format!("{scene:#}"),
    })
}

pub fn refusal(error: anyhow::Error) -> Error {
    match error.downcast_ref::<surfel::Error>() {
        Some(surfel::Error::Cancelled) => Error::Cancelled,
        _ => Error::Refused(format!("{error:#}").replace('\n', " ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_of_objects_are_those_of_the_line() {
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
            "a.ply=glass:ior=1.3,color=#88ccff",
            "b=mirror",
            "*=matte:roughness=0.4"
        ]);
        assert_eq!(settings["material"], expected);
    }

    #[test]
    fn a_scene_file_of_other_objects_is_refused() {
        let served = ["/data/scan.laz".to_owned()];
        let settings = from_file("a.toml", "spp = 9\n[[object]]\nfile = \"scan.laz\"", &served);
        assert_eq!(Value::Object(settings.unwrap()), json!({ "spp": 9, "material": [] }));
        for wrong in ["[[object]]\nfile = \"/etc/passwd\"", "object = { files = [\"x\"] }", "spp ="]
        {
            assert!(from_file("a.toml", wrong, &served).is_err(), "{wrong}");
        }
    }
}
