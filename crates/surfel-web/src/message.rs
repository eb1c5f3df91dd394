//! Messages from pages. docs/server.md lists the messages in both directions.

use crate::scene_provider::{Error, Result, SettingsMap};
use serde::Deserialize;
use serde_json::Value;

/// A message from a page.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "camelCase")]
pub enum Incoming {
    /// The first message: the picture's size in pixels, and a patch of the initial settings. With a name, the patch
    /// is of the data of this name alone.
    Hello {
        width: u32,
        height: u32,
        #[serde(default)]
        scene: SettingsMap,
        name: Option<String>,
    },
    /// A new size of the picture in pixels.
    Size { width: u32, height: u32 },
    /// A new camera.
    Camera {
        seq: u32,
        camera: Value,
        #[serde(default)]
        moving: bool,
    },
    /// A patch of the settings.
    Set {
        seq: u32,
        scene: SettingsMap,
        #[serde(default)]
        moving: bool,
    },
    /// The page has shown this picture, and all before it.
    Ack { frame: u32 },
    /// A question whether the server answers.
    Ping,
    /// A request for the point behind a pixel.
    Pick { id: u32, x: f64, y: f64 },
    /// A question which of these points the camera sees.
    Visible { id: u32, points: Vec<[f64; 3]> },
    /// A request for the points beside a line, for a height profile.
    Profile { id: u32, points: Vec<[f64; 3]>, width: f64, up: [f64; 3] },
    /// A request for the volume between the points over a polygon and a base: `lowest`, `mean` or a height.
    Volume { id: u32, points: Vec<[f64; 3]>, up: [f64; 3], base: Value, cell_size: Option<f64> },
    /// A request for the histogram of a column.
    Histogram { id: u32, column: String },
    /// A request for a finished picture of this size.
    Save { id: u32, width: u32, height: u32 },
    /// A request for the points that are shown as a file of a format, `laz` or `ply`.
    Points { id: u32, format: String },
    /// A request for the movie of the camera's path, of this format, size and rate.
    Movie { id: u32, format: String, width: u32, height: u32, fps: f64 },
    /// Announces a file that is to be added to the page's view, by its name and size.
    AddFile { id: u32, name: String, n_bytes: u64 },
    /// Cancels a `Save`, `Points`, `Movie` or `AddFile`.
    Cancel { id: u32 },
    /// A request for the settings as command line and scene files.
    Export { id: u32, width: u32, height: u32, measurements: Option<Value> },
    /// The text of a scene file whose settings are to be shown.
    LoadScene { id: u32, name: String, text: String },
}

impl Incoming {
    /// Reads a message.
    ///
    /// # Errors
    ///
    /// Fails if the text is not JSON, or not a known message.
    pub fn parse(text: &str) -> Result<Self> {
        serde_json::from_str(text)
            .map_err(|error| Error::invalid_request(format!("invalid message: {error}")))
    }
}

#[cfg(test)]
mod tests {
    //! Valid and invalid messages of a page.

    use super::*;

    #[test]
    fn messages_are_parsed_or_rejected() {
        let hello = Incoming::parse(r#"{"type":"hello","width":3,"height":2}"#);
        assert!(matches!(hello, Ok(Incoming::Hello { width: 3, height: 2, .. })));
        let load = Incoming::parse(r#"{"type":"loadScene","id":1,"name":"a","text":"b"}"#);
        assert!(matches!(load, Ok(Incoming::LoadScene { id: 1, .. })));
        for invalid in [
            "",
            "7",
            "{}",
            r#"{"type":"format"}"#,
            r#"{"type":"size","width":-1,"height":2}"#,
            r#"{"type":"size","width":1e99,"height":2}"#,
            r#"{"type":"set","seq":1,"scene":[]}"#,
            r#"{"type":"profile","id":1,"points":[[1,2]],"width":1,"up":[0,0,1]}"#,
        ] {
            assert!(Incoming::parse(invalid).is_err(), "{invalid}");
        }
    }
}
