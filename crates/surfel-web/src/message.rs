//! What pages say: docs/server.md lists the messages both ways.

use crate::studio::Keys;
use serde::Deserialize;
use serde_json::Value;

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Incoming {
    Hello {
        width: u32,
        height: u32,
        #[serde(default)]
        scene: Keys,
    },
    Size {
        width: u32,
        height: u32,
    },
    Camera {
        input: u32,
        camera: Value,
        #[serde(default)]
        moving: bool,
    },
    Set {
        input: u32,
        scene: Keys,
        #[serde(default)]
        moving: bool,
    },
    Seen {
        frame: u32,
    },
    Pick {
        id: u32,
        x: f64,
        y: f64,
    },
    Save {
        id: u32,
        width: u32,
        height: u32,
    },
    Cancel {
        id: u32,
    },
    Take {
        id: u32,
        width: u32,
        height: u32,
    },
    Load {
        id: u32,
        name: String,
        text: String,
    },
}

impl Incoming {
    pub fn parse(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| format!("message not understood: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_understood_or_refused() {
        let hello = Incoming::parse(r#"{"type":"hello","width":3,"height":2}"#);
        assert!(matches!(hello, Ok(Incoming::Hello { width: 3, height: 2, .. })));
        for wrong in [
            "",
            "7",
            "{}",
            r#"{"type":"format"}"#,
            r#"{"type":"size","width":-1,"height":2}"#,
            r#"{"type":"size","width":1e99,"height":2}"#,
            r#"{"type":"set","input":1,"scene":[]}"#,
        ] {
            assert!(Incoming::parse(wrong).is_err(), "{wrong}");
        }
    }
}
