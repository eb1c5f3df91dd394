//! What moves in a scene file: keys, orbits and paths, of objects and of the camera.

use super::SceneFile;
use super::fields::{Fields, rotation, scale};
use serde_json::Value;
use std::f64::consts::TAU;
use surfel::math::{DQuat, DVec3, Vec3};
use surfel::scene::{Camera, Interpolation, Keys, Track, orbit, smooth_path};

/// What an object or lamp does.
#[derive(Clone, Debug)]
pub struct Motion {
    pub object: String,
    pub tracks: Vec<Track>,
    /// Whether it turns about a place on top of how it stands.
    pub is_orbit: bool,
    /// That place, in its parent's coordinates, if not its own zero.
    pub pivot: Option<DVec3>,
}

/// What the camera does, in world coordinates.
#[derive(Clone, Debug, Default)]
pub struct CameraMotion {
    pub position: Option<Keys<DVec3>>,
    pub focal_point: Option<Keys<DVec3>>,
    /// Turns about the focal point.
    pub orbit: Option<Orbit>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    pub seconds: f64,
    pub turns: f64,
    /// The scene's up if not given.
    pub axis: Option<DVec3>,
}

const KEYS: [&str; 15] = [
    "object",
    "kind",
    "times",
    "interpolation",
    "translate",
    "rotate",
    "scale",
    "visible",
    "position",
    "focal-point",
    "points",
    "seconds",
    "turns",
    "axis",
    "center",
];

/// Reads one `[[animation]]` into the scene.
pub fn read(mut fields: Fields, scene: &mut SceneFile) -> Result<(), String> {
    let place = fields.name().to_owned();
    // Before what is missing is told: a key may be there under a wrong name.
    fields.check_known(&KEYS)?;
    let object = fields.text("object")?;
    let object =
        object.ok_or_else(|| format!("{place}: object is missing; name one, or \"camera\""))?;
    let kind = fields.text("kind")?.unwrap_or_else(|| "keys".into());
    if object == "camera" {
        let motion = scene.camera_motion.get_or_insert_default();
        match kind.as_str() {
            "keys" => {
                let (times, how) = times(&mut fields)?;
                let mut keys = |key: &str| -> Result<Option<Keys<DVec3>>, String> {
                    fields
                        .vectors(key)?
                        .map(|values| keyed(&place, &times, values, how))
                        .transpose()
                };
                let (position, focal_point) = (keys("position")?, keys("focal-point")?);
                if position.is_none() && focal_point.is_none() {
                    return Err(format!("{place}: nothing moves; give position or focal-point"));
                }
                motion.position = position.or(motion.position.take());
                motion.focal_point = focal_point.or(motion.focal_point.take());
            }
            "path" => {
                motion.position = Some(path(&mut fields)?);
            }
            "orbit" => motion.orbit = Some(read_orbit(&mut fields)?),
            other => return Err(unknown(&place, other)),
        }
        return fields.finish();
    }
    let mut motion = Motion { object, tracks: Vec::new(), is_orbit: false, pivot: None };
    match kind.as_str() {
        "keys" => motion.tracks = tracks(&mut fields, &place)?,
        "path" => motion.tracks.push(Track::Translation(path(&mut fields)?)),
        "orbit" => {
            motion.is_orbit = true;
            motion.pivot = fields.vector("center")?;
            let Orbit { seconds, turns, axis } = read_orbit(&mut fields)?;
            motion.tracks.push(Track::Rotation(orbit(axis.unwrap_or(DVec3::Z), turns, seconds)));
        }
        other => return Err(unknown(&place, other)),
    }
    fields.finish()?;
    scene.motions.push(motion);
    Ok(())
}

fn unknown(place: &str, kind: &str) -> String {
    format!("{place}: kind: found `{kind}`, expected keys, path or orbit")
}

fn read_orbit(fields: &mut Fields) -> Result<Orbit, String> {
    let seconds = seconds(fields)?;
    // Each turn takes keys, so that a line of a file could ask for any amount of memory.
    let is_number = |number: f64| number != 0.0 && number.abs() <= 1000.0;
    let expected = "a number other than 0, from -1000 to 1000";
    let turns = fields.number("turns", expected, is_number)?.unwrap_or(1.0);
    let axis = fields.vector("axis")?;
    if axis.is_some_and(|axis| axis.try_normalize().is_none()) {
        return Err(format!("{}: axis: expected a direction other than [0, 0, 0]", fields.name()));
    }
    Ok(Orbit { seconds, turns, axis })
}

fn seconds(fields: &mut Fields) -> Result<f64, String> {
    let is_time = |number: f64| (1e-3..=1e6).contains(&number);
    let found = fields.number("seconds", "seconds from 0.001 to 1000000", is_time)?;
    found.ok_or_else(|| format!("{}: seconds is missing", fields.name()))
}

/// Through points, at even speed.
fn path(fields: &mut Fields) -> Result<Keys<DVec3>, String> {
    let seconds = seconds(fields)?;
    match fields.vectors("points")? {
        Some(points) if 1 < points.len() => Ok(smooth_path(&points, seconds)),
        _ => Err(format!("{}: points: expected two places at least", fields.name())),
    }
}

fn times(fields: &mut Fields) -> Result<(Vec<f64>, Interpolation), String> {
    let place = fields.name().to_owned();
    let times = fields.numbers("times")?.unwrap_or_default();
    if times.is_empty() || !times.is_sorted_by(|a, b| a < b) {
        return Err(format!("{place}: times: expected rising seconds as in [0, 2.5, 4]"));
    }
    let how = match fields.text("interpolation")?.as_deref() {
        None | Some("linear") => Interpolation::Linear,
        Some("step") => Interpolation::Step,
        Some("ease") => Interpolation::Ease,
        Some("cubic") => Interpolation::Cubic,
        Some(other) => {
            return Err(format!(
                "{place}: interpolation: found `{other}`, expected linear, ease, cubic or step"
            ));
        }
    };
    Ok((times, how))
}

fn tracks(fields: &mut Fields, place: &str) -> Result<Vec<Track>, String> {
    let (times, how) = times(fields)?;
    let mut tracks = Vec::new();
    if let Some(values) = fields.vectors("translate")? {
        tracks.push(Track::Translation(keyed(place, &times, values, how)?));
    }
    if let Some(values) = fields.take("rotate") {
        let turns = values.as_array().and_then(|all| all.iter().map(rotation).collect());
        let turns: Vec<DQuat> = turns.ok_or_else(|| {
            fields.error("rotate", &values, "turns as in [[0, 0, 0], [0, 0, 90]]")
        })?;
        // Turns have no tangents of their own: between them a smooth start and end is what is meant.
        let how = if how == Interpolation::Cubic { Interpolation::Ease } else { how };
        check_count(place, &times, turns.len())?;
        tracks.push(Track::Rotation(Keys {
            times_secs: times.clone(),
            values: turns,
            interpolation: how,
        }));
    }
    if let Some(values) = fields.take("scale") {
        let scales: Option<Vec<DVec3>> =
            values.as_array().and_then(|all| all.iter().map(scale).collect());
        let scales = scales
            .ok_or_else(|| fields.error("scale", &values, "numbers or vectors as in [1, 2]"))?;
        tracks.push(Track::Scale(keyed(place, &times, scales, how)?));
    }
    if let Some(values) = fields.take("visible") {
        let flags: Option<Vec<bool>> =
            values.as_array().and_then(|all| all.iter().map(Value::as_bool).collect());
        let flags = flags.ok_or_else(|| fields.error("visible", &values, "[true, false]"))?;
        check_count(place, &times, flags.len())?;
        tracks.push(Track::Visible(Keys {
            times_secs: times,
            values: flags,
            interpolation: Interpolation::Step,
        }));
    }
    if tracks.is_empty() {
        return Err(format!("{place}: nothing moves; give translate, rotate, scale or visible"));
    }
    Ok(tracks)
}

fn keyed(
    place: &str,
    times: &[f64],
    values: Vec<DVec3>,
    interpolation: Interpolation,
) -> Result<Keys<DVec3>, String> {
    check_count(place, times, values.len())?;
    let keys = Keys { times_secs: times.to_vec(), values, interpolation: Interpolation::Linear };
    Ok(match interpolation {
        Interpolation::Cubic => keys.smoothed(),
        interpolation => Keys { interpolation, ..keys },
    })
}

fn check_count(place: &str, times: &[f64], n_values: usize) -> Result<(), String> {
    if times.len() == n_values {
        return Ok(());
    }
    let (values, times) = (count(n_values, "value"), count(times.len(), "time"));
    Err(format!("{place}: {values} for {times}; give one for each"))
}

fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

impl CameraMotion {
    /// `camera` moved to where it is at a time.
    pub fn at(&self, time_secs: f64, camera: Camera, up: Vec3) -> Camera {
        let focal_point = self.focal_point.as_ref().map(|keys| keys.at(time_secs));
        let focal_point = focal_point.unwrap_or(camera.focal_point);
        let position = self.position.as_ref().map(|keys| keys.at(time_secs));
        let moved = Camera { position: position.unwrap_or(camera.position), focal_point, ..camera };
        let Some(Orbit { seconds, turns, axis }) = self.orbit else { return moved };
        let axis = axis.unwrap_or(up.as_dvec3()).try_normalize().unwrap_or(DVec3::Z);
        let turn = DQuat::from_axis_angle(axis, TAU * turns * time_secs / seconds);
        moved.turned(turn)
    }

    pub fn duration_secs(&self) -> f64 {
        let keys = [&self.position, &self.focal_point];
        let ends = keys.into_iter().flatten().filter_map(|keys| keys.times_secs.last().copied());
        ends.chain(self.orbit.map(|orbit| orbit.seconds)).fold(0.0, f64::max)
    }
}
