//! Plans to scale: the camera and the size of the picture, so that pixels lie on round coordinates.

use super::camera::stated_direction;
use super::loaded::LoadedScene;
use crate::crs::{CoordinateSystem, Unit};
use crate::description::{CameraSettings, Invalid, SceneDescription};
use crate::error::Result;
use surfel_core::math::{Aabb, DVec3, Vec3};
use surfel_core::points::{PointCloud, is_valid_position};
use surfel_core::progress::Progress;
use surfel_core::render::MAX_PIXELS;
use surfel_core::scene::{Camera, Projection, default_view_up};
use surfel_core::surface::SurfaceKind;
use surfel_core::words::counted;
use surfel_formats::Georeference;

/// Returns the coordinate system of a scene: that of the description, or the one that its files share. Files whose degrees
/// were moved have that of their metres.
pub fn coordinate_system(
    scene: &LoadedScene,
    description: &SceneDescription,
) -> Option<CoordinateSystem> {
    CoordinateSystem::parse(&coordinate_system_text(scene, description)?)
}

/// Returns the coordinate system of a scene as the description or the files state it; one of the files may be unknown.
pub fn coordinate_system_text(
    scene: &LoadedScene,
    description: &SceneDescription,
) -> Option<String> {
    let of_files = scene.file_info().coordinate_system;
    let stated = description.world.crs.clone();
    let parse = |text: &Option<String>| text.as_deref().and_then(CoordinateSystem::parse);
    match parse(&stated) {
        Some(degrees) if degrees.unit() == Unit::Degrees && parse(&of_files).is_some() => of_files,
        Some(_) => stated,
        None => of_files,
    }
}

/// The whole of a plan, of which a picture may show a sheet.
#[derive(Clone, Copy, Debug)]
pub struct WholePlan {
    /// The camera that shows all points, straight above their middle if it looks down.
    pub camera: Camera,
    /// Width and height in pixels of the plan.
    pub size: [f64; 2],
}

/// Writes the camera and the resolution of a plan into a description that asks for one, and returns the plan of all points.
///
/// The edges of the picture lie on multiples of a pixel, so that plans of the same scene tile.
///
/// # Errors
///
/// Fails for coordinates in degrees, and for pictures of too many pixels or more memory than they may take.
pub fn frame_plan(
    scene: &LoadedScene,
    description: &mut SceneDescription,
    (points, bounds): (&PointCloud, Aabb),
    up: Vec3,
    progress: &dyn Progress,
) -> Result<Option<WholePlan>> {
    if !description.plan.is_to_scale() {
        return Ok(None);
    }
    let unit = coordinate_system(scene, description).map_or(Unit::Unknown, |system| system.unit());
    let key = if description.plan.gsd.is_some() { "gsd" } else { "scale" };
    let degrees =
        || Invalid::at(key, "the coordinates are degrees of longitude and latitude, not lengths");
    let metres = unit.metres().ok_or_else(degrees)?;
    let Some(pixel_size) = description.plan.pixel_size(metres) else { return Ok(None) };
    let camera = plan_camera(&description.camera, (points, bounds), up);
    let whole = Window::around(&camera, (points, bounds), pixel_size);
    let window = match description.picture.resolution {
        Some(resolution) => Window::about(&camera, resolution, pixel_size),
        None => whole,
    };
    let (width, height) = window.resolution().filter(|_| pixel_size.is_normal()).ok_or_else(|| {
        let [width, height] = window.size;
        let message = format!(
            "the plan has {width:.0}x{height:.0} pixels, more than {MAX_PIXELS} in all; use larger \
             pixels, or give the size of a sheet and its middle [resolution, camera.focal_point]"
        );
        Invalid::at(key, message)
    })?;
    let side = six_digits(pixel_size);
    let line = format!("plan of {width}x{height} pixels, each {side} {} wide", unit.symbol());
    progress.choice(&line, &["gsd", "scale", "resolution"]);
    if description.picture.resolution.is_none()
        && let Some(outside) = window.points_outside(&camera, points)
    {
        let line = outside.line(unit.symbol());
        progress.warning(&line, &["resolution", "camera.focal_point"]);
    }
    description.picture.resolution = Some((width, height));
    description.camera = window.camera_settings(&description.camera, &camera);
    scene.check_memory(description)?;
    Ok(Some(WholePlan { camera: whole.camera(&camera), size: whole.size }))
}

/// Returns where the pixels of a height map lie: where those of the picture do, if the scene has a surface and the camera
/// looks straight down.
pub(crate) fn height_map_place(
    description: &SceneDescription,
    georeference: Option<Georeference>,
) -> std::result::Result<Georeference, Invalid> {
    if description.objects_default.surface.surface() == SurfaceKind::Points {
        let advice = "needs a surface other than points [surface]";
        return Err(Invalid::at("height_map", advice));
    }
    georeference.ok_or_else(|| {
        let advice =
            "needs a camera that looks straight down without perspective: state the size of a pixel [gsd]";
        Invalid::at("height_map", advice)
    })
}

/// Writes a positive number with its first six digits.
fn six_digits(number: f64) -> String {
    let n_decimals = (6 - number.log10().ceil() as i32).clamp(0, 12) as usize;
    let text = format!("{number:.n_decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The direction of a plan's camera and the middle of its picture. Straight down, if the settings leave it open.
fn plan_camera(
    settings: &CameraSettings,
    (points, bounds): (&PointCloud, Aabb),
    up: Vec3,
) -> Camera {
    let towards = settings.position.zip(settings.focal_point).map(|(from, to)| to - from);
    let forward = stated_direction(settings, points, up).or(towards);
    let forward = forward.unwrap_or(-up.as_dvec3()).normalize();
    let middle = points.origin + (0.5 * (bounds.min + bounds.max)).as_dvec3();
    let focal_point = settings.focal_point.or(settings.position).unwrap_or(middle);
    let view_up = settings.view_up.unwrap_or_else(|| default_view_up(up, forward));
    let position = settings.position.unwrap_or_else(|| {
        // Before all points, whatever the depth of the focal point.
        let corners = [bounds.min, bounds.max].map(|corner| points.origin + corner.as_dvec3());
        let corners =
            (0..8).map(|i| DVec3::new(corners[i & 1].x, corners[i >> 1 & 1].y, corners[i >> 2].z));
        let nearest =
            corners.map(|corner| forward.dot(corner - focal_point)).fold(f64::INFINITY, f64::min);
        focal_point + (nearest - f64::from((bounds.max - bounds.min).length()) - 1.0) * forward
    });
    // A focal point behind the camera would turn it round.
    let focal_point =
        if forward.dot(focal_point - position) <= 0.0 { position + forward } else { focal_point };
    Camera { position, focal_point, view_up, projection: Projection::Orthographic { height: 1.0 } }
}

fn is_within(bounds: Aabb, point: Vec3) -> bool {
    bounds.contains(Aabb { min: point, max: point })
}

/// The part of the world that a plan shows, in pixels along the right and the up of its camera.
#[derive(Clone, Copy)]
struct Window {
    left: f64,
    top: f64,
    size: [f64; 2],
    pixel_size: f64,
}

impl Window {
    /// A window of this size about the focal point.
    fn about(camera: &Camera, (width, height): (u32, u32), pixel_size: f64) -> Self {
        let [right, up, _] = camera.axes();
        let [x, y] = [right, up].map(|axis| axis.dot(camera.focal_point) / pixel_size);
        let size = [f64::from(width), f64::from(height)];
        let (left, top) = ((x - 0.5 * size[0]).round(), (y + 0.5 * size[1]).round());
        Self { left, top, size, pixel_size }
    }

    /// The window of whole pixels around all points within bounds.
    fn around(camera: &Camera, (points, bounds): (&PointCloud, Aabb), pixel_size: f64) -> Self {
        let [right, up, _] = camera.axes();
        let within =
            points.positions.iter().filter(|p| is_valid_position(**p) && is_within(bounds, **p));
        let range = |axis: DVec3| {
            let along = within.clone().map(|p| axis.dot(p.as_dvec3()));
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            let start = axis.dot(points.origin);
            [((start + low) / pixel_size).floor(), ((start + high) / pixel_size).ceil()]
        };
        let ([left, right_edge], [bottom, top]) = (range(right), range(up));
        let size = [right_edge - left, top - bottom].map(|n| n.max(1.0));
        Self { left, top, size, pixel_size }
    }

    /// Returns width and height in pixels, if a picture can have so many.
    fn resolution(&self) -> Option<(u32, u32)> {
        let [width, height] = self.size;
        let is_possible = 1.0 <= width.min(height) && width * height <= MAX_PIXELS as f64;
        is_possible.then_some((width as u32, height as u32))
    }

    /// Returns what is known of the points that the window does not show, if there are any.
    fn points_outside(&self, camera: &Camera, points: &PointCloud) -> Option<PointsOutside> {
        let [right, up, _] = camera.axes();
        let start = [right, up].map(|axis| axis.dot(points.origin));
        let (low, high) =
            ([self.left, self.top - self.size[1]], [self.left + self.size[0], self.top]);
        let distance = |point: &Vec3| {
            let beyond = |i: usize, axis: DVec3| {
                let at = start[i] + axis.dot(point.as_dvec3());
                (self.pixel_size * low[i] - at).max(at - self.pixel_size * high[i]).max(0.0)
            };
            beyond(0, right).max(beyond(1, up))
        };
        let valid = points.positions.iter().copied().filter(|point| is_valid_position(*point));
        let bounds = Aabb::of_points(valid.clone());
        let beyond =
            valid.map(|point| distance(&point)).filter(|distance| self.pixel_size < *distance);
        let (n_points, distance) = beyond.fold((0, 0.0), |(n_points, farthest), distance| {
            (n_points + 1, distance.max(farthest))
        });
        let whole = Self::around(camera, (points, bounds), self.pixel_size);
        let middle = whole.camera_settings(&CameraSettings::default(), camera).focal_point?;
        let (size, pixel_size) = (whole.size, self.pixel_size);
        (0 < n_points).then_some(PointsOutside { n_points, distance, size, middle, pixel_size })
    }

    /// Returns the settings of a camera that shows the window.
    fn camera_settings(&self, settings: &CameraSettings, camera: &Camera) -> CameraSettings {
        let CameraSettings { lock, interior, .. } = *settings;
        CameraSettings { lock, interior, ..CameraSettings::of(&self.camera(camera)) }
    }

    /// Returns the camera moved to show the window.
    fn camera(&self, camera: &Camera) -> Camera {
        let [right, up, _] = camera.axes();
        let x = self.pixel_size * (self.left + 0.5 * self.size[0]);
        let y = self.pixel_size * (self.top - 0.5 * self.size[1]);
        let shift = [(right, x), (up, y)].map(|(axis, to)| to - axis.dot(camera.focal_point));
        // A camera that shows the window already stays as it is, bit by bit.
        let is_there = shift.iter().all(|shift| shift.abs() < 1e-6 * self.pixel_size);
        let shift = if is_there { DVec3::ZERO } else { shift[0] * right + shift[1] * up };
        Camera {
            position: camera.position + shift,
            focal_point: camera.focal_point + shift,
            projection: Projection::Orthographic { height: self.pixel_size * self.size[1] },
            ..*camera
        }
    }
}

/// Points that a plan does not show, since they lie apart from all others, and the plan that would show all points.
struct PointsOutside {
    n_points: usize,
    /// Greatest distance from the plan.
    distance: f64,
    /// Width and height of the plan of all points in pixels.
    size: [f64; 2],
    /// Middle of the plan of all points.
    middle: DVec3,
    pixel_size: f64,
}

impl PointsOutside {
    /// Returns a line for the user.
    fn line(&self, unit: &str) -> String {
        let Self { n_points, distance, size: [width, height], middle, pixel_size } = self;
        let points = counted(*n_points, "point");
        // As exact as a tenth of a pixel.
        let n_decimals = (1.0 - pixel_size.log10()).ceil().clamp(0.0, 12.0) as usize;
        let [x, y, z] = middle.to_array().map(|x| format!("{x:.n_decimals$}"));
        format!(
            "{points} outside of the plan, up to {distance:.1} {unit} away; {width:.0}x{height:.0} pixels \
             about {x},{y},{z} show all"
        )
    }
}

#[cfg(test)]
mod tests {
    //! Edges of plans lie on multiples of a pixel, and sheets meet.

    use super::*;

    const MIDDLE: DVec3 = DVec3::new(691_607.123, 5_334_760.987, 520.0);

    fn down() -> Camera {
        let projection = Projection::Orthographic { height: 1.0 };
        Camera { position: MIDDLE + DVec3::Z, focal_point: MIDDLE, view_up: DVec3::Y, projection }
    }

    fn corner(settings: &CameraSettings, size: [f64; 2], pixel_size: f64) -> [f64; 2] {
        let middle = settings.focal_point.unwrap();
        [middle.x - 0.5 * size[0] * pixel_size, middle.y + 0.5 * size[1] * pixel_size]
    }

    #[test]
    fn sheets_of_one_scale_tile() {
        let pixel_size = 0.05;
        for (width, height) in [(800, 600), (801, 599)] {
            let window = Window::about(&down(), (width, height), pixel_size);
            let settings = window.camera_settings(&CameraSettings::default(), &down());
            for edge in corner(&settings, window.size, pixel_size) {
                let pixels = edge / pixel_size;
                assert!((pixels - pixels.round()).abs() < 1e-4, "{edge}");
            }
            let moved = settings.focal_point.unwrap() - MIDDLE;
            assert!(moved.length() < pixel_size, "{moved}");
            // Framed again, nothing moves.
            let camera = Camera {
                position: settings.position.unwrap(),
                focal_point: settings.focal_point.unwrap(),
                ..down()
            };
            let again = Window::about(&camera, (width, height), pixel_size);
            assert_eq!(again.camera_settings(&CameraSettings::default(), &camera), settings);
        }
    }

    #[test]
    fn a_plan_of_everything_has_no_pixel_to_spare() {
        let positions = vec![Vec3::new(-1.2, -0.3, 0.0), Vec3::new(2.3, 4.1, 1.0), Vec3::ZERO];
        let mut points = PointCloud::from_positions(positions);
        points.origin = DVec3::new(100.0, 200.0, 0.0);
        let bounds = points.bounds();
        let camera = plan_camera(&CameraSettings::default(), (&points, bounds), Vec3::Z);
        let window = Window::around(&camera, (&points, bounds), 0.5);
        assert_eq!((window.left, window.top, window.size), (197.0, 409.0, [8.0, 10.0]));
        assert_eq!(window.resolution(), Some((8, 10)));
        assert!(1.0 < camera.position.z);
        let huge = Window::around(&camera, (&points, bounds), 1e-7);
        assert_eq!(huge.resolution(), None);
    }
}
