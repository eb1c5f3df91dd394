//! Animations: keys, orbits and paths, of objects, lamps and the camera.

use super::keys::{KeyedSettings, settings};
use super::object::{Rotation, RotationRule, ScaleRule};
use super::rule::{Checked, FINITE, Flag, List, OneOf, POSITIVE, Text, VIEW_ANGLE};
use super::vector_rule::Vector;
use super::{Invalid, read_table};
use serde_json::{Map, Value};
use std::f64::consts::TAU;
use std::ops::{Div, Sub};
use std::path::Path;
use surfel_core::math::{DQuat, DVec3, Vec3};
use surfel_core::scene::{
    Camera, Interpolation, KeyframeValue, Keyframes, Projection, Track, catmull_rom_path, orbit,
};

/// The kind of an animation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnimationKind {
    /// Values at times.
    Keys,
    /// A smooth path through points at even speed.
    Path,
    /// Turns about an axis.
    Orbit,
}

const KINDS: OneOf<AnimationKind> = OneOf(&[
    ("keys", AnimationKind::Keys),
    ("path", AnimationKind::Path),
    ("orbit", AnimationKind::Orbit),
]);

const INTERPOLATIONS: OneOf<Interpolation> = OneOf(&[
    ("linear", Interpolation::Linear),
    ("ease", Interpolation::Ease),
    ("cubic", Interpolation::Cubic),
    ("step", Interpolation::Step),
]);

const VECTORS: List<Vector> =
    List { rule: Vector, expected: "vectors as in [[1, 2, 3], [4, 5, 6]]" };

/// Each turn takes keys: without a limit a line of a file could ask for any amount of memory.
const TURNS: Checked = Checked {
    allows: |x| x != 0.0 && x.abs() <= 1000.0,
    expected: "a number other than 0, from -1000 to 1000",
};

/// Maximum angle between two keys of a rotation, for the same reason.
const MAX_TURN_DEG: f64 = 360_000.0;

const SECONDS: Checked =
    Checked { allows: |x| (1e-3..=1e6).contains(&x), expected: "seconds from 0.001 to 1000000" };

settings! {
    /// An animation of an object, a lamp or the camera.
    pub struct AnimationDescription {
        /// Name of the object or lamp, or camera.
        object: String, Text, "NAME";
        /// keys, path or orbit.
        kind: AnimationKind = AnimationKind::Keys, KINDS, "KIND";
        /// Times of the keys in seconds, rising.
        times: Vec<f64>, List { rule: FINITE, expected: "numbers as in [0, 1.5]" }, "SECONDS";
        /// Interpolation between keys: linear, ease, cubic or step.
        interpolation: Interpolation = Interpolation::Linear, INTERPOLATIONS, "NAME";
        /// Positions at the times, in the coordinates of the parent.
        translate: Vec<DVec3>, VECTORS, "VECTORS";
        /// Rotations at the times.
        rotate: Vec<Rotation>,
            List { rule: RotationRule, expected: "rotations as in [[0, 0, 0], [0, 0, 90]]" }, "ROTATIONS";
        /// Scales at the times.
        scale: Vec<DVec3>, List { rule: ScaleRule, expected: "numbers or vectors as in [1, 2]" }, "SCALES";
        /// Visibility at the times.
        visible: Vec<bool>, List { rule: Flag, expected: "[true, false]" }, "FLAGS";
        /// Positions of the camera at the times, in world coordinates.
        position: Vec<DVec3>, VECTORS, "VECTORS";
        /// Points that the camera looks at, at the times.
        focal_point: Vec<DVec3>, VECTORS, "VECTORS";
        /// Directions that point up in the picture of the camera, at the times.
        view_up: Vec<DVec3>, VECTORS, "VECTORS";
        /// Vertical fields of view of the camera in degrees, at the times.
        view_angle: Vec<f64>, List { rule: VIEW_ANGLE, expected: "angles as in [35, 50]" }, "DEGREES";
        /// Heights of the picture of a camera without perspective in world units, at the times.
        orthographic: Vec<f64>, List { rule: POSITIVE, expected: "heights as in [10, 2.5]" }, "HEIGHTS";
        /// Points of a path.
        points: Vec<DVec3>, VECTORS, "VECTORS";
        /// Duration of a path or orbit.
        seconds: f64, SECONDS, "SECONDS";
        /// Turns of an orbit; negative ones go clockwise as the axis points to the viewer.
        turns: f64 = 1.0, TURNS, "N";
        /// Axis of an orbit, in the coordinates of the parent [default: up].
        axis: DVec3, Vector, "X,Y,Z";
        /// Center of an orbit, in the coordinates of the parent [default: the object's own origin].
        center: DVec3, Vector, "X,Y,Z";
    }
}

/// Keys that have a meaning for an animation, by target and kind; `object` and `kind` always have.
fn allowed(is_camera: bool, kind: AnimationKind) -> &'static [&'static str] {
    match (is_camera, kind) {
        (true, AnimationKind::Keys) => &[
            "times",
            "interpolation",
            "position",
            "focal_point",
            "view_up",
            "view_angle",
            "orthographic",
        ],
        (false, AnimationKind::Keys) => {
            &["times", "interpolation", "translate", "rotate", "scale", "visible"]
        }
        (_, AnimationKind::Path) => &["seconds", "points"],
        (true, AnimationKind::Orbit) => &["seconds", "turns", "axis"],
        (false, AnimationKind::Orbit) => &["seconds", "turns", "axis", "center"],
    }
}

/// The movement of an object or lamp.
#[derive(Clone, Debug)]
pub struct ObjectMotion {
    /// Name of the object or lamp.
    pub object: String,
    /// Properties over time.
    pub tracks: Vec<Track>,
    /// True if the tracks turn the object about a point, on top of its own placement.
    pub is_orbit: bool,
    /// That point in the coordinates of the parent; `None` is the object's own origin.
    pub pivot: Option<DVec3>,
    /// True if the axis is the scene's up, which is chosen later: the tracks turn about +Z.
    pub is_about_up: bool,
}

/// The movement of the camera, in world coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraMotion {
    /// Positions over time.
    pub position: Option<Keyframes<DVec3>>,
    /// Focal points over time.
    pub focal_point: Option<Keyframes<DVec3>>,
    /// Directions up in the picture over time.
    pub view_up: Option<Keyframes<DVec3>>,
    /// Vertical fields of view in degrees over time.
    pub view_angle: Option<Keyframes<f64>>,
    /// Heights of an orthographic picture in world units over time.
    pub orthographic: Option<Keyframes<f64>>,
    /// A turn about the focal point.
    pub orbit: Option<Orbit>,
}

/// Even turns about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Duration of all turns.
    pub seconds: f64,
    /// Number of turns.
    pub turns: f64,
    /// Axis; the scene's up if `None`.
    pub axis: Option<DVec3>,
}

impl AnimationDescription {
    /// Reads an animation from a table.
    pub(super) fn read(table: &Map<String, Value>) -> Result<Self, Invalid> {
        let mut animation = Self::default();
        read_table(&mut animation, table, Path::new(""))?;
        animation.check()?;
        Ok(animation)
    }

    /// Writes the animation as a table.
    pub(super) fn write(&self) -> Value {
        Value::Object(super::write_table(self))
    }

    /// Returns true if the camera moves.
    pub fn is_of_camera(&self) -> bool {
        self.object.as_deref() == Some("camera")
    }

    /// Fails for missing keys and for keys that have no meaning here.
    fn check(&self) -> Result<(), Invalid> {
        if self.object.is_none() {
            return Err(Invalid::at(
                "object",
                "is missing; expected the name of an object, or \"camera\"",
            ));
        }
        let allowed = allowed(self.is_of_camera(), self.kind());
        for key in self.keys() {
            let has_meaning = ["object", "kind"].contains(&key.name) || allowed.contains(&key.name);
            if !has_meaning && self.get(key.name).is_some() {
                let known = allowed.join(", ");
                return Err(Invalid::at(
                    key.name,
                    format!("has no meaning here; expected {known}"),
                ));
            }
        }
        if self.is_of_camera() {
            self.camera_motion(&mut CameraMotion::default())
        } else {
            self.object_motion().map(drop)
        }
    }

    /// Adds the movement of the camera to `motion`.
    ///
    /// # Errors
    ///
    /// Fails for missing keys, and for lists of different lengths.
    pub fn camera_motion(&self, motion: &mut CameraMotion) -> Result<(), Invalid> {
        match self.kind() {
            AnimationKind::Keys => {
                let moved = CameraMotion {
                    position: self.keyed("position", &self.position)?,
                    focal_point: self.keyed("focal_point", &self.focal_point)?,
                    view_up: self.keyed("view_up", &self.view_up)?,
                    view_angle: self.keyed("view_angle", &self.view_angle)?,
                    orthographic: self.keyed("orthographic", &self.orthographic)?,
                    orbit: None,
                };
                if moved == CameraMotion::default() {
                    let keys = "position, focal_point, view_up, view_angle or orthographic";
                    return Err(Invalid::new(format!("nothing moves; expected {keys}")));
                }
                motion.add_keys(moved);
            }
            AnimationKind::Path => motion.position = Some(self.path()?),
            AnimationKind::Orbit => motion.orbit = Some(self.orbit()?),
        }
        Ok(())
    }

    /// Returns the movement of an object or lamp.
    ///
    /// # Errors
    ///
    /// Fails for missing keys, and for lists of different lengths.
    pub fn object_motion(&self) -> Result<ObjectMotion, Invalid> {
        let object = self.object.clone().unwrap_or_default();
        let (tracks, pivot) = (Vec::new(), None);
        let mut motion =
            ObjectMotion { object, tracks, is_orbit: false, pivot, is_about_up: false };
        match self.kind() {
            AnimationKind::Keys => motion.tracks = self.tracks()?,
            AnimationKind::Path => motion.tracks.push(Track::Translation(self.path()?)),
            AnimationKind::Orbit => {
                let Orbit { seconds, turns, axis } = self.orbit()?;
                motion.is_orbit = true;
                motion.is_about_up = axis.is_none();
                motion.pivot = self.center;
                let turn = orbit(axis.unwrap_or(DVec3::Z), turns, seconds);
                motion.tracks.push(Track::Rotation(turn));
            }
        }
        Ok(motion)
    }

    fn orbit(&self) -> Result<Orbit, Invalid> {
        let (seconds, turns, axis) = (self.seconds()?, self.turns(), self.axis);
        if axis.is_some_and(|axis| axis.try_normalize().is_none()) {
            return Err(Invalid::at("axis", "expected a direction other than [0, 0, 0]"));
        }
        Ok(Orbit { seconds, turns, axis })
    }

    fn seconds(&self) -> Result<f64, Invalid> {
        self.seconds.ok_or_else(|| Invalid::at("seconds", "is missing; expected a duration"))
    }

    /// Through points, at even speed.
    fn path(&self) -> Result<Keyframes<DVec3>, Invalid> {
        let seconds = self.seconds()?;
        match &self.points {
            Some(points) if 1 < points.len() => Ok(catmull_rom_path(points, seconds)),
            _ => Err(Invalid::at("points", "expected two points at least")),
        }
    }

    fn times(&self) -> Result<&[f64], Invalid> {
        let times = self.times.as_deref().unwrap_or_default();
        if times.is_empty() || !times.is_sorted_by(|a, b| a < b) {
            return Err(Invalid::at("times", "expected rising seconds as in [0, 2.5, 4]"));
        }
        Ok(times)
    }

    fn tracks(&self) -> Result<Vec<Track>, Invalid> {
        let mut tracks = Vec::new();
        tracks.extend(self.keyed("translate", &self.translate)?.map(Track::Translation));
        if let Some(values) = &self.rotate {
            // Rotations have no tangents: between them a smooth start and end is what is meant.
            let interpolation = match self.interpolation() {
                Interpolation::Cubic => Interpolation::Ease,
                other => other,
            };
            let keys = self.keys_of("rotate", values.clone(), interpolation)?;
            tracks.push(Track::Rotation(rotation_keys(&keys)?));
        }
        tracks.extend(self.keyed("scale", &self.scale)?.map(Track::Scale));
        if let Some(flags) = &self.visible {
            tracks.push(Track::Visible(self.keys_of(
                "visible",
                flags.clone(),
                Interpolation::Step,
            )?));
        }
        if tracks.is_empty() {
            // A wrong list of times is the likelier mistake.
            self.times()?;
            return Err(Invalid::new(
                "nothing moves; expected translate, rotate, scale or visible",
            ));
        }
        Ok(tracks)
    }

    fn keyed<T: KeyframeValue + Copy + Default + Sub<Output = T> + Div<f64, Output = T>>(
        &self,
        key: &str,
        values: &Option<Vec<T>>,
    ) -> Result<Option<Keyframes<T>>, Invalid> {
        let Some(values) = values else { return Ok(None) };
        let keys = self.keys_of(key, values.clone(), Interpolation::Linear)?;
        Ok(Some(match self.interpolation() {
            Interpolation::Cubic => keys.with_catmull_rom_tangents(),
            interpolation => Keyframes { interpolation, ..keys },
        }))
    }

    fn keys_of<T>(
        &self,
        key: &str,
        values: Vec<T>,
        interpolation: Interpolation,
    ) -> Result<Keyframes<T>, Invalid> {
        let times_secs = self.times()?.to_vec();
        if times_secs.len() != values.len() {
            let (n_values, n_times) =
                (count(values.len(), "value"), count(times_secs.len(), "time"));
            return Err(Invalid::at(
                key,
                format!("{n_values} for {n_times}; expected one for each"),
            ));
        }
        Ok(Keyframes { times_secs, values, interpolation })
    }
}

/// Returns keys of a rotation that turns as the angles of `keys` say. Interpolation takes the shorter way between two keys, so
/// there are others between those that are half a turn or more apart.
fn rotation_keys(keys: &Keyframes<Rotation>) -> Result<Keyframes<DQuat>, Invalid> {
    /// Number of steps of a span with a smooth start and end: from one to the next the speed changes by a sixteenth of the
    /// greatest at most.
    const N_EASED: usize = 64;
    let Keyframes { times_secs, values, interpolation } = keys;
    let spans = values.windows(2).zip(times_secs.windows(2));
    let turns = spans.clone().map(|(pair, _)| pair[0].turn_deg(&pair[1])).fold(0.0, f64::max);
    if MAX_TURN_DEG < turns {
        let text =
            format!("turns by {turns} degrees between two keys; expected at most {MAX_TURN_DEG}");
        return Err(Invalid::at("rotate", text));
    }
    if turns < 180.0 || *interpolation == Interpolation::Step {
        let values = values.iter().map(Rotation::quaternion).collect();
        let (times_secs, interpolation) = (times_secs.clone(), *interpolation);
        return Ok(Keyframes { times_secs, values, interpolation });
    }
    let is_eased = *interpolation == Interpolation::Ease;
    let steps = spans.flat_map(|(pair, times)| {
        let n_turning = (pair[0].turn_deg(&pair[1]) / 120.0).ceil() as usize;
        let n = n_turning.max(if is_eased { N_EASED } else { 1 });
        (0..n).map(move |i| {
            let weight = i as f64 / n as f64;
            let eased = if is_eased { weight * weight * (3.0 - 2.0 * weight) } else { weight };
            (times[0] + weight * (times[1] - times[0]), pair[0].toward(&pair[1], eased))
        })
    });
    let last = times_secs.last().copied().zip(values.last().map(Rotation::quaternion));
    let (times_secs, values) = steps.chain(last).unzip();
    Ok(Keyframes { times_secs, values, interpolation: Interpolation::Linear })
}

fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

impl CameraMotion {
    /// Replaces the keys of this motion that another has, too.
    fn add_keys(&mut self, over: Self) {
        self.position = over.position.or(self.position.take());
        self.focal_point = over.focal_point.or(self.focal_point.take());
        self.view_up = over.view_up.or(self.view_up.take());
        self.view_angle = over.view_angle.or(self.view_angle.take());
        self.orthographic = over.orthographic.or(self.orthographic.take());
    }

    /// Returns `camera` moved to where it is at a time.
    pub fn at(&self, time_secs: f64, camera: Camera, up: Vec3) -> Camera {
        let focal_point = self.focal_point.as_ref().map(|keys| keys.at(time_secs));
        let focal_point = focal_point.unwrap_or(camera.focal_point);
        let position = self.position.as_ref().map(|keys| keys.at(time_secs));
        let view_up = self.view_up.as_ref().map(|keys| keys.at(time_secs));
        let moved = Camera {
            position: position.unwrap_or(camera.position),
            focal_point,
            view_up: view_up.unwrap_or(camera.view_up),
            projection: self.projection_at(time_secs, camera.projection),
        };
        let Some(Orbit { seconds, turns, axis }) = self.orbit else { return moved };
        let axis = axis.unwrap_or(up.as_dvec3()).try_normalize().unwrap_or(DVec3::Z);
        let turn_rad = TAU * turns * time_secs.clamp(0.0, seconds) / seconds;
        let turn = DQuat::from_axis_angle(axis, turn_rad);
        moved.rotated_about_focal_point(turn)
    }

    /// Smooth keys may swing beyond their values.
    fn projection_at(&self, time_secs: f64, projection: Projection) -> Projection {
        match projection {
            Projection::Perspective { view_angle_deg } => {
                let angle = self.view_angle.as_ref().map(|keys| keys.at(time_secs));
                let view_angle_deg = angle.map_or(view_angle_deg, |angle| angle.clamp(0.1, 179.0));
                Projection::Perspective { view_angle_deg }
            }
            Projection::Orthographic { height } => {
                let keyed = self.orthographic.as_ref().map(|keys| keys.at(time_secs));
                let height = keyed.map_or(height, |keyed| keyed.max(1e-3 * height));
                Projection::Orthographic { height }
            }
            Projection::Panorama => projection,
        }
    }

    /// Returns the time of the last change in seconds.
    pub fn duration_secs(&self) -> f64 {
        let vectors = [&self.position, &self.focal_point, &self.view_up];
        let numbers = [&self.view_angle, &self.orthographic];
        let vectors = vectors.into_iter().flatten().map(|keys| &keys.times_secs);
        let times = vectors.chain(numbers.into_iter().flatten().map(|keys| &keys.times_secs));
        let ends = times.filter_map(|times| times.last().copied());
        ends.chain(self.orbit.map(|orbit| orbit.seconds)).fold(0.0, f64::max)
    }
}
