//! Scenes of the files that the viewer was started with, by the settings of its pages.

use super::legend::legend;
use super::made::{INDEX, Made, Recent, number_points, prepared};
use super::point;
use super::settings::{self, Asked, EVERYTHING};
use crate::args::{Exposure, Global, SceneArgs};
use crate::assemble::{Assembly, file_name, name_files};
use crate::picture::{self, Choices};
use crate::report::{Report, Verbosity};
use crate::scene_file::Line;
use crate::{dry_run, light};
use anyhow::Context;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::flat::FlatScene;
use surfel::image::colormap;
use surfel::math::Vec3;
use surfel::points::PointCloud;
use surfel::progress::Progress;
use surfel::render::{self, CpuRenderer, Renderer};
use surfel::scene::color::choose;
use surfel::scene::{Graph, Material, usual_bounds};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_web::limits::{MOST_BYTES, MOST_PIXELS, MOST_SAVED_PIXELS};
use surfel_web::{Keys, Place, Result, Stage, Studio, Written};

pub struct ScanStudio {
    line: &'static Line,
    base: Assembly<'static>,
    given: Keys,
    up: Vec3,
    /// Whether the scene moves its camera.
    moves_camera: bool,
    prepared: Recent<Vec<PointCloud>>,
    made: Recent<Made>,
    renderer: CpuRenderer,
    /// Threads beside those that paint: what one page asks for must not hold up another's picture.
    workshop: rayon::ThreadPool,
}

/// Points of a sketch; clouds that are not much larger need none.
const SKETCH: usize = 150_000;

impl ScanStudio {
    /// Reads the files that the program was started with.
    pub fn open(line: Line, global: &Global, report: &Report) -> anyhow::Result<Self> {
        // Both are held for as long as the program runs.
        let line: &'static Line = Box::leak(Box::new(line));
        let args: &'static SceneArgs = Box::leak(Box::new(line.scene_args()?));
        let mut base = picture::load(args, line, global, report)?;
        number_points(&mut base.graph);
        let given = line.settings();
        let workshop = rayon::ThreadPoolBuilder::new()
            .num_threads(rayon::current_num_threads())
            .build()
            .context("the threads cannot be started; ask for fewer with --threads")?;
        let studio = Self {
            line,
            base,
            given,
            up: Vec3::Z,
            moves_camera: false,
            prepared: Recent::default(),
            made: Recent::default(),
            renderer: CpuRenderer { simd: Simd::detect() },
            workshop,
        };
        // Choices are told once; pages make their own again.
        let asked = settings::read(line, &studio.given, &studio.given)?;
        let choices = picture::choose(&studio.base, &asked.args, report)?;
        let moves_camera = choices.eye.moves(&studio.base);
        Ok(Self { up: choices.up, moves_camera, ..studio })
    }

    fn complete(&self, asked: &Asked, choices: &Choices, stops: f32) -> Keys {
        let told = dry_run::scene(&self.base, choices, &asked.args, &asked.line);
        let mut settings = settings::complete(told, asked, stops);
        if !settings.contains_key("color")
            && let Some((cloud, ..)) = self.base.clouds().next()
        {
            settings.insert("color".into(), json!(choose(cloud).0.to_string()));
        }
        settings
    }

    /// Everything but light and camera, which need no tree to change.
    fn made(
        &self,
        asked: &Asked,
        time: f64,
        choices: &Choices,
        report: &Report,
    ) -> anyhow::Result<Arc<Made>> {
        let preparation = asked.line.preparation_key();
        let trees = asked.line.tree_key();
        let frames = self.base.frames_at(time);
        let key = format!("{preparation}\n{trees}\n{:?} {frames:?}", choices.up);
        self.made.get(key, report, || {
            let assembly = self.base.under(&asked.args, &asked.line)?;
            let clouds = self.prepared.get(preparation, report, || {
                self.workshop.install(|| prepared(&self.base, &assembly, report))
            })?;
            let legend = legend(&clouds, &asked.args.color.coloring(choices.up));
            let when = (time, choices.up);
            let make = || Made::new(assembly, &clouds, legend, when, report);
            self.workshop.install(make)
        })
    }

    fn stage_of(&self, asked: &Asked, report: &Report) -> anyhow::Result<Stage> {
        let choices = picture::choose(&self.base, &asked.args, report)?;
        let quality = picture::settings(&asked.args, Path::new(""));
        let flat_at = |time| {
            let made = self.made(asked, time, &choices, report)?;
            let mut flat = made.flat.clone();
            flat.lights.clone_from(&choices.lights);
            flat.background = asked.args.color.background();
            // What would fail while it is painted is refused as a whole.
            render::check(&flat)?;
            pose(&mut flat, &made.graph, time, &choices, report)?;
            anyhow::Ok((made, flat))
        };
        // As the command line does. Without need, the first file of a sequence is not read.
        let judged_at = if asked.args.light.exposure == Exposure::Auto { 0.0 } else { asked.time };
        let (_, judged) = flat_at(judged_at)?;
        let stops = self.workshop.install(|| {
            picture::exposure(&self.renderer, &judged, &quality, &asked.args, report)
        })?;
        let (made, mut flat) = flat_at(asked.time)?;
        light::expose(&mut flat, stops);
        let settings = self.complete(asked, &choices, stops);
        let is_moved = choices.eye.moves(&self.base);
        let moved_camera = is_moved.then(|| dry_run::camera_keys(&flat.camera));
        let legend = made.legend.clone();
        Ok(Stage { settings, moved_camera, flat, quality, legend, source: made })
    }

    fn objects(&self) -> Vec<Value> {
        let of_files = self.base.files().map(|files| match &files[..] {
            [only] => json!({ "name": file_name(only), "kind": self.kind_of(only) }),
            several => {
                let several: Vec<PathBuf> = several.iter().map(|file| file.to_path_buf()).collect();
                json!({ "name": EVERYTHING, "label": name_of(&several), "kind": "points" })
            }
        });
        let objects = &self.line.scene.objects;
        let of_scene =
            objects.iter().map(|object| json!({ "name": object.name, "kind": "object" }));
        of_files.chain(of_scene).collect()
    }

    /// What all clouds can be coloured by.
    fn colors(&self) -> Vec<&str> {
        let mut clouds = self.base.clouds().map(|(cloud, ..)| columns(cloud));
        let mut names = clouds.next().unwrap_or_default();
        clouds.for_each(|others| names.retain(|name| others.contains(name)));
        names.extend(["elevation", "normal"]);
        names
    }

    fn kind_of(&self, file: &Path) -> &'static str {
        if surfel_formats::is_cloud(file).unwrap_or(true) { "points" } else { "triangles" }
    }

    /// Files as they were typed.
    fn typed(&self) -> Vec<String> {
        self.base.typed().iter().map(|file| file.display().to_string()).collect()
    }
}

/// Without folders, which a page need not know.
fn name_of(files: &[PathBuf]) -> String {
    let names: Vec<PathBuf> = files.iter().map(|file| file_name(file).into()).collect();
    name_files(&names)
}

/// Columns that a cloud has, as `--color` takes them.
fn columns(cloud: &PointCloud) -> Vec<&str> {
    let usual = [
        ("rgb", cloud.colors.is_some()),
        ("intensity", cloud.intensity.is_some()),
        ("class", cloud.classification.is_some()),
    ];
    let usual = usual.into_iter().filter_map(|(name, is_there)| is_there.then_some(name));
    let others = cloud.scalars.iter().map(|scalar| scalar.name.as_str());
    usual.chain(others.filter(|name| *name != INDEX)).collect()
}

/// Goes to a time.
fn pose(
    flat: &mut FlatScene,
    graph: &Graph,
    time: f64,
    choices: &Choices,
    report: &Report,
) -> anyhow::Result<()> {
    if graph.animation.channels.is_empty() {
        flat.camera = choices.eye.at(time, graph);
        return Ok(());
    }
    let mut graph = graph.clone();
    graph.pose(time);
    flat.update(&graph, report)?;
    flat.camera = choices.eye.at(time, &graph);
    Ok(())
}

impl Studio for ScanStudio {
    fn info(&self) -> Value {
        let outline = self.base.outline();
        let bounds = usual_bounds(&outline);
        let world = |corner: Vec3| (outline.origin + corner.as_dvec3()).to_array();
        let (points, triangles) = self.base.graph.counts();
        json!({
            "name": name_of(self.base.typed()),
            "points": points,
            "triangles": triangles,
            "version": env!("CARGO_PKG_VERSION"),
            "bounds": { "min": world(bounds.min), "max": world(bounds.max) },
            "up": self.up.to_array(),
            "surfaces": SurfaceKind::ALL.map(|(name, _)| name),
            "colors": self.colors(),
            "colormaps": colormap::names().collect::<Vec<_>>(),
            "materials": Material::NAMED.map(|(name, _)| name),
            "objects": self.objects(),
            "duration_secs": self.base.duration_secs(),
            "camera_moves": self.moves_camera,
            "threads": rayon::current_num_threads(),
            "simd": self.renderer.simd.name(),
            "coordinate_system": self.base.source().coordinate_system,
            "limits": {
                "max_pixels": MOST_PIXELS,
                "max_save_pixels": MOST_SAVED_PIXELS,
                "max_message_bytes": MOST_BYTES,
            },
        })
    }

    fn opening(&self, width: u32, height: u32) -> Keys {
        let mut settings = self.given.clone();
        settings.insert("resolution".into(), json!(format!("{width}x{height}")));
        let chosen = || {
            let asked = settings::read(self.line, &self.given, &settings).ok()?;
            let report = Report::new(Verbosity::Quiet);
            let choices = picture::choose(&self.base, &asked.args, &report).ok()?;
            let mut opening = self.complete(&asked, &choices, 0.0);
            // Found out once there is something to see.
            opening.shift_remove("exposure");
            let exposure = self.given.get("exposure").cloned();
            opening.extend(exposure.map(|exposure| ("exposure".to_owned(), exposure)));
            Some(opening)
        };
        // What was right at the start is so for every size.
        chosen().unwrap_or(settings.clone())
    }

    fn given(&self) -> Keys {
        self.given.clone()
    }

    fn sketch(&self, settings: &Keys, progress: &dyn Progress) -> Option<Result<Stage>> {
        let (n_points, _) = self.base.graph.counts();
        if n_points < 3 * SKETCH || settings.contains_key("select") {
            return None;
        }
        let mut sketched = settings.clone();
        sketched.insert("select".into(), json!(format!("random:{SKETCH}")));
        // Fewer points surround less.
        sketched.insert("boundary".into(), json!("off"));
        let stage = self.stage(&sketched, progress);
        // What is asked for is still the same; what was chosen from few points is chosen again.
        Some(stage.map(|stage| Stage { settings: settings.clone(), ..stage }))
    }

    fn stage(&self, settings: &Keys, progress: &dyn Progress) -> Result<Stage> {
        let report = Report::new(Verbosity::Quiet).heard_by(progress);
        let asked = settings::read(self.line, &self.given, settings)?;
        self.stage_of(&asked, &report).map_err(settings::refusal)
    }

    fn describe(&self, stage: &Stage, place: &Place) -> Value {
        let Some(made) = stage.source.downcast_ref::<Made>() else { return Value::Null };
        let mut graph = Cow::Borrowed(&made.graph);
        if !graph.animation.channels.is_empty() {
            let time = stage.settings.get("time").and_then(Value::as_f64);
            graph.to_mut().pose(time.unwrap_or(0.0));
        }
        point::describe(&self.base, made, &stage.flat, &graph, place)
    }

    fn picture(&self, settings: &Keys, progress: &dyn Progress) -> Result<Vec<u8>> {
        let report = Report::new(Verbosity::Quiet).heard_by(progress);
        let asked = settings::read(self.line, &self.given, settings)?;
        settings::check_work(&asked.args)?;
        let stage = self.stage_of(&asked, &report).map_err(settings::refusal)?;
        let rendered = || self.renderer.render(&stage.flat, &stage.quality, &report);
        let (image, _) = self.workshop.install(rendered)?;
        let options = picture::image_options(stage.flat.origin, &asked.args);
        surfel_formats::png_bytes(&image, &options).map_err(|error| settings::refusal(error.into()))
    }

    fn written(&self, settings: &Keys) -> Result<Written> {
        let report = Report::new(Verbosity::Quiet);
        let asked = settings::read(self.line, &self.given, settings)?;
        let choices = picture::choose(&self.base, &asked.args, &report);
        let choices = choices.map_err(settings::refusal)?;
        let mut scene = dry_run::scene(&self.base, &choices, &asked.args, &asked.line);
        if 0.0 < asked.time {
            scene["time"] = json!(asked.time);
        }
        settings::written(&asked, &self.typed(), &scene)
    }

    fn read(&self, name: &str, text: &str) -> Result<Keys> {
        let objects = self.line.scene.objects.iter().flat_map(|object| &object.files);
        let files = self.base.typed().iter().chain(objects);
        let served: Vec<String> = files.map(|file| dry_run::in_full(file)).collect();
        settings::from_file(name, text, &served)
    }
}
