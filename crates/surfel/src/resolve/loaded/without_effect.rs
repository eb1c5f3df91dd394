//! Warnings of settings that change nothing in the scene or in the file of its picture.

use super::super::cloud::surface_of;
use super::super::crop_hints::report_crossing_rings;
use super::LoadedScene;
use crate::description::{
    ColorSettings, KeyedSettings, LightKind, ObjectSettings, PreparationSettings, SceneDescription,
    SurfaceSettings, misspelled, write_table,
};
use surfel_core::points::{PointCloud, StructureChoice};
use surfel_core::progress::Progress;
use surfel_core::render::MIN_ADAPTIVE_SAMPLES;
use surfel_core::scene::color::ColorSource;
use surfel_core::scene::{Background, Geometry};
use surfel_core::surface::SurfaceKind;
use surfel_formats::{BitDepth, FileInfo, TextColumn};

impl LoadedScene {
    /// Warns of settings that have no effect.
    pub(super) fn report_unused(&self, description: &SceneDescription, progress: &dyn Progress) {
        report_unused_of_output(description, progress);
        let picture = &description.picture;
        if 0.0 < picture.noise_threshold() && picture.spp() <= MIN_ADAPTIVE_SAMPLES {
            let line = format!(
                "no effect: noise is estimated after {MIN_ADAPTIVE_SAMPLES} camera rays per pixel, of which there are \
                 {} at most",
                picture.spp()
            );
            progress.warning(&line, &["noise_threshold", "spp"]);
        }
        let camera = &description.camera;
        // A plan looks in the direction, and has its middle at the focal point.
        let is_turned = !camera.has_both_ends() || description.plan.is_to_scale();
        if let (Some(key), false) = (camera.direction_key(), is_turned) {
            let line = "no effect: position and focal point state the direction already";
            progress.warning(line, &[key, "camera.position", "camera.focal_point"]);
        }
        let preparation = &description.objects_default.preparation;
        report_unused_of_files(&self.file_infos, preparation, progress);
        let of_objects = description.objects.iter().map(|object| &object.settings.preparation);
        report_crossing_rings(of_objects.chain([preparation]), progress);
        self.report_unused_of_points(description, progress);
        self.report_unused_structure(description, progress);
        self.report_unused_of_surfaces(description, progress);
        report_unused_of_lights(description, progress);
    }

    /// Warns of settings of surfaces and colours that no cloud has a use for.
    fn report_unused_of_surfaces(&self, description: &SceneDescription, progress: &dyn Progress) {
        if self.graph.geometries.is_empty() {
            return;
        }
        let (surfaces, sources): (Vec<SurfaceKind>, Vec<ColorSource>) = self
            .clouds()
            .map(|(i, cloud)| {
                let settings = self.settings_of(i, description);
                let source = || self.suitable_color(i, cloud, description).0;
                let surface = surface_of(cloud, &settings);
                (surface, settings.color.color.unwrap_or_else(source))
            })
            .unzip();
        let settings = &description.objects_default.surface;
        let SurfaceSettings { align, gather_limit, min_distance, .. } = settings;
        let SurfaceSettings { reach, density, degree, octree_depth, .. } = settings;
        let is_octree =
            |kind: &SurfaceKind| [SurfaceKind::Octree, SurfaceKind::OctreeSplat].contains(kind);
        let has = |kind: SurfaceKind| surfaces.contains(&kind);
        for (key, is_unused, kinds) in [
            (
                "point_size",
                description.picture.point_size.is_some() && !has(SurfaceKind::Points),
                "points",
            ),
            ("align", align.is_some() && !has(SurfaceKind::Splat), "splat"),
            (
                "gather_limit",
                gather_limit.is_some() && !surfaces.iter().any(|kind| kind.blends_discs()),
                "splat, splat-mean, splat-fit and cylinder",
            ),
            (
                "reach",
                reach.is_some() && !surfaces.iter().any(|kind| kind.has_reach()),
                "cylinder, mls and splat-fit",
            ),
            ("density", density.is_some() && !has(SurfaceKind::Cylinder), "cylinder"),
            ("degree", degree.is_some() && !has(SurfaceKind::Mls), "mls"),
            (
                "octree_depth",
                octree_depth.is_some() && !surfaces.iter().any(is_octree),
                "octree and octree-splat",
            ),
        ] {
            if is_unused {
                let line = format!("no effect: only for the surface {kinds}");
                progress.warning(&line, &[key, "surface"]);
            }
        }
        if min_distance.is_some() && !surfaces.iter().any(|kind| kind.is_continuous()) {
            let line = "no effect: not for the surfaces points, sphere and gaussian";
            progress.warning(line, &["min_distance", "surface"]);
        }
        let ColorSettings { cmap, range, .. } = &description.objects_default.color;
        let set = [("cmap", cmap.is_some()), ("range", range.is_some())];
        let mut keys: Vec<&str> =
            set.iter().filter(|(_, is_set)| *is_set).map(|(key, _)| *key).collect();
        if !keys.is_empty() && !sources.iter().any(ColorSource::is_mapped) {
            keys.push("color");
            let line =
                "no effect: maps colour values, as elevation, intensity and columns have them";
            progress.warning(line, &keys);
        }
    }

    /// Warns of structures that are chosen but found in no cloud.
    fn report_unused_structure(&self, description: &SceneDescription, progress: &dyn Progress) {
        let finds_structures = |(i, cloud): (usize, &PointCloud)| {
            let settings = self.settings_of(i, description);
            settings.preparation(description.picture.seed()).finds_structures(cloud)
        };
        let settings = &description.objects_default.preparation;
        if self.clouds().next().is_some() && !self.clouds().any(finds_structures) {
            report_unused_structure(settings, progress);
        }
    }

    /// Warns of settings that choose or colour points in a scene, or in an object, without points.
    fn report_unused_of_points(&self, description: &SceneDescription, progress: &dyn Progress) {
        if self.graph.geometries.is_empty() {
            return;
        }
        const LINE: &str = "settings for points do not change triangles, which keep the colours of their materials and vertices";
        let keys = keys_of_points(&description.objects_default);
        if !keys.is_empty() && self.clouds().next().is_none() {
            progress.warning(LINE, &keys);
        }
        for (nodes, object) in self.objects.iter().zip(&description.objects) {
            let mut keys = keys_of_points(&object.settings);
            // The files of a sequence are read when they are shown.
            let is_known = object.files.len() == 1 || object.merge();
            let nodes = &self.graph.nodes[nodes.all.clone()];
            let mut primitives = nodes.iter().flat_map(|node| &node.primitives);
            let geometries = &self.graph.geometries;
            let has_points = primitives
                .any(|primitive| matches!(geometries[primitive.geometry], Geometry::Points(_)));
            if is_known && !has_points && !keys.is_empty() {
                keys.push("material");
                let line = format!("object `{}`: {LINE}", object.name());
                progress.warning(&line, &keys);
            }
        }
    }
}

/// Returns the keys that are set of those that choose or colour points.
fn keys_of_points(settings: &ObjectSettings) -> Vec<&'static str> {
    let PreparationSettings { filter, class, returns, .. } = &settings.preparation;
    let all = [
        ("color", settings.color.color.is_some()),
        ("filter", filter.is_some()),
        ("class", class.is_some()),
        ("returns", returns.is_some()),
    ];
    all.into_iter().filter(|(_, is_set)| *is_set).map(|(key, _)| key).collect()
}

/// Warns of settings of lights that do not shine.
fn report_unused_of_lights(description: &SceneDescription, progress: &dyn Progress) {
    let lights: [(LightKind, &str, &dyn KeyedSettings); 2] =
        [(LightKind::Sun, "sun", &description.sun), (LightKind::Sky, "sky", &description.sky)];
    for (kind, name, settings) in lights {
        let names = write_table(settings);
        // Where the sun would be placed, its date is reported.
        let names = names.keys().filter(|key| *key != "date");
        let paths: Vec<String> = names.map(|key| format!("{name}.{key}")).collect();
        if description.light.has(kind) || paths.is_empty() {
            continue;
        }
        let keys: Vec<&str> = paths.iter().map(String::as_str).chain(["light"]).collect();
        progress.warning(&format!("no effect: no {name} shines"), &keys);
    }
}

/// Warns of a choice of structures that no cloud follows.
pub(crate) fn report_unused_structure(settings: &PreparationSettings, progress: &dyn Progress) {
    if settings.structure.is_some_and(|choice| choice != StructureChoice::Surface) {
        let line = "no effect: structures are found only where radii are estimated from neighbours, in clouds that do not \
                    deform";
        progress.warning(line, &["structure", "radius"]);
    }
}

/// Warns of settings for files of a kind that is not there, and of columns that are probably misspelled.
pub(crate) fn report_unused_of_files<'i>(
    infos: impl IntoIterator<Item = &'i FileInfo>,
    settings: &PreparationSettings,
    progress: &dyn Progress,
) {
    let infos: Vec<&FileInfo> = infos.into_iter().collect();
    let has_none = |kind: &str| !infos.iter().any(|info| info.format.starts_with(kind));
    if settings.columns.is_some() && has_none("text") {
        let line = "no effect, since no file is text: all other formats name their columns";
        progress.warning(line, &["columns"]);
    }
    for column in TextColumn::parse_list(settings.columns.as_deref().unwrap_or_default()) {
        let Some(name) = column.scalar() else { continue };
        if let Some(meant) = misspelled(name, TextColumn::NAMES) {
            let line =
                format!("column `{name}` has no meaning; the nearest known one is `{meant}`");
            progress.warning(&line, &["columns"]);
        }
    }
    if settings.animation_name.is_some() && has_none("glTF") {
        let line = "no effect, since no file is glTF: only these have animations";
        progress.warning(line, &["animation_name"]);
    }
}

/// Warns of settings that the file of the picture or movie cannot hold.
fn report_unused_of_output(description: &SceneDescription, progress: &dyn Progress) {
    let Some(output) = &description.output.output else { return };
    // Standard output is a PNG.
    let extension =
        output.extension().map_or("png".into(), |it| it.to_string_lossy().to_lowercase());
    let extension = extension.as_str();
    let has_depths = ["png", "tif", "tiff"].contains(&extension);
    if description.picture.bit_depth == Some(BitDepth::Sixteen) && !has_depths {
        let line = format!("no effect on .{extension}: only .png and .tif have 16 bits");
        progress.warning(&line, &["bit_depth"]);
    }
    let picture = &description.picture;
    let overlays = [
        ("legend", picture.legend()),
        ("scale_bar", picture.scale_bar()),
        ("north", picture.north()),
        ("caption", picture.caption.is_some()),
    ];
    let drawn: Vec<&str> =
        overlays.iter().filter(|(_, is_set)| *is_set).map(|(key, _)| *key).collect();
    if extension == "exr" && !drawn.is_empty() {
        let line = "no effect on .exr: nothing is drawn over its layers";
        progress.warning(line, &drawn);
    }
    let backdrop = match extension {
        "jpg" | "jpeg" => Some("white"),
        "png" | "tif" | "tiff" | "webp" | "exr" => None,
        _ => Some("black"),
    };
    if let (Some(color), Background::Transparent) = (backdrop, description.picture.background()) {
        let line = format!(".{extension} has no transparency: the background is {color}");
        progress.warning(&line, &["background"]);
    }
    let states_dpi = has_depths || ["jpg", "jpeg"].contains(&extension);
    let plan = &description.plan;
    if let (Some(dpi), false) = (plan.dpi, plan.is_to_scale()) {
        let place = if states_dpi { "stated in the file alone" } else { "not stated in the file" };
        let line = format!("{dpi} pixels per inch are {place}: without a scale no size follows");
        progress.warning(&line, &["dpi", "scale"]);
    }
}
