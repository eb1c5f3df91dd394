//! The path of the camera that a page has edited: keys of the scene file, which its movie follows and its view does not.

use super::rejection::rejection;
use super::temp_download::TempDownload;
use serde_json::{Value, json};
use std::sync::Arc;
use surfel::SceneDescription;
use surfel::description::{AnimationDescription, AnimationKind, write_table};
use surfel::live_movie::{movie, movie_length};
use surfel::live_scene::LiveScene;
use surfel_core::progress::Progress;
use surfel_formats::TempFile;
use surfel_web::{Error, Limits, MovieRequest, Result, SettingsMap, WrittenFile};

/// The key of a page's settings: the table of an animation of the camera, without object and kind.
pub const KEY: &str = "camera_path";

/// Formats of movies.
const FORMATS: [&str; 4] = ["mp4", "webm", "gif", "png"];

/// Maximum number of keys of a path.
const MAX_KEYS: usize = 500;

/// Returns the path of the camera in settings, if they have one.
///
/// # Errors
///
/// Fails for keys and values that an animation of the camera does not have, and for too many keys.
pub fn camera_path(settings: &SettingsMap) -> Result<Option<AnimationDescription>> {
    let Some(path) = settings.get(KEY) else { return Ok(None) };
    let invalid = |text: &str| Error::invalid_value(KEY, text);
    let mut table = path.as_object().ok_or_else(|| invalid("expected a table"))?.clone();
    if table.contains_key("object") || table.contains_key("kind") {
        return Err(invalid("expected times, and the cameras at them"));
    }
    if table.values().filter_map(Value::as_array).any(|list| MAX_KEYS < list.len()) {
        return Err(invalid(&format!("expected at most {MAX_KEYS} keys")));
    }
    table.insert("object".into(), json!("camera"));
    let scene = SettingsMap::from_iter([("animation".to_owned(), json!([table]))]);
    let description = SceneDescription::from_table(&scene, "".as_ref()).map_err(rejection);
    let description = description.map_err(|error| invalid(&error.to_string()))?;
    Ok(description.animations.into_iter().next())
}

/// Returns the path in a description as settings have it, if there is one with keys.
pub fn path_setting(description: &SceneDescription) -> Option<Value> {
    let is_path = |animation: &&AnimationDescription| {
        animation.is_of_camera() && animation.kind() == AnimationKind::Keys
    };
    let path = description.animations.iter().rfind(is_path)?;
    let mut table = write_table(path);
    table.shift_remove("object");
    table.shift_remove("kind");
    Some(Value::Object(table))
}

/// Returns a description whose camera follows a path in place of all other movements of the camera.
pub fn with_path(
    mut description: SceneDescription,
    path: AnimationDescription,
) -> SceneDescription {
    description.animations.retain(|animation| !animation.is_of_camera());
    description.animations.push(path);
    description.camera.lock = None;
    description
}

/// Renders the movie of a description.
///
/// # Errors
///
/// Fails for other formats, for movies beyond the limits, as rendering does, and if cancelled.
pub fn write_movie(
    scene: &LiveScene,
    mut description: SceneDescription,
    options: &MovieRequest,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<Arc<dyn WrittenFile>> {
    let MovieRequest { format, fps } = options;
    if !FORMATS.contains(&&format[..]) {
        let text = format!("found the format {format}, expected {}", FORMATS.join(", "));
        return Err(Error::invalid_request(text));
    }
    description.set("fps", &json!(fps), "".as_ref()).map_err(rejection)?;
    let n_frames = movie_length(scene, &description).map_err(rejection)?;
    let picture = &description.picture;
    let rays_per_pixel = u64::from(picture.spp()) + u64::from(picture.light_samples());
    limits.check_movie(picture.resolution(), rays_per_pixel, n_frames)?;
    let name = format!("movie.{format}");
    let mut written_to = String::new();
    let file = TempFile::write(&name, |path| {
        written_to = path.display().to_string();
        movie(scene, &description, path, progress).map(drop)
    });
    let file = file.map_err(|error| match error {
        surfel::Error::File(error) if !matches!(error, surfel_formats::Error::Core(_)) => {
            Error::invalid_request(error.to_string().replace(&written_to, &name))
        }
        error => rejection(error),
    })?;
    Ok(Arc::new(TempDownload { n_items: n_frames.into(), file }))
}
