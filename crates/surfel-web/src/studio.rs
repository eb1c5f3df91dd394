//! What the viewer asks of the program that started it: scenes made from settings, points by their pixels.

use serde_json::{Map, Value};
use std::any::Any;
use std::sync::Arc;
use surfel::flat::FlatScene;
use surfel::math::{DVec3, Vec3};
use surfel::progress::Progress;
use surfel::render::Settings;

/// Settings as keys of a scene file.
pub type Keys = Map<String, Value>;

/// Makes what is seen. All clients share one, each with settings of its own.
///
/// Settings come from strangers: an implementation refuses those that name files, and all else that was not
/// meant to be changed. Each call has a thread of its own, in no pool: a studio that shares its work among
/// threads has a pool for it beside the one that paints.
pub trait Studio: Send + Sync + 'static {
    /// What there is to see, as every page is told it.
    fn info(&self) -> Value;

    /// Complete settings to begin with, for a picture of this size.
    fn opening(&self, width: u32, height: u32) -> Keys;

    /// The settings that the program was started with, without what it chose itself.
    fn given(&self) -> Keys;

    /// Some of the points, prepared in a hurry: something to look at until `stage` is done.
    fn sketch(&self, settings: &Keys, progress: &dyn Progress) -> Option<Result<Stage>>;

    /// The scene of these settings; what they leave open is chosen from the data.
    fn stage(&self, settings: &Keys, progress: &dyn Progress) -> Result<Stage>;

    /// What is known about a place on a surface, as the page shows it.
    fn describe(&self, stage: &Stage, place: &Place) -> Value;

    /// The finished picture as PNG, the same bytes as the command line makes of these settings.
    fn picture(&self, settings: &Keys, progress: &dyn Progress) -> Result<Vec<u8>>;

    /// The same settings as a command line and as scene files.
    fn written(&self, settings: &Keys) -> Result<Written>;

    /// The settings of a scene file that a page sends.
    fn read(&self, name: &str, text: &str) -> Result<Keys>;
}

/// A scene ready to be looked at.
pub struct Stage {
    /// Complete: with what was chosen.
    pub settings: Keys,
    /// The camera at the settings' time, where the scene moves it; none where it stands as they say.
    pub moved_camera: Option<Value>,
    /// But for its camera, which each client moves.
    pub flat: FlatScene,
    /// But for the size, which each client chooses.
    pub quality: Settings,
    /// What the colours mean, as the page shows it.
    pub legend: Value,
    /// What the studio needs to describe places on it.
    pub source: Arc<dyn Any + Send + Sync>,
}

/// Where a ray met a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    pub instance: u32,
    /// Of the point in its cloud, or of the triangle in its mesh.
    pub id: u32,
    /// World coordinates.
    pub position: DVec3,
    pub normal: Vec3,
    /// Along the view axis.
    pub depth: f64,
}

/// Settings for use elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    pub command: String,
    pub toml: String,
    pub json: String,
}

pub type Result<T> = std::result::Result<T, Error>;

/// Why something was not made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("cancelled")]
    Cancelled,
    /// In words for the one who asked.
    #[error("{0}")]
    Refused(String),
    #[error("internal error; please report it")]
    Panicked,
    #[error("{place}: {source}")]
    Io { place: String, source: std::io::Error },
}

impl From<surfel::Error> for Error {
    fn from(error: surfel::Error) -> Self {
        match error {
            surfel::Error::Cancelled => Self::Cancelled,
            other => Self::Refused(other.to_string()),
        }
    }
}

/// `settings` with a JSON merge patch (RFC 7386): null removes a key.
pub fn merge(settings: &mut Keys, patch: &Keys) {
    for (key, value) in patch {
        match (value, settings.get_mut(key)) {
            (Value::Null, _) => drop(settings.shift_remove(key)),
            (Value::Object(inner), Some(Value::Object(table))) => merge(table, inner),
            (Value::Object(inner), _) => {
                let mut table = Keys::new();
                merge(&mut table, inner);
                settings.insert(key.clone(), Value::Object(table));
            }
            (value, _) => drop(settings.insert(key.clone(), value.clone())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_patch_changes_adds_and_removes() {
        let Value::Object(mut settings) = json!({ "a": 1, "b": { "c": 2, "d": 3 } }) else {
            panic!()
        };
        let Value::Object(patch) =
            json!({ "a": null, "b": { "c": 4, "d": null }, "e": { "f": null } })
        else {
            panic!()
        };
        merge(&mut settings, &patch);
        assert_eq!(Value::Object(settings), json!({ "b": { "c": 4 }, "e": {} }));
    }
}
