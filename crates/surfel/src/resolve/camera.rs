//! The camera: as the description says, of a file, or chosen so that the whole scene is seen.

use crate::description::{
    CameraMotion, CameraSettings, Invalid, OrthographicHeight, SceneDescription,
};
use surfel_core::math::{Aabb, DVec3, Vec3};
use surfel_core::points::{PointCloud, UpConvention, infer_up};
use surfel_core::progress::Progress;
use surfel_core::scene::{
    Camera, CameraFit, Graph, InsideView, Projection, Room, default_view_up, fit_camera,
    panorama_camera,
};
use surfel_formats::FileInfo;

/// A camera, and what moves it.
#[derive(Clone, Debug)]
pub struct SceneCamera {
    /// The camera before it moves.
    pub camera: Camera,
    /// The node of a file that has the camera, if the camera goes along with it.
    pub node: Option<usize>,
    up: Vec3,
    /// Middle of the scene.
    middle: DVec3,
    /// Field of view in place of that of a file's camera.
    view_angle_deg: Option<f64>,
    motion: Option<CameraMotion>,
}

/// Position and size of the scene, as a camera needs to know them.
pub struct SceneExtent<'a> {
    /// Points of the scene.
    pub points: &'a PointCloud,
    /// Bounds of all but stray points, relative to the points' origin.
    pub bounds: Aabb,
    /// The world's up.
    pub up: Vec3,
    /// The room that the points show, if its inside is to be seen.
    pub room: Option<&'a Room>,
    /// The view from within the scene by which it is shown.
    pub inside: Option<&'a InsideView>,
}

impl SceneCamera {
    /// The camera of the description; where it asks for none, the first of the files or one that sees everything.
    pub fn choose<C: AsRef<PointCloud>>(
        graph: &Graph<C>,
        extent: &SceneExtent,
        description: &SceneDescription,
        motion: Option<CameraMotion>,
        progress: &dyn Progress,
    ) -> Self {
        let SceneExtent { points, bounds, up, room, inside } = *extent;
        let settings = &description.camera;
        let middle = points.origin + (0.5 * (bounds.min + bounds.max)).as_dvec3();
        let view_angle_deg = settings.view_angle;
        let of_file = graph.camera().filter(|_| settings.is_automatic());
        let camera = match (of_file, inside) {
            (Some((node, camera)), _) => {
                let name = &graph.nodes[node].name;
                let line = format!("camera `{name}` of the file");
                progress.choice(&line, &["camera.name", "camera.position"]);
                adjusted_file_camera(camera, middle, view_angle_deg)
            }
            (None, Some(view)) => view.camera(up, view_angle_deg),
            (None, None) => {
                let (width, height) = description.picture.resolution();
                let aspect = f64::from(width) / f64::from(height);
                let is_turntable = description.output.turntable.is_some();
                let frame = CameraFit { up, aspect, is_turntable, ..CameraFit::default() };
                choose_camera(settings, points, &frame, room, progress)
            }
        };
        let is_locked = settings.lock();
        let node = of_file.map(|(node, _)| node).filter(|_| !is_locked);
        let motion = motion.filter(|_| !is_locked);
        Self { camera, node, up, middle, view_angle_deg, motion }
    }

    /// Returns true if the description moves the camera, whatever its node does.
    pub fn has_motion(&self) -> bool {
        self.motion.is_some()
    }

    /// Returns the camera at a time, at which `graph` is posed.
    pub fn at<C: AsRef<PointCloud>>(&self, time_secs: f64, graph: &Graph<C>) -> Camera {
        let of_file = graph.camera().filter(|_| self.node.is_some());
        let camera = of_file.map_or(self.camera, |(_, camera)| {
            adjusted_file_camera(camera, self.middle, self.view_angle_deg)
        });
        self.motion.as_ref().map_or(camera, |motion| motion.at(time_secs, camera, self.up))
    }
}

/// Returns the movement of the camera that a description has, if it has one.
///
/// # Errors
///
/// Fails for missing keys, and for lists of different lengths.
pub fn camera_motion(description: &SceneDescription) -> Result<Option<CameraMotion>, Invalid> {
    let mut motion = None;
    for animation in description.animations.iter().filter(|animation| animation.is_of_camera()) {
        animation.camera_motion(motion.get_or_insert_default())?;
    }
    Ok(motion)
}

/// A file's camera has a direction, but no distance of what it looks at, about which orbits go: as far as the middle of
/// the scene, unless that is behind it.
fn adjusted_file_camera(camera: Camera, middle: DVec3, view_angle_deg: Option<f64>) -> Camera {
    let [.., forward] = camera.axes();
    let depth = forward.dot(middle - camera.position);
    let focal_point = camera.position + depth * forward;
    let perspective =
        view_angle_deg.map(|view_angle_deg| Projection::Perspective { view_angle_deg });
    Camera {
        focal_point: if 0.0 < depth { focal_point } else { camera.focal_point },
        projection: perspective.unwrap_or(camera.projection),
        ..camera
    }
}

/// Leaves only the camera of this name in the graph.
pub fn keep_named_camera<C: AsRef<PointCloud>>(
    graph: &mut Graph<C>,
    name: &str,
) -> Result<(), Invalid> {
    let is_visible = graph.visible_nodes();
    let nodes = graph.nodes.iter().enumerate();
    let cameras = nodes.filter(|(i, node)| node.camera.is_some() && is_visible[*i]);
    let cameras: Vec<(usize, &str)> = cameras.map(|(i, node)| (i, node.name.as_str())).collect();
    let Some((kept, _)) = cameras.iter().find(|(_, known)| *known == name) else {
        let names: Vec<&str> = cameras.iter().map(|(_, name)| *name).collect();
        let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        return Err(Invalid::at("camera.name", format!("no camera `{name}`; there is {known}")));
    };
    let kept = *kept;
    let others = graph.nodes.iter_mut().enumerate().filter(|(i, _)| *i != kept);
    others.for_each(|(_, node)| node.camera = None);
    Ok(())
}

/// Returns the world's up: of the description, or found from the files and points.
pub fn choose_up(
    up: Option<Vec3>,
    cloud: &PointCloud,
    files: &[FileInfo],
    progress: &dyn Progress,
) -> Vec3 {
    up.unwrap_or_else(|| {
        if files.iter().all(|file| file.format.starts_with("glTF")) {
            progress.choice("up is +Z, to which glTF files are rotated", &["up"]);
            return Vec3::Z;
        }
        let inferred = infer_up(cloud, &up_convention(cloud, files));
        progress.choice(&inferred.reason, &["up"]);
        inferred.up
    })
}

/// Returns the up axis that the formats of all files imply.
pub fn up_convention(cloud: &PointCloud, files: &[FileInfo]) -> UpConvention {
    let has_crs = files.iter().any(|file| file.coordinate_system.is_some());
    let size = cloud.bounds().max - cloud.bounds().min;
    // National grids lie far from zero.
    let is_far = 1e4 < cloud.origin.length() && f64::from(size.length()) < cloud.origin.length();
    if has_crs || is_far {
        return UpConvention::Georeferenced;
    }
    let mut conventions = files.iter().map(format_convention);
    let first = conventions.next().unwrap_or_default();
    if conventions.all(|other| other == first) { first } else { UpConvention::Unknown }
}

/// Returns the up axis that a file's format implies.
fn format_convention(file: &FileInfo) -> UpConvention {
    let is_any = |names: &[&str]| names.iter().any(|name| file.format.starts_with(name));
    let has_column = |name: &str| file.columns.iter().any(|column| column == name);
    if is_any(&["LAS", "LAZ", "COPC", "E57", "PTX", "ESRI"]) {
        UpConvention::Georeferenced
    } else if is_any(&["STL"]) {
        UpConvention::ZUp("STL files".into())
    } else if is_any(&["OBJ"]) {
        UpConvention::YUp("OBJ files".into())
    } else if has_column("f_dc_0") && has_column("rot_0") {
        UpConvention::YUp("trained splats".into())
    } else {
        UpConvention::Unknown
    }
}

/// Returns a camera from settings; what they leave open is chosen so that the whole cloud is seen, or the inside of
/// `room`.
///
/// `frame` has the up direction, the shape of the picture, and whether the camera goes around.
pub fn choose_camera(
    settings: &CameraSettings,
    cloud: &PointCloud,
    frame: &CameraFit,
    room: Option<&Room>,
    progress: &dyn Progress,
) -> Camera {
    let up = frame.up;
    if settings.is_panorama() {
        return panorama(settings, cloud, up, progress);
    }
    let mut fit = fit(settings, frame);
    let into_room =
        |room: &Room| room.view_direction(settings.azimuth_angle(), settings.elevation_angle);
    fit.direction = fit.direction.or_else(|| room.map(into_room));
    if let Some(camera) = complete_camera(settings, &fit) {
        return camera;
    }
    let fitted = fit_camera(cloud, &fit);
    let ahead = || {
        let distance = fitted.position.distance(fitted.focal_point);
        Some(settings.position? + distance * stated_direction(settings, cloud, up)?)
    };
    let focal_point = settings.focal_point.or_else(ahead).unwrap_or(fitted.focal_point);
    let shifted = fitted.position + (focal_point - fitted.focal_point);
    let position = settings.position.unwrap_or(shifted);
    // A given position or focal point may look elsewhere than the fitted camera did.
    let view_up = settings.view_up.unwrap_or_else(|| default_view_up(up, focal_point - position));
    let projection = match settings.orthographic() {
        OrthographicHeight::Fixed(height) => Projection::Orthographic { height },
        _ => fitted.projection,
    };
    if settings.position.is_none() {
        let line = format!(
            "camera at {} looks at {}",
            short_position(position),
            short_position(focal_point)
        );
        let keys = ["camera.position", "camera.focal_point", "camera.azimuth_angle"];
        progress.choice(&line, &keys);
    }
    Camera { position, focal_point, view_up, projection }
}

/// Returns the unit direction of view that the settings state, by angles perhaps: an azimuth alone is level.
pub(super) fn stated_direction(
    settings: &CameraSettings,
    points: &PointCloud,
    up: Vec3,
) -> Option<DVec3> {
    let is_turned = settings.azimuth_angle.is_some() || settings.elevation_angle.is_some();
    let turned = || is_turned.then(|| elevation_direction(settings, points, up));
    settings.direction.or_else(turned)?.try_normalize()
}

/// The direction of an elevation: level unless the settings say otherwise.
fn elevation_direction(settings: &CameraSettings, points: &PointCloud, up: Vec3) -> DVec3 {
    let fit = CameraFit {
        up,
        is_orthographic: true,
        azimuth_deg: settings.azimuth_angle(),
        elevation_deg: settings.elevation_angle.or(Some(0.0)),
        ..CameraFit::default()
    };
    let camera = fit_camera(points, &fit);
    camera.focal_point - camera.position
}

/// The camera of settings that leave nothing open.
fn complete_camera(settings: &CameraSettings, fit: &CameraFit) -> Option<Camera> {
    let projection = match settings.orthographic() {
        OrthographicHeight::Fixed(height) => Projection::Orthographic { height },
        OrthographicHeight::Fit => return None,
        OrthographicHeight::Off => Projection::Perspective { view_angle_deg: fit.view_angle_deg },
    };
    Some(Camera {
        position: settings.position?,
        focal_point: settings.focal_point?,
        view_up: settings.view_up?,
        projection,
    })
}

fn panorama(
    settings: &CameraSettings,
    cloud: &PointCloud,
    up: Vec3,
    progress: &dyn Progress,
) -> Camera {
    let found = panorama_camera(cloud, up, settings.azimuth_angle());
    let position = settings.position.unwrap_or(found.position);
    let ahead = position + (found.focal_point - found.position);
    if settings.position.is_none() {
        let line = format!("camera at {} looks all around", short_position(position));
        progress.choice(&line, &["camera.position", "camera.azimuth_angle"]);
    }
    Camera {
        position,
        focal_point: settings.focal_point.unwrap_or(ahead),
        view_up: settings.view_up.unwrap_or(found.view_up),
        projection: found.projection,
    }
}

fn fit(settings: &CameraSettings, frame: &CameraFit) -> CameraFit {
    CameraFit {
        is_orthographic: settings.orthographic() != OrthographicHeight::Off,
        view_angle_deg: settings.view_angle.unwrap_or(frame.view_angle_deg),
        direction: settings.direction,
        view_up: settings.view_up,
        azimuth_deg: settings.azimuth_angle(),
        elevation_deg: settings.elevation_angle,
        zoom: settings.zoom_factor(),
        ..*frame
    }
}

/// Writes a position with few digits, for people.
pub fn short_position(position: DVec3) -> String {
    let digits = if 1000.0 < position.abs().max_element() { 1 } else { 4 };
    position.to_array().map(|x| format!("{x:.digits$}")).join(",")
}
