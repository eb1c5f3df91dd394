//! Lights of the whole scene: sun, sky, headlight, environment map, and the exposure.

use super::keys::settings;
use super::picture::{Exposure, ExposureRule, GAIN};
use super::place::DateRule;
use super::rule::{FilePath, OneOf, POSITIVE, SeveralOf, number};
use chrono::{DateTime, FixedOffset};
use std::path::PathBuf;

/// A light of the whole scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LightKind {
    /// A distant disc with sharp or soft shadows.
    Sun,
    /// Bluish light from above, brown light from below.
    Sky,
    /// Light from the camera, without shadows.
    Headlight,
    /// No light: colours are shown as they are.
    None,
}

/// Names of the lights.
pub const LIGHT_KINDS: &[(&str, LightKind)] = &[
    ("sun", LightKind::Sun),
    ("sky", LightKind::Sky),
    ("headlight", LightKind::Headlight),
    ("none", LightKind::None),
];

settings! {
    /// Lights of the whole scene; lamps at places stand in `SceneDescription::lamps`.
    pub struct LightSettings {
        /// Lights: sun, sky, headlight, several separated by commas, or none, which shows the colours as they are
        /// [default: sun,sky; the environment map alone if there is one; a headlight where no sun reaches].
        light: Vec<LightKind>, SeveralOf(OneOf(LIGHT_KINDS)), "KINDS", common;
        /// Environment map that lights the scene: .hdr or .exr, equirectangular.
        environment: PathBuf, FilePath, "FILE";
        /// Rotates the environment map, in degrees clockwise from above; its middle is north.
        environment_rotation: f64 = 0.0, number(-360.0, 360.0), "DEG";
        /// Multiplies the light of the environment map.
        environment_strength: f64 = 1.0, GAIN, "FACTOR";
        /// Exposure in stops, or auto: the brightest hundredth of the scene comes just below white; where a legend
        /// explains the colours, level surfaces in the light show their own.
        exposure: Exposure = Exposure::Auto, ExposureRule, "EV";
    }
}

settings! {
    /// The sun.
    pub struct SunSettings {
        /// Puts the sun where it stands at a date and time, as in 2026-06-21T15:00+02:00. The place follows from the
        /// coordinate system of the file or of --crs, or is given by --place.
        date: DateTime<FixedOffset>, DateRule, "DATE";
        /// Direction of the sun in degrees clockwise from north [default: behind the camera, to the left, or to
        /// the right if more is lit then].
        azimuth: f64, number(-360.0, 360.0), "DEG";
        /// Height of the sun above the horizon in degrees.
        elevation: f64 = 40.0, number(-90.0, 90.0), "DEG";
        /// Angular diameter of the sun in degrees; 0 gives hard shadows.
        angle: f64 = 0.53, number(0.0, 180.0), "DEG";
        /// Multiplies the light of the sun.
        strength: f64 = 1.0, GAIN, "FACTOR";
    }
}

settings! {
    /// The sky.
    pub struct SkySettings {
        /// Multiplies the light of the sky.
        strength: f64 = 1.0, GAIN, "FACTOR";
        /// Distance in world units up to which surfaces hide the sky: ambient occlusion [default: 0.15 of the scene's diagonal].
        ao_distance: f64, POSITIVE, "LENGTH";
    }
}

impl LightSettings {
    /// Returns true if the scene has this light, by the settings or by default.
    pub fn has(&self, kind: LightKind) -> bool {
        match &self.light {
            Some(kinds) => kinds.contains(&kind),
            None => self.environment.is_none() && matches!(kind, LightKind::Sun | LightKind::Sky),
        }
    }

    /// Returns the lights of the scene, set or by default.
    pub fn kinds(&self) -> Vec<LightKind> {
        LIGHT_KINDS.iter().map(|(_, kind)| *kind).filter(|kind| self.has(*kind)).collect()
    }
}
