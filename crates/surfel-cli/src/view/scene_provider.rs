//! Scenes of the files that the viewer was started with, by the settings of its pages.

use super::added_files::{self, AddedFiles, PageFile};
use super::camera_path::{camera_path, with_path, write_movie};
use super::facts::{
    classes, colors, coordinate_system_facts, filter_columns, has_returns, name, stations,
    surfaces, unit_symbol,
};
use super::file_names::{ClientProgress, ViewedFolders};
use super::freed_memory;
use super::histogram::histogram;
use super::legend::legend_json;
use super::page_camera::page_camera;
use super::page_overlay::page_overlay;
use super::page_settings::{self, Content};
use super::point::{describe, locate};
use super::rejection::rejection;
use super::rows::{Rows, bounds_json, name_by_rows};
use super::shown_points::write_shown_points;
use crate::render::with_info;
use crate::report::Report;
use crate::shell::command_line;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use surfel::SceneDescription;
use surfel::description::rule::absolute_text;
use surfel::description::{CameraSettings, ObjectDescription, write_table};
use surfel::live_scene::{LiveScene, UseCase};
use surfel::live_view::{LiveView, SceneTrees};
use surfel::overlay;
use surfel::resolve::{AutoSettings, LoadedScene};
use surfel_core::flat::PointId;
use surfel_core::image::colormap;
use surfel_core::math::Vec3;
use surfel_core::points::PointCloud;
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::scene::color::ColorSource;
use surfel_core::scene::{Camera, Graph, Material};
use surfel_web::{
    AddedFile, Error, Export, Limits, MovieRequest, PickedPoint, PointDescriber, PointLocator,
    PreparedScene, Result, SceneProvider, SentFile, SettingsMap, WrittenFile,
};

/// The scenes of one set of files.
pub struct FileSceneProvider {
    startup: SceneDescription,
    startup_settings: SettingsMap,
    /// Files as they were typed, scene files among them.
    typed: Vec<PathBuf>,
    rows: Rows,
    limits: Limits,
    added_files: AddedFiles,
    scene: Arc<LiveScene>,
    up: Vec3,
    /// True if the scene moves its camera.
    moves_camera: bool,
    /// The cameras at the stations of its scans.
    stations: Vec<Value>,
    folders: ViewedFolders,
    /// The facts about the data, which are found by looking at all points.
    info: Value,
    /// The initial settings of the last page, by the size of its picture.
    initial_settings: Mutex<Option<((u32, u32), SettingsMap)>>,
}

/// Number of points of a preview; clouds that are not much larger need none.
const PREVIEW_POINTS: usize = 150_000;

impl FileSceneProvider {
    /// Reads the files that the program was started with. Choices are reported once; pages make their own again.
    pub fn open(
        mut startup: SceneDescription,
        typed: Vec<PathBuf>,
        limits: Limits,
        report: &Report,
    ) -> surfel::Result<Self> {
        let scene = LiveScene::open(&startup, UseCase::Viewers, report)?;
        let rows = Rows::of(&startup);
        name_by_rows(&mut startup, &rows);
        let (_, auto) = scene.choose(scene.startup(), report)?;
        let moves_camera = auto.moves_camera(scene.loaded());
        let mut startup_settings = page_settings::shown(startup.clone());
        startup_settings.shift_remove("time");
        let stations = stations(scene.loaded(), auto.up);
        let (scene, up) = (Arc::new(scene), auto.up);
        let folders = viewed_folders(&startup, &typed);
        let mut provider = Self {
            startup,
            startup_settings,
            typed,
            rows,
            limits,
            added_files: AddedFiles::default(),
            scene,
            up,
            moves_camera,
            stations,
            folders,
            info: Value::Null,
            initial_settings: Mutex::default(),
        };
        provider.info = provider.facts();
        Ok(provider)
    }

    fn read(&self, settings: &SettingsMap) -> Result<SceneDescription> {
        let added = self.added_files.listed(settings)?;
        page_settings::read(&self.content(&added), settings)
    }

    fn content<'c>(&'c self, added: &'c [Arc<PageFile>]) -> Content<'c> {
        Content { startup: &self.startup, rows: &self.rows, limits: &self.limits, added }
    }

    fn view(&self, description: &SceneDescription, progress: &dyn Progress) -> Result<LiveView> {
        let progress = ClientProgress { folders: &self.folders, progress };
        self.folders.removed(self.scene.view(description, &progress).map_err(rejection))
    }

    fn prepare_by(
        &self,
        settings: &SettingsMap,
        view: impl FnOnce(&SceneDescription) -> Result<LiveView>,
    ) -> Result<PreparedScene> {
        let added = self.added_files.listed(settings)?;
        let content = self.content(&added);
        let description = page_settings::read(&content, settings)?;
        let view = view(&description)?;
        let camera = || Value::Object(write_table(&CameraSettings::of(&view.flat.camera)));
        Ok(PreparedScene {
            animated_camera: view.moves_camera.then(camera),
            render_settings: view.settings,
            goes_on_at_rest: self.startup.picture.spp.is_none()
                && description.picture.spp() == SceneDescription::default().picture.spp(),
            legend: legend_json(&view.trees.legend),
            overlay: page_overlay(view.overlay()),
            describe: describer(&view, description.output.time()),
            locate: locator(&view, description.output.time()),
            settings: complete_settings(
                view.description,
                &description,
                &content,
                settings,
                view.color_source,
            ),
            flat: view.flat,
        })
    }

    fn choose(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<Chosen> {
        let description = self.read(settings)?;
        let progress = ClientProgress { folders: &self.folders, progress };
        let chosen = self.scene.choose(&description, &progress).map_err(rejection);
        let (kept, auto) = self.folders.removed(chosen)?;
        Ok(Chosen { description, kept, auto })
    }

    fn choose_initial_settings(&self, width: u32, height: u32) -> SettingsMap {
        let mut settings = self.startup_settings.clone();
        settings.insert("resolution".into(), json!(format!("{width}x{height}")));
        let complete = || {
            let Chosen { description, kept, auto } = self.choose(&settings, &NoProgress).ok()?;
            let complete = auto.complete_description(&kept);
            let (content, source) = (self.content(&[]), kept.color_source());
            let mut initial =
                complete_settings(complete, &description, &content, &settings, source);
            // Chosen once there is something to see.
            initial.shift_remove("exposure");
            let exposure = self.startup_settings.get("exposure").cloned();
            initial.extend(exposure.map(|exposure| ("exposure".to_owned(), exposure)));
            Some(initial)
        };
        // What was valid at the start is so for every size.
        complete().unwrap_or(settings.clone())
    }

    fn facts(&self) -> Value {
        let loaded = self.scene.loaded();
        let points = loaded.sample_points();
        let (n_points, n_triangles) = loaded.graph.n_points_and_triangles();
        let (coordinate_system, epsg) = coordinate_system_facts(loaded, &self.startup);
        json!({
            "name": name(&self.typed, &self.rows, (n_points, n_triangles)),
            "points": n_points,
            "triangles": n_triangles,
            "version": env!("CARGO_PKG_VERSION"),
            "bounds": bounds_json(&points),
            "up": self.up.to_array(),
            "surfaces": surfaces(loaded),
            "colors": colors(loaded),
            "colormaps": colormap::names().collect::<Vec<_>>(),
            "materials": Material::NAMED.map(|(name, _)| name),
            "objects": self.objects(),
            "duration_secs": loaded.duration_secs(),
            "camera_moves": self.moves_camera,
            "stations": self.stations,
            "classes": classes(loaded),
            "has_returns": has_returns(loaded),
            "columns": filter_columns(loaded),
            "threads": self.scene.n_threads(),
            "simd": self.scene.simd().name(),
            "coordinate_system": coordinate_system,
            "epsg": epsg,
            "unit": unit_symbol(loaded, &self.startup),
        })
    }

    /// The files and objects that pages change apart, each with its name, kind, number of points or triangles, and notes.
    fn objects(&self) -> Vec<Value> {
        let loaded = self.scene.loaded();
        let read_files = &loaded.read_files;
        let mut names = self.rows.names().into_iter();
        let mut row = |files: &[PathBuf], own: &ObjectDescription, bounds: Option<Value>| {
            let read = || read_files.iter().filter(|read| files.contains(&read.path));
            let n_triangles = read().map(|read| read.n_triangles).sum::<usize>();
            let notes = read().flat_map(|read| &read.notes);
            let notes = notes.map(|note| self.folders.removed_from(note));
            json!({
                "name": names.next(),
                "label": own.label,
                "kind": if 0 < n_triangles { "triangles" } else { "points" },
                "points": read().map(|read| read.n_points).sum::<usize>(),
                "triangles": n_triangles,
                "notes": notes.collect::<Vec<String>>(),
                "visible": own.visible(),
                "color": own.settings.color.color.as_ref().map(ToString::to_string),
                "bounds": bounds,
            })
        };
        let none = ObjectDescription::default();
        let files = self.startup.files.iter();
        let bounds_of = |file: &PathBuf| {
            let read = read_files.iter().find(|read| read.path == *file)?;
            let [min, max] = read.bounds.map(|corner| corner.to_array());
            Some(json!({ "min": min, "max": max }))
        };
        let mut all: Vec<Value> =
            files.map(|file| row(std::slice::from_ref(file), &none, bounds_of(file))).collect();
        for (i, object) in self.startup.objects.iter().enumerate() {
            let bounds = bounds_json(&loaded.sample_points_of_object(i));
            all.push(row(&object.files, object, Some(bounds)));
        }
        all
    }
}

/// A description of a page's settings, and what is chosen for it from the data.
struct Chosen {
    description: SceneDescription,
    kept: Arc<LoadedScene>,
    auto: AutoSettings,
}

impl Chosen {
    /// Returns its settings without those that pictures of its camera lack.
    fn drawable(&self, settings: &SettingsMap) -> SettingsMap {
        let mut drawable = settings.clone();
        let camera = &self.auto.camera.camera;
        for fault in overlay::faults(&self.description.picture, camera, self.auto.up) {
            drawable.shift_remove(&fault.path);
        }
        drawable
    }
}

/// Describes the points of a view at a time.
fn describer(view: &LiveView, time_secs: f64) -> PointDescriber {
    let (loaded, trees) = (view.loaded.clone(), view.trees.clone());
    Arc::new(move |flat, picked: &PickedPoint| {
        describe(&loaded, &trees, flat, &graph_at(&trees, time_secs), picked)
    })
}

/// Finds the points of a view at a time.
fn locator(view: &LiveView, time_secs: f64) -> PointLocator {
    let (loaded, trees) = (view.loaded.clone(), view.trees.clone());
    Arc::new(move |flat, points: &[PointId]| {
        locate(&loaded, &trees, flat, &graph_at(&trees, time_secs), points)
    })
}

fn graph_at(trees: &SceneTrees, time_secs: f64) -> Cow<'_, Graph> {
    let mut graph = Cow::Borrowed(&trees.graph);
    if !graph.animation.channels.is_empty() {
        graph.to_mut().evaluate_at(time_secs);
    }
    graph
}

/// Returns the settings of a complete description as a page sees them. `source` stands for colours that are left open.
fn complete_settings(
    complete: SceneDescription,
    requested: &SceneDescription,
    content: &Content,
    settings: &SettingsMap,
    source: Option<ColorSource>,
) -> SettingsMap {
    let mut settings = page_settings::complete_settings(complete, requested, content, settings);
    if let Some(source) = source.filter(|_| !settings.contains_key("color")) {
        settings.insert("color".into(), json!(source.to_string()));
    }
    settings
}

/// Returns a scene file in TOML, in whose folder added files lie.
fn toml_of(description: &SceneDescription) -> Result<String> {
    let text = toml::to_string_pretty(description);
    let text = text.map_err(|error| Error::invalid_request(error.to_string()))?;
    Ok(added_files::with_relative_paths(&text))
}

/// The files of the command line and of objects.
fn all_files(startup: &SceneDescription) -> impl Iterator<Item = &PathBuf> {
    let objects = startup.objects.iter().flat_map(|object| &object.files);
    startup.files.iter().chain(objects)
}

/// The folders of all files that a scene is made of.
pub fn viewed_folders(startup: &SceneDescription, typed: &[PathBuf]) -> ViewedFolders {
    ViewedFolders::of(startup.named_files().chain(typed).map(PathBuf::as_path))
}

impl SceneProvider for FileSceneProvider {
    fn info(&self) -> Value {
        self.info.clone()
    }

    fn initial_settings(&self, width: u32, height: u32) -> SettingsMap {
        // Choosing a camera takes as long as all else that a page waits for, and most pages have one size.
        let known = || self.initial_settings.lock().unwrap_or_else(PoisonError::into_inner);
        let of_size = known().clone().filter(|(size, _)| *size == (width, height));
        if let Some((_, settings)) = of_size {
            return settings;
        }
        let settings = self.choose_initial_settings(width, height);
        *known() = Some(((width, height), settings.clone()));
        settings
    }

    fn startup_settings(&self) -> SettingsMap {
        self.startup_settings.clone()
    }

    fn camera(&self, settings: &Value) -> Result<Camera> {
        page_camera(settings)
    }

    fn preview(
        &self,
        settings: &SettingsMap,
        progress: &dyn Progress,
    ) -> Option<Result<PreparedScene>> {
        let (n_points, _) = self.scene.loaded().graph.n_points_and_triangles();
        if n_points < 3 * PREVIEW_POINTS || settings.contains_key("subsample") {
            return None;
        }
        if self.read(settings).is_ok_and(|description| self.scene.is_prepared(&description)) {
            return None;
        }
        let mut reduced = settings.clone();
        reduced.insert("subsample".into(), json!(format!("random:{PREVIEW_POINTS}")));
        // Fewer points surround less.
        reduced.insert("edge_test".into(), json!("off"));
        let scene = self.prepare_by(&reduced, |description| {
            let progress = ClientProgress { folders: &self.folders, progress };
            self.folders.removed(self.scene.preview(description, &progress).map_err(rejection))
        });
        // The page keeps its settings; what was chosen from few points is chosen again from all.
        Some(scene.map(|scene| PreparedScene { settings: settings.clone(), ..scene }))
    }

    fn prepare(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<PreparedScene> {
        self.prepare_by(settings, |description| self.view(description, progress))
    }

    fn render_png(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<Vec<u8>> {
        let description = self.read(settings)?;
        let picture = &description.picture;
        let rays_per_pixel = u64::from(picture.spp()) + u64::from(picture.light_samples());
        self.limits.check_save(picture.resolution(), rays_per_pixel)?;
        let view = self.view(&description, progress)?;
        let (up, camera) = (view.description.world.up.unwrap_or(self.up), &view.flat.camera);
        if let Some(fault) = overlay::faults(picture, camera, up).into_iter().next() {
            return Err(rejection(fault));
        }
        let image = self.scene.render(&view, progress).map_err(rejection);
        view.finished(self.folders.removed(image)?).png_bytes().map_err(rejection)
    }

    fn drawable_settings(&self, settings: &SettingsMap, progress: &dyn Progress) -> SettingsMap {
        let chosen = self.choose(settings, progress);
        chosen.map_or_else(|_| settings.clone(), |chosen| chosen.drawable(settings))
    }

    fn histogram(&self, column: &str) -> Result<Value> {
        let clouds: Vec<&PointCloud> =
            self.scene.loaded().clouds().map(|(_, cloud)| cloud).collect();
        Ok(histogram(&clouds, column)?)
    }

    fn write_points(
        &self,
        settings: &SettingsMap,
        format: &str,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn WrittenFile>> {
        let description = self.read(settings)?;
        let view = self.view(&description, progress)?;
        let time_secs = description.output.time();
        self.folders.removed(write_shown_points(&view, time_secs, format, progress))
    }

    fn write_movie(
        &self,
        settings: &SettingsMap,
        options: &MovieRequest,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn WrittenFile>> {
        let text = "there is no path of the camera; add views to it";
        let path = camera_path(settings)?.ok_or_else(|| Error::invalid_request(text))?;
        let description = with_path(self.read(settings)?, path);
        self.folders.removed(write_movie(&self.scene, description, options, &self.limits, progress))
    }

    fn stated_bytes(&self, file: &SentFile) -> Result<u64> {
        added_files::stated_bytes(file.name, file.bytes)
    }

    fn read_added_file(
        &self,
        file: &SentFile,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn AddedFile>> {
        let file = PageFile::read(file, &self.rows.names(), progress)?;
        Ok(self.added_files.insert(file))
    }

    fn release(&self) {
        self.scene.release();
        freed_memory::give_back();
    }

    fn export(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<Export> {
        let mut chosen = self.choose(settings, progress)?;
        let drawable = chosen.drawable(settings);
        if drawable != *settings {
            chosen = self.choose(&drawable, progress)?;
        }
        let Chosen { description, kept, auto } = chosen;
        let mut complete = auto.complete_description(&kept);
        let path = camera_path(settings)?;
        let movie = path.clone().map(|path| toml_of(&with_path(complete.clone(), path)));
        if let Some(path) = path {
            complete = with_path(complete, path);
            // The picture shows this view.
            complete.camera.lock = Some(true);
        }
        let mut words: Vec<String> = ["surfel", "render"].map(str::to_owned).into();
        words.extend(self.typed.iter().map(|file| file.display().to_string()));
        words.extend(added_files::words(&description));
        words.extend(description.to_options_over(&page_settings::of_page(self.startup.clone())));
        words.extend(["-o", "picture.png"].map(str::to_owned));
        Ok(Export {
            command: command_line(&words),
            toml: toml_of(&complete)?,
            movie: movie.transpose()?,
            json: added_files::with_relative_paths(&format!("{:#}", with_info(&complete, &kept))),
        })
    }

    fn read_scene_file(&self, name: &str, text: &str) -> Result<SettingsMap> {
        let served: Vec<String> =
            all_files(&self.startup).chain(&self.typed).map(|file| absolute_text(file)).collect();
        page_settings::from_file(name, text, &served, &self.content(&[]))
    }
}

#[cfg(test)]
mod tests;
