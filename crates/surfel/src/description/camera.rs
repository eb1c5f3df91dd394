//! The camera, in world coordinates: those of the files.

use super::Invalid;
use super::keys::settings;
use super::place::{CrsRule, PlaceRule};
use super::rule::{Arity, Checked, Flag, OneOf, POSITIVE, Rule, Text, VIEW_ANGLE, number};
use super::vector_rule::{Axis, Direction, Vector};
use crate::crs::Place;
use serde_json::{Value, json};
use std::path::Path;
use surfel_core::math::{DVec3, Vec3};

/// Whether rooms are shown from inside, without the walls and the ceiling between them and the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interior {
    /// Rooms with content are.
    Auto,
    /// Empty rooms are too.
    On,
    /// All walls stay.
    Off,
}

const INTERIORS: &[(&str, Interior)] =
    &[("auto", Interior::Auto), ("on", Interior::On), ("off", Interior::Off)];

/// The height of an orthographic picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OrthographicHeight {
    /// The picture is not orthographic.
    Off,
    /// All of the scene is seen.
    Fit,
    /// The height of the picture in world units.
    Fixed(f64),
}

settings! {
    /// The camera; whatever is not set is chosen so that the whole scene is seen.
    pub struct CameraSettings {
        /// Position of the camera [default: so that the whole scene is seen, or the station of a single
        /// scan].
        position: DVec3, Vector, "X,Y,Z", common;
        /// Point in the middle of the picture.
        focal_point: DVec3, Vector, "X,Y,Z", common;
        /// Direction that points up in the picture.
        view_up: DVec3, Direction, "X,Y,Z";
        /// Vertical field of view in degrees [default: 35, 60 at a station, or that of the file's camera].
        view_angle: f64, VIEW_ANGLE, "DEG";
        /// Projects without perspective; HEIGHT is the height of the picture in world units [default: all of the
        /// scene].
        orthographic: OrthographicHeight = OrthographicHeight::Off, OrthographicRule, "HEIGHT";
        /// Looks all around (equirectangular): the width is a full turn, the height reaches from straight up to
        /// straight down. Stands at a free spot inside the scene unless a position is given. Best twice as wide as
        /// high.
        panorama: bool, Flag, "BOOL";
        /// Direction in which the camera looks at the whole scene: 0,0,-1 for a map.
        direction: DVec3, Direction, "X,Y,Z";
        /// Rotates the chosen camera about the scene, or a panorama from north, in degrees clockwise from above.
        azimuth_angle: f64 = 0.0, number(-360.0, 360.0), "DEG", common;
        /// Height of the chosen camera above the horizon in degrees.
        elevation_angle: f64, number(-90.0, 90.0), "DEG";
        /// Stands where the scanner of this scan stood, and looks along the longest view: a station of an E57, PTX,
        /// PCD or PLY file, as surfel info lists them.
        station: String, Text, "NAME";
        /// Moves the chosen camera nearer (above 1) or farther away.
        zoom_factor: f64 = 1.0, POSITIVE, "FACTOR";
        /// Hides the walls and the ceiling of a room that stand between its inside and the camera: auto (rooms with
        /// furniture or other content), on (empty rooms too) or off. Only auto shows single scans from their station
        /// and tunnels from within.
        interior: Interior = Interior::Auto, OneOf(INTERIORS), "WHEN";
        /// Keeps the camera where it is, even if the scene animates it.
        lock: bool = false, Flag, "BOOL";
        /// Looks through the camera of this name in a glTF file [default: the first].
        name: String, Text, "NAME";
    }
}

settings! {
    /// Directions of the world, and where on Earth it is.
    pub struct WorldSettings {
        /// Axis that points up: +Z, -Y or x,y,z [default: found from the data].
        up: Vec3, Axis, "AXIS", common;
        /// Coordinate reference system of the coordinates, as in EPSG:25832 [default: that of the files]. It tells the
        /// unit, and where the sun of --sun stands. Files in degrees are moved to it; EPSG:4326 states that coordinates
        /// are degrees.
        crs: String, CrsRule, "CRS";
        /// Latitude and longitude in degrees, for the sun of --sun [default: by the coordinate system].
        place: Place, PlaceRule, "LAT,LON";
    }
}

/// True, false, or the height of the picture.
struct OrthographicRule;

const HEIGHT: Checked =
    Checked { allows: POSITIVE.allows, expected: "true, false or a positive height" };

impl Rule<OrthographicHeight> for OrthographicRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<OrthographicHeight, Invalid> {
        match value {
            Value::Bool(true) => Ok(OrthographicHeight::Fit),
            Value::Bool(false) => Ok(OrthographicHeight::Off),
            Value::String(text) if text == "true" => Ok(OrthographicHeight::Fit),
            Value::String(text) if text == "false" => Ok(OrthographicHeight::Off),
            value => Ok(OrthographicHeight::Fixed(HEIGHT.read(value, folder)?)),
        }
    }

    fn write(&self, value: &OrthographicHeight) -> Value {
        match value {
            OrthographicHeight::Off => json!(false),
            OrthographicHeight::Fit => json!(true),
            OrthographicHeight::Fixed(height) => json!(height),
        }
    }

    fn arity(&self) -> Arity {
        Arity::Optional
    }
}

impl CameraSettings {
    /// Returns true if no key places, turns or zooms the camera or changes its projection; view angle, lock, interior
    /// and name do not.
    pub fn is_automatic(&self) -> bool {
        let free = Self {
            view_angle: self.view_angle,
            lock: self.lock,
            interior: self.interior,
            name: self.name.clone(),
            ..Self::default()
        };
        let is_neutral = self.azimuth_angle() == 0.0
            && self.zoom_factor() == 1.0
            && !self.is_panorama()
            && self.orthographic() == OrthographicHeight::Off;
        let set = Self {
            azimuth_angle: None,
            zoom_factor: None,
            panorama: None,
            orthographic: None,
            ..self.clone()
        };
        is_neutral && set == free
    }

    /// Returns the key that states a direction of view, if one is set.
    pub(crate) fn direction_key(&self) -> Option<&'static str> {
        let is_set = [
            ("camera.direction", self.direction.is_some()),
            ("camera.azimuth_angle", self.azimuth_angle.is_some()),
            ("camera.elevation_angle", self.elevation_angle.is_some()),
        ];
        is_set.into_iter().find(|(_, is_set)| *is_set).map(|(key, _)| key)
    }

    /// Returns true if a height is set, which says what is seen whatever the zoom factor is.
    fn has_fixed_height(&self) -> bool {
        matches!(self.orthographic, Some(OrthographicHeight::Fixed(_)))
    }

    /// Returns true if position and focal point are set, which say in what direction the camera looks.
    pub(crate) fn has_both_ends(&self) -> bool {
        self.position.is_some() && self.focal_point.is_some()
    }

    /// Unsets what `over` takes the place of. A direction replaces position, focal point and view-up, and these replace a
    /// direction, where it would have no effect; a height and a zoom replace each other.
    pub(super) fn unset_excluded_by(&mut self, over: &Self) {
        if over.has_fixed_height() {
            self.zoom_factor = None;
        } else if over.zoom_factor.is_some() && self.has_fixed_height() {
            self.orthographic = Some(OrthographicHeight::Fit);
        }
        let mut merged = self.clone();
        merged.overlay(over);
        if !merged.has_both_ends() {
            return;
        }
        if over.direction_key().is_some() {
            (self.position, self.focal_point, self.view_up) = Default::default();
        } else if over.position.is_some() || over.focal_point.is_some() {
            (self.direction, self.azimuth_angle, self.elevation_angle) = Default::default();
        }
    }

    /// Checks that no zoom stands beside a height, and that the camera does not look at its own position.
    pub(super) fn check(&self) -> Result<(), Invalid> {
        if self.position.is_some() && self.position == self.focal_point {
            let text = "is the focal point too; move one of them";
            return Err(Invalid::at("camera.position", text));
        }
        if self.has_fixed_height() && self.zoom_factor.is_some() {
            let text =
                "does not change the height that camera.orthographic states; leave out one of them";
            return Err(Invalid::at("camera.zoom_factor", text));
        }
        Ok(())
    }

    /// Returns true for an equirectangular picture all around.
    pub fn is_panorama(&self) -> bool {
        self.panorama == Some(true)
    }
}
