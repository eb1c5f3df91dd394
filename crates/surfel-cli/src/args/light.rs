//! Options of the light.

use super::{Usage, parse};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Args)]
#[command(next_help_heading = "Light")]
pub struct LightArgs {
    /// One or more, separated by commas; none shows the colours as they are [default: sun,sky, or none but
    /// the environment where there is one].
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    light: Option<Vec<LightKind>>,
    /// Direction of the sun, clockwise from north; behind the camera to the left if not given.
    #[arg(long, value_name = "DEG", value_parser = parse::number_in::<-360, 360>)]
    pub sun_azimuth: Option<f64>,
    /// Height of the sun over the horizon.
    #[arg(long, value_name = "DEG", default_value = "40", value_parser = parse::number_in::<-90, 90>)]
    pub sun_elevation: f64,
    /// Angular diameter of the sun; 0 gives hard shadows.
    #[arg(long, value_name = "DEG", default_value = "0.53", value_parser = parse::number_in::<0, 180>)]
    pub sun_angle: f64,
    /// 1 is the usual sun.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse::number_in::<0, 1000>)]
    pub sun_strength: f64,
    /// 1 is the usual sky.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse::number_in::<0, 1000>)]
    pub sky_strength: f64,
    /// How far away things still dim the sky, in the cloud's unit; a share of its size if not given.
    #[arg(long, value_name = "LENGTH", value_parser = parse::positive)]
    pub sky_reach: Option<f64>,
    /// Light from a picture of all that is around: .hdr or .exr, equirectangular.
    #[arg(long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Turns it, clockwise from above; its middle looks north if not given.
    #[arg(long, value_name = "DEG", default_value = "0", value_parser = parse::number_in::<-360, 360>)]
    pub environment_rotation: f64,
    /// Multiplies its light.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse::number_in::<0, 1000>)]
    pub environment_strength: f64,
    /// In stops; auto makes the brightest parts of the cloud nearly white.
    #[arg(long, value_name = "EV", default_value = "auto", value_parser = exposure)]
    pub exposure: Exposure,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LightKind {
    Sun,
    Sky,
    Headlight,
    None,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    Auto,
    Stops(f64),
}

impl LightArgs {
    pub fn check(&self) -> Result<(), Usage> {
        let is_none = self.has(LightKind::None);
        if is_none && self.light.as_ref().is_some_and(|kinds| 1 < kinds.len()) {
            return Err(Usage("--light none stands alone; leave out the others".into()));
        }
        Ok(())
    }

    /// The kinds asked for, or the usual ones.
    pub fn kinds(&self) -> Vec<LightKind> {
        LightKind::value_variants().iter().copied().filter(|kind| self.has(*kind)).collect()
    }

    pub fn has(&self, kind: LightKind) -> bool {
        match &self.light {
            Some(kinds) => kinds.contains(&kind),
            None => self.environment.is_none() && matches!(kind, LightKind::Sun | LightKind::Sky),
        }
    }
}

fn exposure(text: &str) -> Result<Exposure, String> {
    if text == "auto" {
        return Ok(Exposure::Auto);
    }
    let stops = parse::number_in::<-20, 20>(text);
    stops.map(Exposure::Stops).map_err(|_| "expected auto or a number from -20 to 20".into())
}
