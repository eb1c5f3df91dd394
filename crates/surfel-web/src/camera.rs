//! Cameras as pages send them: checked, as a scene file's.

use crate::studio::{Error, Result};
use serde::Deserialize;
use serde_json::Value;
use surfel::math::DVec3;
use surfel::scene::{Camera, Projection};

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

/// Farthest coordinate: beyond it, not even doubles tell millimetres apart.
const FAR: f64 = 1e12;

/// The camera of a scene's `camera` key with all of its places.
pub fn parse(keys: &Value) -> Result<Camera> {
    let keys = CameraKeys::deserialize(keys);
    let keys = keys.map_err(|error| Error::Refused(format!("camera: {error}")))?;
    let camera = Camera {
        position: place("position", keys.position)?,
        focal_point: place("focal_point", keys.focal_point)?,
        view_up: place("view_up", keys.view_up)?,
        projection: projection(&keys)?,
    };
    if camera.position == camera.focal_point {
        return Err(Error::Refused("camera: position and focal_point are the same".into()));
    }
    if camera.view_up == DVec3::ZERO {
        return Err(Error::Refused("camera.view_up: found 0,0,0, expected a direction".into()));
    }
    Ok(camera)
}

fn place(name: &str, coordinates: [f64; 3]) -> Result<DVec3> {
    let place = DVec3::from_array(coordinates);
    if place.abs().max_element() < FAR {
        return Ok(place);
    }
    Err(Error::Refused(format!("camera.{name}: found {place}, expected numbers below {FAR:e}")))
}

fn projection(keys: &CameraKeys) -> Result<Projection> {
    let refused = |name: &str, found: f64, expected: &str| {
        Err(Error::Refused(format!("camera.{name}: found {found}, expected {expected}")))
    };
    match (keys.orthographic, keys.view_angle) {
        _ if keys.panorama => Ok(Projection::Panorama),
        (Some(height), _) if 0.0 < height && height < FAR => {
            Ok(Projection::Orthographic { height })
        }
        (Some(height), _) => refused("orthographic", height, "a height"),
        (None, Some(angle)) if 0.1 < angle && angle < 179.0 => {
            Ok(Projection::Perspective { view_angle_deg: angle })
        }
        (None, Some(angle)) => refused("view_angle", angle, "0.1 to 179 degrees"),
        (None, None) => Ok(Projection::Perspective { view_angle_deg: 35.0 }),
    }
}

#[cfg(test)]
mod tests {
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
    fn a_camera_is_read_in_each_projection() {
        let found = |change| parse(&keys(change)).unwrap().projection;
        let perspective = Projection::Perspective { view_angle_deg: 50.0 };
        assert_eq!(found(json!({ "view_angle": 50 })), perspective);
        assert_eq!(found(json!({ "orthographic": 7 })), Projection::Orthographic { height: 7.0 });
        assert_eq!(found(json!({ "panorama": true })), Projection::Panorama);
    }

    #[test]
    fn impossible_cameras_are_refused() {
        for wrong in [
            json!({ "position": [0, 0, 0] }),
            json!({ "position": [1e300, 0, 0] }),
            json!({ "position": [null, 0, 0] }),
            json!({ "position": "here" }),
            json!({ "view_up": [0, 0, 0] }),
            json!({ "view_angle": 0 }),
            json!({ "view_angle": 180 }),
            json!({ "orthographic": -1 }),
        ] {
            assert!(parse(&keys(wrong.clone())).is_err(), "{wrong}");
        }
        assert!(parse(&json!(7)).is_err());
    }
}
