//! Turns a description into a scene that can be rendered: opens files and makes every automatic choice.

mod crop_hints;
mod cloud;
mod camera;
mod interior;
mod station;
mod inside;
mod coverage_warnings;
mod environment;
mod point_size;
mod sun_and_sky;
mod exposure;
mod memory;
mod unlit;
mod appearance;
mod sequence;
mod check_files;
mod loaded;
mod common_range;
mod common_legend;
mod plan;
mod sun_position;
mod complete_description;

pub(crate) use appearance::finish_graph;
pub use camera::{
    SceneCamera, camera_motion, choose_camera, choose_up, short_position, up_convention,
};
pub use check_files::check_files;
pub use cloud::{
    can_be_colored, check_empty, prepare_cloud, report_denoise, report_normals, report_prepared,
    report_radii, state_known_sides,
};
pub(crate) use cloud::{filter_cloud, reading_error};
pub(crate) use common_legend::common_legend;
pub(crate) use common_range::with_common_ranges;
pub use coverage_warnings::report_coverage;
pub(crate) use crop_hints::report_crossing_rings;
pub(crate) use exposure::{Metering, automatic_exposure};
pub(crate) use interior::hide_walls;
pub use loaded::{KeepOptions, LoadedFile, LoadedScene};
pub(crate) use loaded::{report_unused_of_files, report_unused_structure};
pub use memory::{MemoryEstimate, PIXEL_WITH_LAYERS, n_points};
pub(crate) use plan::height_map_place;
pub use plan::{coordinate_system, coordinate_system_text};
pub(crate) use sequence::Sequence;
pub use station::{LocatedStation, located_stations};
pub(crate) use sun_and_sky::{expose, expose_lamps, expose_materials};

use crate::crs::{CoordinateSystem, Unit, georeference};
use crate::description::{CameraSettings, LightKind, OrthographicHeight, SceneDescription};
use crate::error::Result;
use crate::overlay::{Overlay, faults};
use crate::progress_log::{Choice, ProgressLog, Records, Warning};
use camera::SceneExtent;
use complete_description::{common_color, complete_description};
use coverage_warnings::report_gaps;
use inside::{Inside, choose_inside};
use interior::{choose_room, has_splats, hidden_ceiling, hidden_walls};
use plan::{WholePlan, frame_plan};
use point_size::choose_point_size;
use station::stand_at_station;
use sun_and_sky::{LightingContext, choose_lights, lights, shows_environment};
use sun_position::stand_sun_at_date;
use surfel_core::math::Vec3;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::render::Settings;
use surfel_core::scene::color::{ColorSource, Legend};
use surfel_core::scene::{
    Camera, ClipPlane, Light, Projection, Room, Scene, find_room, inlier_bounds,
};
use surfel_core::surface::SurfaceKind;

/// A scene that is ready for its trees: everything is read, chosen and prepared, at second 0.
#[derive(Debug)]
pub struct Resolved {
    /// The scene of the renderer.
    pub scene: Scene,
    /// Size and quality of its picture.
    pub settings: Settings,
    /// The description with everything that was chosen written into it.
    pub description: SceneDescription,
    /// The choices that were made, in the order of the work.
    pub choices: Vec<Choice>,
    /// Hints at what is probably not meant, in the order of the work.
    pub warnings: Vec<Warning>,
    /// Sequences whose files are read one by one.
    pub(crate) sequences: Vec<Sequence>,
    /// The camera with its movement.
    pub(crate) camera: SceneCamera,
    /// The room on a turntable.
    pub(crate) turned_room: Option<Room>,
    /// Legend, scale bar, north arrow and caption.
    pub(crate) overlay: Overlay,
    /// The coordinate system, if it is known.
    pub(crate) system: Option<CoordinateSystem>,
    /// The world's up.
    pub(crate) up: Vec3,
    pub(crate) metering: Metering,
}

/// Opens the files of a description and makes every choice that it leaves open.
///
/// # Errors
///
/// Fails for keys and values that are not valid, for missing and broken files, past the memory limit, and with
/// [`surfel_core::Error::Cancelled`].
pub fn resolve(description: &SceneDescription, progress: &dyn Progress) -> Result<Resolved> {
    description.check()?;
    let mut description = description.clone();
    description.apply_object_settings()?;
    let description = &description;
    let log = ProgressLog::new(progress);
    let keep = KeepOptions { source_indices: true, ..KeepOptions::default() };
    let scene = LoadedScene::read(description, keep, &log)?;
    let auto = AutoSettings::choose(&scene, description, &log)?;
    let mut resolved = scene.into_resolved(auto, &log)?;
    let Records { choices, warnings, .. } = log.into_records();
    (resolved.choices, resolved.warnings) = (choices, warnings);
    Ok(resolved)
}

/// Settings that were chosen from the data: up, camera and lights.
#[derive(Clone, Debug)]
pub struct AutoSettings {
    /// The world's up.
    pub up: Vec3,
    /// The camera with its movement.
    pub camera: SceneCamera,
    /// Lights of the whole scene.
    pub lights: Vec<Light>,
    /// Planes beyond which the walls and the ceiling of a room are hidden.
    pub hidden_walls: Vec<ClipPlane>,
    /// The room on a turntable, whose walls before the camera each frame hides.
    pub turned_room: Option<Room>,
    /// The whole of a plan.
    pub(crate) whole_plan: Option<WholePlan>,
    /// The description, with the chosen surface, colours, plan and lights written into it.
    description: SceneDescription,
}

impl AutoSettings {
    /// Chooses up, camera and lights where the description leaves them open.
    ///
    /// # Errors
    ///
    /// Fails for an unknown station, a plan in degrees or of too many pixels, a sun by date without a place, movements
    /// that are not valid, and an environment map that cannot light the scene; and if cancelled.
    pub fn choose(
        scene: &LoadedScene,
        description: &SceneDescription,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut chosen = description.clone();
        let points = scene.shown_points(description);
        let up = choose_up(description.world.up, &points, &scene.file_infos, progress);
        chosen.camera = stand_at_station(&description.camera, scene, up)?;
        progress.check()?;
        choose_surface(scene, &mut chosen, progress);
        choose_color(scene, &mut chosen, progress);
        progress.check()?;
        let bounds = inlier_bounds(&points);
        let whole_plan = frame_plan(scene, &mut chosen, (&points, bounds), up, progress)?;
        let middle = points.origin + (0.5 * (bounds.min + bounds.max)).as_dvec3();
        stand_sun_at_date(scene, &mut chosen, middle, up, progress)?;
        report_gaps(&points, progress);
        progress.check()?;
        let found_room = find_room(&points, up);
        let room = choose_room(scene, &chosen, found_room.as_ref(), progress);
        progress.check()?;
        let inside = choose_inside(scene, &points, &chosen, up, room, progress);
        let view = inside.as_ref().map(Inside::view);
        progress.check()?;
        let extent = SceneExtent { points: &points, bounds, up, room, inside: view };
        let motion = camera_motion(&chosen)?;
        let camera = SceneCamera::choose(&scene.graph, &extent, &chosen, motion, progress);
        let diagonal = (bounds.max - bounds.min).length();
        let turned_room = room.cloned().filter(|_| chosen.output.turntable.is_some());
        let hidden_walls = match &turned_room {
            Some(room) => hidden_ceiling(room, &camera.camera, progress),
            None => hidden_walls(room, &camera.camera, progress),
        };
        let is_inside = matches!(inside, Some(Inside::Tunnel(_)))
            || found_room.is_some_and(|room| room.encloses(camera.camera.position));
        let has_normals = scene.has_normals(&chosen);
        let context = LightingContext {
            camera: camera.camera,
            up,
            diagonal,
            is_inside,
            has_normals,
            points: &points,
            inside: view,
        };
        progress.check()?;
        chosen = choose_lights(&chosen, &context, progress);
        choose_point_size(scene, &mut chosen, &points, &camera.camera, progress);
        let lights = lights(&chosen, scene.environment.as_ref(), up, has_normals)?;
        let description = chosen;
        Ok(Self { up, camera, lights, hidden_walls, turned_room, whole_plan, description })
    }

    /// Returns a description with the colours that were chosen for all clouds.
    pub(crate) fn with_color(&self, description: &SceneDescription) -> SceneDescription {
        let mut with_color = description.clone();
        let chosen = &self.description.objects_default.color.color;
        with_color.objects_default.color.color.clone_from(chosen);
        with_color
    }

    /// Returns the description with everything that was chosen written into it.
    pub fn complete_description(&self, scene: &LoadedScene) -> SceneDescription {
        complete_description(scene, self, &self.description)
    }

    /// Returns true if the scene moves the camera.
    pub fn moves_camera(&self, scene: &LoadedScene) -> bool {
        self.camera.has_motion() || self.camera.node.is_some_and(|node| scene.is_animated(node))
    }
}

impl LoadedScene {
    /// Prepares all clouds, colours them and gives everything its material.
    ///
    /// # Errors
    ///
    /// Fails for clouds that cannot be prepared or coloured, and if nothing is left to be seen.
    pub fn into_resolved(
        mut self,
        auto: AutoSettings,
        progress: &dyn Progress,
    ) -> Result<Resolved> {
        let complete = auto.complete_description(&self);
        let AutoSettings { up, camera, lights, description, hidden_walls, turned_room, whole_plan } =
            auto;
        check_camera(&description, &camera.at(0.0, &self.graph), up)?;
        let clouds = self.take_prepared(&description, progress)?;
        let description = with_common_ranges(&self, &clouds, &description, up, progress);
        let legend = common_legend(&self, &clouds, &description, up);
        let metering = Metering { plan: whole_plan, has_legend: legend != Legend::None };
        let raw = std::mem::take(&mut self.graph);
        let (mut graph, sequences) = finish_graph(&self, raw, clouds, &description, up, progress)?;
        hide_walls(&mut graph, &hidden_walls);
        let background = description.picture.background();
        let scene = Scene { camera: camera.at(0.0, &graph), graph, lights, background };
        let system = coordinate_system(&self, &description);
        let unit = system.as_ref().map_or(Unit::Unknown, CoordinateSystem::unit);
        let overlay = match is_exr(&description) {
            true => Overlay::default(),
            false => Overlay::new(&description.picture, legend, (up, unit), progress),
        };
        let settings = render_settings(&description);
        let (choices, warnings) = (Vec::new(), Vec::new());
        let description = complete;
        Ok(Resolved {
            scene,
            settings,
            description,
            choices,
            warnings,
            sequences,
            camera,
            turned_room,
            overlay,
            system,
            up,
            metering,
        })
    }
}

/// Shows trained splats as Gaussians unless the description says how to show points, and lights nothing if there is nothing
/// else.
fn choose_surface(
    scene: &LoadedScene,
    description: &mut SceneDescription,
    progress: &dyn Progress,
) {
    let is_open = |i: usize| scene.settings_of(i, description).surface.surface.is_none();
    let open: Vec<&PointCloud> =
        scene.clouds().filter(|(i, _)| is_open(*i)).map(|(_, cloud)| cloud).collect();
    let n_splats = open.iter().filter(|cloud| cloud.has_gaussians()).count();
    if n_splats == 0 {
        return;
    }
    let has_others = n_splats < scene.n_geometries();
    progress.choice("surface gaussian: trained splats", &["surface"]);
    if n_splats == open.len() {
        description.objects_default.surface.surface = Some(SurfaceKind::Gaussian);
    }
    let shows_environment = shows_environment(description);
    let light = &mut description.light;
    let needs_light = has_others
        || !description.lamps.is_empty()
        || light.environment.is_some()
        || shows_environment;
    if light.light.is_none() && !needs_light {
        progress.choice("no lights: trained splats show the light of their photos", &["light"]);
        light.light = Some(vec![LightKind::None]);
    }
}

/// Chooses the colours of all clouds that leave them open, if these are the same, before the points are prepared: pictures and
/// descriptions of it then agree. Trained splats have colours of their own, and each file of a sequence those that suit it.
fn choose_color(scene: &LoadedScene, description: &mut SceneDescription, progress: &dyn Progress) {
    if has_splats(scene) || scene.has_sequences() {
        return;
    }
    let Some((source, reason)) = common_color(scene, description) else { return };
    // The line about intensity comes with its range.
    if source != ColorSource::Intensity {
        let keys = ["color", "cmap", "range", "gamma"];
        progress.choice(&format!("color {source}: {reason}"), &keys);
    }
    description.objects_default.color.color = Some(source);
}

/// Returns size and quality of a description's picture. A file that is not EXR takes no layers beside the colour.
pub fn render_settings(description: &SceneDescription) -> Settings {
    let picture = &description.picture;
    let (width, height) = picture.resolution();
    Settings {
        width,
        height,
        samples_per_pixel: picture.spp(),
        noise_threshold: picture.noise_threshold() as f32,
        light_samples: picture.light_samples(),
        max_depth: picture.max_depth(),
        seed: picture.seed(),
        point_size: picture.point_size.map_or(Settings::default().point_size, |size| size as f32),
        with_aovs: description.output.output.is_none() || is_exr(description),
    }
}

/// Checks that the first camera allows the scale bar, the north arrow and the height map that are asked for.
fn check_camera(description: &SceneDescription, camera: &Camera, up: Vec3) -> Result<()> {
    let faults =
        if is_exr(description) { Vec::new() } else { faults(&description.picture, camera, up) };
    faults.into_iter().next().map_or(Ok(()), Err)?;
    if description.plan.height_map.is_some() {
        height_map_place(description, georeference(camera, (1, 1), None))?;
    }
    Ok(())
}

/// Returns true if the picture is written with all layers, for other programs rather than to be looked at.
fn is_exr(description: &SceneDescription) -> bool {
    let extension = description.output.output.as_ref().and_then(|path| path.extension());
    extension.is_some_and(|extension| extension.eq_ignore_ascii_case("exr"))
}

/// The camera as keys: where it stands, or its name if it is one of a file that moves.
fn description_camera(
    scene: &LoadedScene,
    auto: &AutoSettings,
    description: &SceneDescription,
) -> CameraSettings {
    if let Some(node) = auto.camera.node.filter(|node| scene.is_animated(*node)) {
        let name = Some(scene.graph.nodes[node].name.clone());
        return CameraSettings {
            name,
            view_angle: description.camera.view_angle,
            interior: description.camera.interior,
            ..CameraSettings::default()
        };
    }
    let CameraSettings { lock, interior, .. } = description.camera;
    let mut camera = CameraSettings { lock, interior, ..CameraSettings::of(&auto.camera.camera) };
    // The height of a plan follows from its pixels.
    camera.orthographic.take_if(|_| description.plan.is_to_scale());
    camera
}

impl CameraSettings {
    /// Returns settings of a camera that leave nothing to be chosen.
    pub fn of(camera: &Camera) -> Self {
        let mut settings = Self {
            position: Some(camera.position),
            focal_point: Some(camera.focal_point),
            view_up: Some(camera.view_up),
            ..Self::default()
        };
        match camera.projection {
            Projection::Perspective { view_angle_deg } => {
                settings.view_angle = Some(view_angle_deg)
            }
            Projection::Orthographic { height } => {
                settings.orthographic = Some(OrthographicHeight::Fixed(height));
            }
            Projection::Panorama => settings.panorama = Some(true),
        }
        settings
    }
}
