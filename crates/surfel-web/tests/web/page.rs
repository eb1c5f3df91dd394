//! A page, as far as the server can tell.

use crate::studio::PICTURE;
use crate::viewer::Viewer;
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

pub struct Page {
    socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
}

#[derive(Debug)]
pub enum Told {
    Message(Value),
    Picture(Picture),
}

/// A picture with what is said before it.
#[derive(Debug)]
pub struct Picture {
    pub kind: u8,
    pub is_finished: bool,
    /// Of what it shows.
    pub stage_number: u16,
    pub number: u32,
    pub input: u32,
    pub size: (u16, u16),
    pub samples: u16,
    pub of_samples: u16,
    pub file: Vec<u8>,
}

pub const JPEG: u8 = 1;
pub const PNG: u8 = 2;
pub const SAVED: u8 = 3;
/// Nothing takes longer, on busy machines too.
const PATIENCE: Duration = Duration::from_secs(60);

impl Picture {
    fn read(bytes: &[u8]) -> Self {
        let short = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let long = |at: usize| u32::from(short(at)) | u32::from(short(at + 2)) << 16;
        Self {
            kind: bytes[0],
            is_finished: bytes[1] == 1,
            stage_number: short(2),
            number: long(4),
            input: long(8),
            size: (short(12), short(14)),
            samples: short(16),
            of_samples: short(18),
            file: bytes[20..].to_vec(),
        }
    }

    pub fn decoded(&self) -> image::DynamicImage {
        image::load_from_memory(&self.file).unwrap()
    }
}

impl Page {
    /// A connection on which nothing has been said.
    pub async fn connect(viewer: &Viewer) -> Result<Self, Error> {
        let link = viewer.link.replacen("http", "ws", 1);
        let (place, query) = link.rsplit_once('/').unwrap();
        let (socket, _) = connect_async(format!("{place}/ws{query}")).await?;
        Ok(Self { socket })
    }

    /// A page that looks at a scene with this patch.
    pub async fn open(viewer: &Viewer, scene: Value) -> Self {
        let mut page = Self::connect(viewer).await.unwrap();
        let (width, height) = PICTURE;
        page.say(json!({ "type": "hello", "width": width, "height": height, "scene": scene }))
            .await;
        page
    }

    pub async fn say(&mut self, message: Value) {
        self.send(Message::text(message.to_string())).await.unwrap();
    }

    pub async fn send(&mut self, message: Message) -> Result<(), Error> {
        self.socket.send(message).await
    }

    /// What comes next; nothing from a server that has gone.
    pub async fn next(&mut self) -> Option<Told> {
        timeout(PATIENCE, self.heard()).await.expect("the server is silent")
    }

    async fn heard(&mut self) -> Option<Told> {
        loop {
            match self.socket.next().await?.ok()? {
                Message::Text(text) => {
                    return Some(Told::Message(serde_json::from_str(&text).unwrap()));
                }
                Message::Binary(bytes) => return Some(Told::Picture(Picture::read(&bytes))),
                Message::Close(_) => return None,
                _ => {}
            }
        }
    }

    /// The next message of a kind; pictures before it are said to be seen.
    pub async fn told(&mut self, kind: &str) -> Value {
        loop {
            match self.next().await.expect("the server has gone") {
                Told::Message(message) if message["type"] == kind => return message,
                Told::Message(_) => {}
                Told::Picture(picture) => self.has_seen(&picture).await,
            }
        }
    }

    /// Waits until work of this name is told of; of none, until it has ended.
    pub async fn told_state(&mut self, text: Option<&str>) -> Value {
        loop {
            let state = self.told("state").await;
            if state["text"].as_str() == text {
                return state;
            }
        }
    }

    /// The next picture, without saying that it is seen.
    pub async fn picture(&mut self) -> Picture {
        loop {
            if let Told::Picture(picture) = self.next().await.expect("the server has gone") {
                return picture;
            }
        }
    }

    /// The first picture of which this is true; all are said to be seen.
    pub async fn picture_that(&mut self, is_it: impl Fn(&Picture) -> bool) -> Picture {
        loop {
            let picture = self.picture().await;
            self.has_seen(&picture).await;
            if is_it(&picture) {
                return picture;
            }
        }
    }

    pub async fn finished(&mut self) -> Picture {
        self.picture_that(|picture| picture.is_finished).await
    }

    pub async fn has_seen(&mut self, picture: &Picture) {
        self.say(json!({ "type": "seen", "frame": picture.number })).await;
    }

    /// All that comes within a while, nothing of which is said to be seen.
    pub async fn all_within(&mut self, time: Duration) -> Vec<Told> {
        let mut all = Vec::new();
        let _ = timeout(time, async {
            while let Some(told) = self.next().await {
                all.push(told);
            }
        })
        .await;
        all
    }

    pub async fn turn(&mut self, input: u32, x: f64, is_moving: bool) {
        self.say(json!({
            "type": "camera",
            "input": input,
            "camera": camera(x),
            "moving": is_moving,
        }))
        .await;
    }

    pub async fn set(&mut self, input: u32, scene: Value) {
        self.say(json!({ "type": "set", "input": input, "scene": scene })).await;
    }
}

/// On a circle around the hill.
pub fn camera(angle_rad: f64) -> Value {
    let position = [5.0 * angle_rad.sin(), -5.0 * angle_rad.cos(), 3.0];
    json!({ "position": position, "focal_point": [0, 0, 0], "view_up": [0, 0, 1] })
}
