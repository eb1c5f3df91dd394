//! Cameras in the form in which pages send them, by the rules of scene files.

use super::rejection::rejection;
use serde_json::Value;
use surfel::SceneDescription;
use surfel::description::{CameraSettings, OrthographicHeight};
use surfel_core::scene::{Camera, CameraFit, Projection};
use surfel_web::{Error, Result, SettingsMap};

/// Returns the camera of a `camera` setting that leaves nothing to be chosen but the view angle.
///
/// # Errors
///
/// Fails for unknown and missing keys, and for values that no scene file may have.
pub fn page_camera(settings: &Value) -> Result<Camera> {
    let mut description = SceneDescription::default();
    let table = SettingsMap::from_iter([("camera".to_owned(), settings.clone())]);
    description.merge(&table).map_err(rejection)?;
    let keys = description.camera;
    let missing = |key: &str| Error::invalid_value(format!("camera.{key}"), "is missing");
    Ok(Camera {
        position: keys.position.ok_or_else(|| missing("position"))?,
        focal_point: keys.focal_point.ok_or_else(|| missing("focal_point"))?,
        view_up: keys.view_up.ok_or_else(|| missing("view_up"))?,
        projection: projection(&keys)?,
    })
}

fn projection(keys: &CameraSettings) -> Result<Projection> {
    if keys.is_panorama() {
        return Ok(Projection::Panorama);
    }
    match keys.orthographic() {
        OrthographicHeight::Off => {
            let usual = CameraFit::default().view_angle_deg;
            Ok(Projection::Perspective { view_angle_deg: keys.view_angle.unwrap_or(usual) })
        }
        OrthographicHeight::Fit => {
            Err(Error::invalid_value("camera.orthographic", "expected a height"))
        }
        OrthographicHeight::Fixed(height) => Ok(Projection::Orthographic { height }),
    }
}

#[cfg(test)]
mod tests {
    //! Cameras from settings: every projection, and invalid values.

    use super::*;
    use serde_json::json;
    use surfel::description::write_table;

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
        let found = |change| page_camera(&keys(change)).unwrap().projection;
        let perspective = |view_angle_deg| Projection::Perspective { view_angle_deg };
        assert_eq!(found(json!({})), perspective(35.0));
        assert_eq!(found(json!({ "lock": true })), perspective(35.0));
        assert_eq!(found(json!({ "orthographic": 7 })), Projection::Orthographic { height: 7.0 });
        assert_eq!(found(json!({ "panorama": true })), Projection::Panorama);
        for angle in [0.05, 50.0, 179.5] {
            assert_eq!(found(json!({ "view_angle": angle })), perspective(angle));
        }
    }

    #[test]
    fn cameras_of_scene_files_are_read() {
        for change in [json!({ "view_angle": 1e-5 }), json!({ "position": [1e14, 0, 0] })] {
            let camera = page_camera(&keys(change)).unwrap();
            let settings = Value::Object(write_table(&CameraSettings::of(&camera)));
            assert_eq!(page_camera(&settings).unwrap(), camera);
        }
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
            json!({ "orthographic": true }),
            json!({ "tint": 1 }),
        ] {
            assert!(page_camera(&keys(invalid.clone())).is_err(), "{invalid}");
        }
        for invalid in [json!(7), json!(null), json!({}), json!({ "position": [0, 0, 0] })] {
            assert!(page_camera(&invalid).is_err(), "{invalid}");
        }
    }
}
