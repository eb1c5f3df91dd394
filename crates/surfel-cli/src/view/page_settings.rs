//! Settings of a page as a scene description, and back.

use super::added_files::{self, PageFile, is_added};
use super::camera_path::{self, path_setting};
use super::rejection::rejection;
use super::rows::Rows;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::SceneDescription;
use surfel::description::rule::absolute_text;
use surfel::description::{
    Crop, Invalid, MaterialChoice, ObjectDescription, ObjectOverride, OrthographicHeight,
    OutputSettings, READ_ONCE, parse_table, write_table,
};
use surfel::file_names::file_name;
use surfel_web::{Error, Limits, SettingsMap};

/// Target of a material for everything, where a page names a target.
const EVERYTHING: &str = "*";

/// True for the settings of a file that count while it is read, and for its crop, which may be a file.
fn is_fixed(setting: &ObjectOverride) -> bool {
    setting.key == "crop" || READ_ONCE.contains(&setting.key.as_str())
}

/// Returns the settings of a description that a page sees.
pub fn shown(description: SceneDescription) -> SettingsMap {
    of_page(description).to_table()
}

/// Returns what a page sees of a description: nothing of files and what moves them, of output and run.
pub fn of_page(description: SceneDescription) -> SceneDescription {
    let mut shown = description.with_content_of(&SceneDescription::default());
    shown.output = OutputSettings { time: shown.output.time, ..OutputSettings::default() };
    (shown.run, shown.plan, shown.picture.bit_depth) = Default::default();
    // A page knows heights alone.
    shown.camera.orthographic.take_if(|height| *height == OrthographicHeight::Off);
    shown
}

/// The files and objects that settings of pages are about.
pub struct Content<'c> {
    /// The description with which the program was started.
    pub startup: &'c SceneDescription,
    /// The rows of its files and objects.
    pub rows: &'c Rows,
    /// The limits of the viewer.
    pub limits: &'c Limits,
    /// The files that the page has added.
    pub added: &'c [Arc<PageFile>],
}

/// Reads the settings of a page, which may say anything, over the files and objects of the startup and those that the
/// page has added.
pub fn read(content: &Content, settings: &SettingsMap) -> Result<SceneDescription, Error> {
    let &Content { startup, rows, limits, added } = content;
    let mut page = SceneDescription::default();
    let mut of_description = settings.clone();
    of_description.shift_remove(added_files::KEY);
    of_description.shift_remove(camera_path::KEY);
    camera_path::camera_path(settings)?;
    page.merge(&of_description).map_err(rejection)?;
    if page.light.environment.is_some() && page.get("environment") != startup.get("environment") {
        return Err(Error::invalid_value("environment", "a page cannot change this setting"));
    }
    let is_new = |key: &&&str| page.get(key).is_some() && page.get(key) != startup.get(key);
    if let Some(key) = READ_ONCE.iter().find(is_new) {
        return Err(Error::invalid_value(*key, "a page cannot change this setting"));
    }
    let crop = page.objects_default.preparation.crop.as_ref();
    if matches!(crop, Some(Crop::File(_))) && page.get("crop") != startup.get("crop") {
        return Err(Error::invalid_value("crop", "a page cannot name a file"));
    }
    let hidden = write_table(&page.output).into_iter().chain(write_table(&page.run));
    let mut hidden = hidden.chain(write_table(&page.plan));
    if let Some((key, _)) = hidden.find(|(key, _)| key != "time") {
        return Err(Error::invalid_value(key, "is not a setting of a page"));
    }
    for choice in page.materials.material.iter_mut().flatten() {
        choice.target.take_if(|target| target == EVERYTHING);
    }
    let is_known = |one: &ObjectOverride| startup.overrides.all().contains(one);
    let is_new = |one: &&ObjectOverride| is_fixed(one) && !is_known(one);
    if let Some(fault) = page.overrides.all().iter().find(is_new) {
        let text = format!("a page cannot change {} of a file", fault.key);
        return Err(Error::invalid_value("object_settings", text));
    }
    limits.check_samples(page.picture.spp(), page.picture.light_samples())?;
    page.run = startup.run.clone();
    page.rename_targets(|name| rows.target_of(name).to_owned());
    let mut page = page.with_content_of(startup);
    added.iter().for_each(|file| file.add_to(&mut page));
    page.apply_object_settings().map_err(rejection)?;
    // Files with settings of their own became objects behind them.
    page.objects.sort_by_key(is_added);
    Ok(page)
}

/// Returns the settings of a complete description as a page sees them, with targets as the page names them, and with what
/// belongs to the page alone.
pub fn complete_settings(
    complete: SceneDescription,
    requested: &SceneDescription,
    content: &Content,
    settings: &SettingsMap,
) -> SettingsMap {
    let (materials, overrides) = (requested.materials.clone(), requested.overrides.clone());
    let mut complete = SceneDescription { materials, overrides, ..complete };
    complete.output.time = Some(requested.output.time());
    complete.rename_targets(|target| content.rows.name_of(target).to_owned());
    let of_page = [added_files::KEY, camera_path::KEY].into_iter();
    let of_page = of_page.filter_map(|key| settings.get_key_value(key));
    let of_page: Vec<_> = of_page.map(|(key, value)| (key.clone(), value.clone())).collect();
    let mut complete = shown(complete);
    complete.extend(of_page);
    complete
}

/// Reads the settings of a scene file that a page sends, if its objects are those that are `served`. No file is opened.
pub fn from_file(
    name: &str,
    text: &str,
    served: &[String],
    content: &Content,
) -> Result<SettingsMap, Error> {
    let rows = content.rows;
    let rejected = |error: Invalid| Error::invalid_request(error.in_file(name).to_string());
    let is_json = name.to_ascii_lowercase().ends_with(".json");
    let table = parse_table(text, is_json).map_err(rejected)?;
    let is_served =
        |file: &str| served.iter().any(|known| known == file || Path::new(known).ends_with(file));
    // Before the objects are read: a pattern would list the files of a folder.
    if let Some(file) = object_files(&table).into_iter().find(|file| !is_served(file)) {
        return Err(rejected(Invalid::at("object", format!("`{file}` is not shown here"))));
    }
    let mut description = SceneDescription::from_table(&table, Path::new("")).map_err(rejected)?;
    let target = |object: &ObjectDescription| {
        let row = |file: &PathBuf| {
            let is_same = |other: &Path| absolute_text(other) == absolute_text(file);
            rows.meant(is_same).pop().unwrap_or_else(|| file_name(file))
        };
        let only = (object.files.len() == 1).then(|| row(&object.files[0]));
        object.name.clone().or(only).unwrap_or(EVERYTHING.to_owned())
    };
    let own = description.objects.iter().filter_map(|object| {
        let material = object.material.clone()?;
        Some(MaterialChoice { target: Some(target(object)), material })
    });
    let all = description.materials.choices().iter().cloned().chain(own).collect();
    let own = description.objects.iter().filter(|object| object.files.len() == 1);
    let own = own.flat_map(|object| ObjectOverride::all_of(object, &target(object)));
    let settings = description.overrides.all().iter().cloned().chain(own);
    // The files are read as at the start.
    let settings = settings.filter(|one| !is_fixed(one)).collect();
    description.rename_targets(|target| rows.name_of(target).to_owned());
    if table.contains_key("object") {
        // Objects without a material or settings have none, whatever the page chose before.
        description.materials.material = Some(all);
        description.overrides.object_settings = Some(settings);
    }
    let moves_camera = content.startup.animations.iter().any(|animation| animation.is_of_camera());
    let path = path_setting(&description).filter(|_| !moves_camera);
    let mut settings = shown(description);
    settings.extend(path.map(|path| (camera_path::KEY.to_owned(), path)));
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

#[cfg(test)]
mod tests {
    //! Scene files that a page sends.

    use super::*;
    use serde_json::json;
    use std::sync::LazyLock;

    static NO_ROWS: LazyLock<Rows> = LazyLock::new(Rows::default);
    static LIMITS: LazyLock<Limits> = LazyLock::new(Limits::default);

    fn content(startup: &SceneDescription) -> Content<'_> {
        Content { startup, rows: &NO_ROWS, limits: &LIMITS, added: &[] }
    }

    #[test]
    fn a_page_names_no_file_of_an_area() {
        let startup = SceneDescription::default();
        let with_area = |area: &str| {
            let settings = SettingsMap::from_iter([("crop".to_owned(), Value::from(area))]);
            read(&content(&startup), &settings).map(|page| page.objects_default.preparation.crop)
        };
        assert!(with_area("/etc/passwd").unwrap_err().to_string().contains("cannot name a file"));
        assert!(with_area("0,0,10,10").unwrap().is_some());
    }

    #[test]
    fn a_page_keeps_to_the_limits_of_its_viewer() {
        let startup = SceneDescription::default();
        let settings = SettingsMap::from_iter([("spp".to_owned(), json!(64))]);
        assert!(read(&content(&startup), &settings).is_ok());
        let limits = Limits { max_samples: 63, ..Limits::default() };
        let narrow = Content { limits: &limits, ..content(&startup) };
        assert_eq!(read(&narrow, &settings).unwrap_err().key(), Some("spp"));
    }

    #[test]
    fn a_page_changes_nothing_that_counts_while_files_are_read() {
        let with_settings = |settings: &[&str]| {
            SettingsMap::from_iter([("object_settings".to_owned(), json!(settings))])
        };
        let mut startup = SceneDescription::default();
        startup.merge(&with_settings(&["a.laz:salvage=true"])).unwrap();
        for settings in
            [&["a.laz:salvage=true", "a.laz:crop=/etc/passwd"][..], &["a.laz:vertices=true"]]
        {
            let error = read(&content(&startup), &with_settings(settings)).unwrap_err().to_string();
            assert!(error.contains("a page cannot change"), "{error}");
        }
    }

    #[test]
    fn scene_files_of_a_page_leave_out_what_counts_while_files_are_read() {
        let text = "[[object]]\nfile = \"a.laz\"\nsalvage = true\ncolor = \"class\"";
        let settings = from_file(
            "a.toml",
            text,
            &["/data/a.laz".to_owned()],
            &content(&SceneDescription::default()),
        )
        .unwrap();
        assert_eq!(settings["object_settings"], json!(["a.laz:color=class"]));
    }

    #[test]
    fn materials_of_objects_are_named_by_their_targets() {
        let text = r##"{ "material": "metal", "object": [
            { "file": "/data/a.ply", "material": { "kind": "glass", "ior": 1.3, "color": "#88ccff" } },
            { "name": "b", "file": "/data/b.obj", "material": "mirror" },
            { "files": ["/data/c.ply", "/data/d.ply"], "material": { "roughness": "0.4" } },
            { "file": "/data/e.ply" } ] }"##;
        let served =
            ["a.ply", "b.obj", "c.ply", "d.ply", "e.ply"].map(|name| format!("/data/{name}"));
        let settings =
            from_file("a.json", text, &served, &content(&SceneDescription::default())).unwrap();
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
        let from_file =
            |text: &str| from_file("a.toml", text, &served, &content(&SceneDescription::default()));
        let settings = from_file("spp = 9\ntime = 2\n[[object]]\nfile = \"scan.laz\"");
        assert_eq!(
            Value::Object(settings.unwrap()),
            json!({ "time": 2.0, "spp": 9, "material": [], "object_settings": [] })
        );
        for wrong in ["[[object]]\nfile = \"/etc/passwd\"", "object = { files = [\"x\"] }", "spp ="]
        {
            assert!(from_file(wrong).is_err(), "{wrong}");
        }
    }
}
