//! Cameras in the form in which pages send them, checked like those of a scene file.

use crate::scene_provider::{Error, Result};
use serde::Deserialize;
use serde_json::Value;
use surfel_core::math::DVec3;
use surfel_core::scene::{Camera, Projection};

#[derive(Deserialize)]
struct CameraKeys {
    position: [f64; 3],
    focal_point: [f64; 3],
    view_up: [f64; 3],
    view_angle: Option<f64>,
    orthographic: Option<f64>,
    #[serde(default)]
    panorama: bool,
}

/// Bound of coordinates and heights: beyond it, even doubles do not resolve millimetres.
const MAX_COORDINATE: f64 = 1e12;
/// Vertical view angle of a camera that gives none, in degrees.
const DEFAULT_VIEW_ANGLE_DEG: f64 = 35.0;

/// Reads a complete `camera` setting.
///
/// # Errors
///
/// Fails if a key is missing, or if its value makes no camera.
pub fn parse(settings: &Value) -> Result<Camera> {
    let keys = CameraKeys::deserialize(settings);
    let keys = keys.map_err(|error| Error::invalid_value("camera", error.to_string()))?;
    let camera = Camera {
        position: point("position", keys.position)?,
        focal_point: point("focal_point", keys.focal_point)?,
        view_up: point("view_up", keys.view_up)?,
        projection: projection(&keys)?,
    };
    if camera.position == camera.focal_point {
        return Err(Error::invalid_value("camera", "position and focal_point are the same"));
    }
    if camera.view_up == DVec3::ZERO {
        return Err(Error::invalid_value("camera.view_up", "found 0,0,0, expected a direction"));
    }
    Ok(camera)
}

fn point(name: &str, coordinates: [f64; 3]) -> Result<DVec3> {
    let point = DVec3::from_array(coordinates);
    if point.abs().max_element() < MAX_COORDINATE {
        return Ok(point);
    }
    let text = format!("found {point}, expected numbers below {MAX_COORDINATE:e}");
    Err(Error::invalid_value(format!("camera.{name}"), text))
}

fn projection(keys: &CameraKeys) -> Result<Projection> {
    let invalid = |name: &str, found: f64, expected: &str| {
        let text = format!("found {found}, expected {expected}");
        Err(Error::invalid_value(format!("camera.{name}"), text))
    };
    match (keys.orthographic, keys.view_angle) {
        _ if keys.panorama => Ok(Projection::Panorama),
        (Some(height), _) if 0.0 < height && height < MAX_COORDINATE => {
            Ok(Projection::Orthographic { height })
        }
        (Some(height), _) => invalid("orthographic", height, "a height"),
        (None, Some(angle)) if 0.1 < angle && angle < 179.0 => {
            Ok(Projection::Perspective { view_angle_deg: angle })
        }
        (None, Some(angle)) => invalid("view_angle", angle, "0.1 to 179 degrees"),
        (None, None) => Ok(Projection::Perspective { view_angle_deg: DEFAULT_VIEW_ANGLE_DEG }),
    }
}

#[cfg(test)]
mod tests {
    //! Cameras from settings: every projection, and invalid values.

    use super::*;
    use serde_json::json;

    fn keys(change: Value) -> Value {
        let mut keys =
            json!({ "position": [0, -2, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1] });
        for (key, value) in change.as_object().unwrap() {
            keys[key] = value.clone();
        }
        keys
    }

    #[test]
    fn cameras_of_each_projection_are_read() {
        let found = |change| parse(&keys(change)).unwrap().projection;
        let perspective = Projection::Perspective { view_angle_deg: 50.0 };
        assert_eq!(found(json!({ "view_angle": 50 })), perspective);
        assert_eq!(found(json!({ "orthographic": 7 })), Projection::Orthographic { height: 7.0 });
        assert_eq!(found(json!({ "panorama": true })), Projection::Panorama);
    }

    #[test]
    fn invalid_cameras_are_rejected() {
        for invalid in [
            json!({ "position": [0, 0, 0] }),
            json!({ "position": [1e300, 0, 0] }),
            json!({ "position": [null, 0, 0] }),
            json!({ "position": "here" }),
            json!({ "view_up": [0, 0, 0] }),
            json!({ "view_angle": 0 }),
            json!({ "view_angle": 180 }),
            json!({ "orthographic": -1 }),
        ] {
            assert!(parse(&keys(invalid.clone())).is_err(), "{invalid}");
        }
        assert!(parse(&json!(7)).is_err());
    }
}
