//! Rules of the preparation: which points stay, and how neighbours, radii and front sides are found.

use super::Invalid;
use super::rule::{Checked, POSITIVE, Rule, parsed};
use serde_json::Value;
use std::path::Path;
use surfel_core::points::neighbors::NeighborMethod;
use surfel_core::points::{
    DEFAULT_RADIUS_SAMPLES, Denoise, Duplicates, MixedPixels, NoisePoints, Orientation, Radius,
    Subsample,
};

/// The choices of `denoise` by name.
pub const DENOISE: &[(&str, Denoise)] =
    &[("auto", Denoise::Auto), ("on", Denoise::On), ("off", Denoise::Off)];

/// The choices of `duplicates` by name.
pub const DUPLICATES: &[(&str, Duplicates)] =
    &[("drop", Duplicates::Drop), ("keep", Duplicates::Keep)];

/// The choices of `noise_points` by name.
pub const NOISE_POINTS: &[(&str, NoisePoints)] =
    &[("drop", NoisePoints::Drop), ("keep", NoisePoints::Keep)];

/// The choices of `mixed_pixels` by name.
pub const MIXED_PIXELS: &[(&str, MixedPixels)] =
    &[("drop", MixedPixels::Drop), ("keep", MixedPixels::Keep)];

/// A subsample of at least one point; the library itself also takes 0.
pub struct SubsampleRule;

impl Rule<Subsample> for SubsampleRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<Subsample, Invalid> {
        match parsed(Subsample::to_string).read(value, folder)? {
            Subsample::First(0) | Subsample::Random(0) => {
                Err(Invalid::new("expected at least one point"))
            }
            choice => Ok(choice),
        }
    }

    fn write(&self, value: &Subsample) -> Value {
        Value::String(value.to_string())
    }
}

/// A length, which may be a number, or a rule.
pub struct RadiusRule;

const LENGTH: Checked = Checked { expected: "a positive length", ..POSITIVE };

impl Rule<Radius> for RadiusRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<Radius, Invalid> {
        if value.is_number() {
            LENGTH.read(value, folder)?;
        }
        parsed(radius_text).read(value, folder)
    }

    fn write(&self, value: &Radius) -> Value {
        match value {
            // The shortest digits of the f32, not those of the f64 that it becomes.
            Radius::Fixed(length) => {
                serde_json::json!(length.to_string().parse::<f64>().unwrap_or(0.0))
            }
            other => Value::String(radius_text(other)),
        }
    }
}

fn radius_text(radius: &Radius) -> String {
    match radius {
        Radius::Fixed(length) => length.to_string(),
        Radius::Median { n, samples: DEFAULT_RADIUS_SAMPLES } => format!("median:{n}"),
        Radius::Median { n, samples } => format!("median:{n},{samples}"),
        Radius::Adaptive { k } => format!("adaptive:{k}"),
        Radius::Curvature { k } => format!("curvature:{k}"),
    }
}

/// Returns the name of a search for neighbours.
pub fn method_name(method: &NeighborMethod) -> String {
    match method {
        NeighborMethod::Grid => "grid".into(),
        NeighborMethod::ScanLine => "scan-line".into(),
        NeighborMethod::Knn => "knn".into(),
    }
}

/// Returns the rule of front sides as the key takes it.
pub fn orientation_text(orientation: &Orientation) -> String {
    match orientation {
        Orientation::None => "none".into(),
        Orientation::Auto => "auto".into(),
        Orientation::ScanAngle => "scan-angle".into(),
        Orientation::Station => "station".into(),
        Orientation::Up => "up".into(),
        Orientation::SpanningTree => "mst".into(),
        Orientation::Viewpoint(point) => format!("viewpoint:{},{},{}", point.x, point.y, point.z),
    }
}
