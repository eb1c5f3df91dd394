//! The interface between the viewer and the program that starts it: scenes from settings, facts about points.

use serde_json::{Map, Value};
use std::io::Read;
use std::sync::Arc;
use surfel_core::flat::{FlatScene, PointId};
use surfel_core::image::Image;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::progress::Progress;
use surfel_core::render::Settings;
use surfel_core::scene::Camera;

/// Settings as the keys and values of a scene file.
pub type SettingsMap = Map<String, Value>;

/// Makes scenes from settings. All clients share one provider; each client has its own settings.
///
/// Settings come from untrusted clients: an implementation rejects keys that name files, and every other key
/// that a client must not change. The server calls `info`, `startup_settings` and `camera` where it reads messages, so
/// they must return at once, and each other method on a thread that belongs to no pool. A provider that works in
/// parallel needs a thread pool of its own, or its work would delay rendering.
pub trait SceneProvider: Send + Sync + 'static {
    /// Facts about the loaded data that do not depend on settings, as a JSON object. The server adds its limits and
    /// sends them to every page.
    fn info(&self) -> Value;

    /// Complete settings for the first picture of a page, whose size in pixels is given.
    fn initial_settings(&self, width: u32, height: u32) -> SettingsMap;

    /// The settings that the user gave at startup, without automatic choices.
    fn startup_settings(&self) -> SettingsMap;

    /// The camera of a complete `camera` setting.
    ///
    /// # Errors
    ///
    /// Fails if a key is missing, or if its value makes no camera.
    fn camera(&self, settings: &Value) -> Result<Camera>;

    /// A scene of a subset of the points, to show until `prepare` is done; none if it would not be faster, or if the
    /// points are prepared already.
    fn preview(
        &self,
        settings: &SettingsMap,
        progress: &dyn Progress,
    ) -> Option<Result<PreparedScene>>;

    /// The scene of these settings; the provider chooses missing settings from the data.
    ///
    /// # Errors
    ///
    /// Fails if a setting is invalid, if the data cannot be prepared with it, or if `progress` cancels.
    fn prepare(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<PreparedScene>;

    /// The finished picture of these settings as a PNG file, byte for byte as the command line writes it.
    ///
    /// # Errors
    ///
    /// Fails if a setting is invalid, if the picture exceeds the limits, or if `progress` cancels.
    fn render_png(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<Vec<u8>>;

    /// Returns the settings without those that pictures of their camera lack, as a scale bar with perspective.
    fn drawable_settings(&self, settings: &SettingsMap, _progress: &dyn Progress) -> SettingsMap {
        settings.clone()
    }

    /// The histogram of a column of all points, as the page shows it: `low`, `high` and `counts` of ranges of equal width
    /// between them.
    ///
    /// # Errors
    ///
    /// Fails if no points have the column.
    fn histogram(&self, column: &str) -> Result<Value>;

    /// Writes the points that these settings show to a file of a format: `laz` or `ply`.
    ///
    /// # Errors
    ///
    /// Fails if a setting is invalid, if no points are shown, and if `progress` cancels.
    fn write_points(
        &self,
        settings: &SettingsMap,
        format: &str,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn WrittenFile>>;

    /// Writes the movie of the camera's path in these settings, whose `resolution` is that of the frames.
    ///
    /// # Errors
    ///
    /// Fails if a setting is invalid, without a path, if the movie exceeds the limits, and if `progress` cancels.
    fn write_movie(
        &self,
        settings: &SettingsMap,
        options: &MovieRequest,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn WrittenFile>>;

    /// Number of bytes of memory that the content of a file takes at least, as the file states it.
    ///
    /// # Errors
    ///
    /// Fails if the bytes are of no known format or broken.
    fn stated_bytes(&self, file: &SentFile) -> Result<u64>;

    /// Reads a file that a page adds to its view. The settings of the page then name it by its id, in the list `added_files`.
    ///
    /// # Errors
    ///
    /// Fails if the bytes are of no known format or broken, if they need too much memory, and if `progress` cancels.
    fn read_added_file(
        &self,
        file: &SentFile,
        progress: &dyn Progress,
    ) -> Result<Arc<dyn AddedFile>>;

    /// Frees memory that can be made again, as no page is connected any more.
    fn release(&self) {}

    /// These settings, without those that pictures of their camera lack, as a command line and as scene files.
    ///
    /// # Errors
    ///
    /// Fails if a setting is invalid, and if `progress` cancels.
    fn export(&self, settings: &SettingsMap, progress: &dyn Progress) -> Result<Export>;

    /// The settings in the text of a scene file that a page sends; `name` is the file's name.
    ///
    /// # Errors
    ///
    /// Fails if the text is no scene file, or if its objects are not those that are viewed.
    fn read_scene_file(&self, name: &str, text: &str) -> Result<SettingsMap>;
}

/// A file as a page sends it.
#[derive(Clone, Copy, Debug)]
pub struct SentFile<'f> {
    /// The random name by which settings name the file, in their list `added_files`.
    pub id: &'f str,
    /// Name of the file on the page's machine.
    pub name: &'f str,
    /// Content of the file.
    pub bytes: &'f [u8],
    /// Names of the files that the page has added before.
    pub taken: &'f [String],
    /// Maximum number of bytes of memory that the content may take.
    pub max_bytes: u64,
}

/// A file that a page has added to its view, in memory. No settings can name it any more when this is dropped.
pub trait AddedFile: Send + Sync {
    /// Name of the file, different from those of all other files of the page.
    fn name(&self) -> &str;

    /// The file as the page lists it: a JSON object like those of `objects` in `info`.
    fn description(&self) -> Value;

    /// Number of bytes of memory that the file takes.
    fn n_bytes(&self) -> u64;
}

/// The form of a movie.
#[derive(Clone, Debug, PartialEq)]
pub struct MovieRequest {
    /// Extension of the file, as in `mp4`.
    pub format: String,
    /// Frames a second.
    pub fps: f64,
}

/// A file of points or a movie, which is removed when this is dropped.
pub trait WrittenFile: Send + Sync {
    /// Number of points, or of frames.
    fn n_items(&self) -> u64;

    /// Size of the file.
    fn n_bytes(&self) -> u64;

    /// Opens the file.
    ///
    /// # Errors
    ///
    /// Fails if the file is not there any more.
    fn open(&self) -> std::io::Result<Box<dyn Read + Send>>;
}

/// Returns facts about a picked point of a flat scene, as the page shows them.
pub type PointDescriber = Arc<dyn Fn(&FlatScene, &PickedPoint) -> Value + Send + Sync>;

/// Returns the positions of points of a flat scene as exact as their files have them, in world coordinates; none for
/// points that are deformed.
pub type PointLocator = Arc<dyn Fn(&FlatScene, &[PointId]) -> Vec<Option<[f64; 3]>> + Send + Sync>;

/// Draws a scene's legend, scale bar, north arrow and caption onto its pictures.
pub trait PictureOverlay: Send + Sync {
    /// Draws onto a picture at rest.
    fn draw(&self, image: &mut Image, camera: &Camera);

    /// Returns the parts of the picture of `size` that are drawn on, over an enlarged `draft` of it. While the camera
    /// is moving, everything keeps its place.
    fn patches(
        &self,
        draft: &Image,
        size: (u32, u32),
        camera: &Camera,
        is_moving: bool,
    ) -> Vec<PicturePart>;
}

/// A part of a picture.
pub struct PicturePart {
    /// Column of the left edge in the picture.
    pub x: u32,
    /// Row of the upper edge in the picture.
    pub y: u32,
    /// The part.
    pub image: Image,
}

/// A scene that is ready to be rendered.
pub struct PreparedScene {
    /// The complete settings, automatic choices included.
    pub settings: SettingsMap,
    /// The `camera` setting at the scene's time, if the scene animates its camera.
    pub animated_camera: Option<Value>,
    /// The scene to render, with the camera of its settings or, at the scene's time, of its animation; each client
    /// replaces it by its own.
    pub flat: FlatScene,
    /// The render settings; each client replaces the size.
    pub render_settings: Settings,
    /// True if a picture at rest goes on to more samples than its settings have, because nobody chose their number.
    pub goes_on_at_rest: bool,
    /// The meaning of the colours, as the page shows it; null if they need no legend.
    pub legend: Value,
    /// The overlay of its pictures; none if they stay as they are.
    pub overlay: Option<Box<dyn PictureOverlay>>,
    /// Describes picked points.
    pub describe: PointDescriber,
    /// Finds exact positions of points.
    pub locate: PointLocator,
}

/// The point at which the ray through a pixel hits a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PickedPoint {
    /// Index of the instance in the flat scene.
    pub instance_idx: u32,
    /// Index of the point in its cloud, or of the triangle in its mesh.
    pub primitive_idx: u32,
    /// Position in world coordinates.
    pub position: DVec3,
    /// Unit normal of the surface in world coordinates.
    pub normal: Vec3,
    /// Distance from the camera along its view axis.
    pub depth: f64,
}

/// Settings in the forms in which they are used outside the viewer.
#[derive(Clone, Debug, PartialEq)]
pub struct Export {
    /// A command line that renders the picture.
    pub command: String,
    /// A scene file in TOML.
    pub toml: String,
    /// A scene file in JSON.
    pub json: String,
    /// A scene file in TOML of which the command line makes the movie of the camera's path; none without a path.
    pub movie: Option<String>,
}

/// A result with the viewer's error.
pub type Result<T> = std::result::Result<T, Error>;

/// The reason why the server or its provider could not do something.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The work was cancelled.
    #[error("cancelled")]
    Cancelled,
    /// A client asked for something that is invalid or not allowed.
    #[error("{}{text}", prefix(key))]
    InvalidRequest {
        /// The key of the setting with the invalid value, such as `camera.view_angle`, if a single one is at fault.
        key: Option<String>,
        /// The reason, without the key.
        text: String,
    },
    /// The server failed, whatever was asked for.
    #[error("{0}")]
    Failed(String),
    /// The work panicked.
    #[error("internal error; please report it")]
    Panicked,
    /// The operating system reported an error about a network address.
    #[error("{address}: {source}")]
    Io {
        /// Host and port.
        address: String,
        /// The system's error.
        source: std::io::Error,
    },
}

impl Error {
    /// An invalid request for which no single setting is at fault.
    pub fn invalid_request(text: impl Into<String>) -> Self {
        Self::InvalidRequest { key: None, text: text.into() }
    }

    /// An invalid value of the setting `key`.
    pub fn invalid_value(key: impl Into<String>, text: impl Into<String>) -> Self {
        Self::InvalidRequest { key: Some(key.into()), text: text.into() }
    }

    /// The key of the setting with the invalid value, if a single one is at fault.
    pub fn key(&self) -> Option<&str> {
        match self {
            Self::InvalidRequest { key, .. } => key.as_deref(),
            _ => None,
        }
    }
}

fn prefix(key: &Option<String>) -> String {
    key.as_ref().map_or(String::new(), |key| format!("{key}: "))
}

impl From<surfel_core::Error> for Error {
    fn from(error: surfel_core::Error) -> Self {
        match error {
            surfel_core::Error::Cancelled => Self::Cancelled,
            surfel_core::Error::Renderer(text) => Self::Failed(text),
            other => Self::invalid_request(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    //! Messages of errors.

    use super::*;

    #[test]
    fn an_error_message_begins_with_the_key_at_fault() {
        let error = Error::invalid_value("camera.view_angle", "found 0");
        assert_eq!(error.to_string(), "camera.view_angle: found 0");
        assert_eq!(error.key(), Some("camera.view_angle"));
        let error = Error::invalid_request("nothing to save yet");
        assert_eq!((error.to_string().as_str(), error.key()), ("nothing to save yet", None));
    }
}
