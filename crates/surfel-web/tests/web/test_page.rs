//! The page's side of a connection.

use crate::hill_provider::PICTURE_SIZE;
use crate::test_server::{TIMEOUT, TestServer};
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use surfel_core::math::DVec3;
use surfel_core::scene::{Camera, CameraFit, Projection};
use surfel_web::Error;
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::{self, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, client_async, connect_async};

pub struct TestPage {
    socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
}

/// A message from the server.
#[derive(Debug)]
pub enum Received {
    Message(Value),
    Picture(Picture),
}

/// A picture, with the fields of its header.
#[derive(Debug)]
pub struct Picture {
    pub kind: u8,
    pub is_finished: bool,
    pub scene_number: u16,
    pub number: u32,
    pub seq: u32,
    pub size: (u16, u16),
    pub samples: u16,
    pub of_samples: u16,
    /// The files, each with x, y, width and height of its place.
    pub files: Vec<([u16; 4], Vec<u8>)>,
}

pub const JPEG: u8 = 1;
pub const PNG: u8 = 2;
pub const SAVED: u8 = 3;
/// Id of the requests that `sync` sends.
const SYNC_ID: u32 = u32::MAX;

impl Picture {
    fn parse(bytes: &[u8]) -> Self {
        let read_u16 = |offset: usize| u16::from_le_bytes([bytes[offset], bytes[offset + 1]]);
        let read_u32 =
            |offset: usize| u32::from(read_u16(offset)) | u32::from(read_u16(offset + 2)) << 16;
        Self {
            kind: bytes[0],
            is_finished: bytes[1] == 1,
            scene_number: read_u16(2),
            number: read_u32(4),
            seq: read_u32(8),
            size: (read_u16(12), read_u16(14)),
            samples: read_u16(16),
            of_samples: read_u16(18),
            files: if bytes[0] == SAVED {
                vec![([0; 4], bytes[20..].to_vec())]
            } else {
                placed_files(&bytes[20..])
            },
        }
    }

    /// The file of the whole picture.
    pub fn file(&self) -> &[u8] {
        &self.files[0].1
    }

    pub fn decode(&self) -> image::DynamicImage {
        image::load_from_memory(self.file()).unwrap()
    }
}

/// The files of a picture with their places.
fn placed_files(mut bytes: &[u8]) -> Vec<([u16; 4], Vec<u8>)> {
    let mut files = Vec::new();
    while let Some((head, rest)) = bytes.split_at_checked(12) {
        let rect = [0, 2, 4, 6].map(|i| u16::from_le_bytes([head[i], head[i + 1]]));
        let length = u32::from_le_bytes(head[8..].try_into().unwrap()) as usize;
        files.push((rect, rest[..length].to_vec()));
        bytes = &rest[length..];
    }
    files
}

impl TestPage {
    /// A connection on which nothing has been sent.
    pub async fn connect(server: &TestServer) -> Result<Self, tungstenite::Error> {
        let link = server.link.replacen("http", "ws", 1);
        let (base, query) = link.rsplit_once('/').unwrap();
        let (socket, _) = connect_async(format!("{base}/ws{query}")).await?;
        Ok(Self { socket })
    }

    /// A connection whose receive buffer takes a few kilobytes, so that the server soon waits for the reader.
    pub async fn connect_with_small_buffer(server: &TestServer) -> Self {
        let socket = TcpSocket::new_v4().unwrap();
        socket.set_recv_buffer_size(4096).unwrap();
        let stream = socket.connect(server.address().parse().unwrap()).await.unwrap();
        let address = format!("ws://{}/ws", server.address());
        let (socket, _) = client_async(address, MaybeTlsStream::Plain(stream)).await.unwrap();
        Self { socket }
    }

    /// A connection, as soon as the server has a permit for it.
    pub async fn connect_when_possible(server: &TestServer) -> Self {
        let start = Instant::now();
        loop {
            match Self::connect(server).await {
                Ok(page) => return page,
                Err(error) => assert!(start.elapsed() < TIMEOUT, "{error}"),
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// A page that shows the initial scene with this patch.
    pub async fn open(server: &TestServer, scene: Value) -> Self {
        let mut page = Self::connect(server).await.unwrap();
        page.send_hello(scene).await;
        page
    }

    pub async fn send_hello(&mut self, scene: Value) {
        let (width, height) = PICTURE_SIZE;
        let hello = json!({ "type": "hello", "width": width, "height": height, "scene": scene });
        self.send_json(hello).await;
    }

    pub async fn send_json(&mut self, message: Value) {
        self.send(Message::text(message.to_string())).await.unwrap();
    }

    pub async fn send(&mut self, message: Message) -> Result<(), tungstenite::Error> {
        self.socket.send(message).await
    }

    /// The next message; none if the server closed the connection.
    pub async fn next(&mut self) -> Option<Received> {
        timeout(TIMEOUT, self.receive()).await.expect("the server is silent")
    }

    async fn receive(&mut self) -> Option<Received> {
        loop {
            match self.socket.next().await?.ok()? {
                Message::Text(text) => {
                    return Some(Received::Message(serde_json::from_str(&text).unwrap()));
                }
                Message::Binary(bytes) => return Some(Received::Picture(Picture::parse(&bytes))),
                Message::Close(_) => return None,
                _ => {}
            }
        }
    }

    /// The next message of this type; pictures before it are acknowledged.
    pub async fn message(&mut self, kind: &str) -> Value {
        loop {
            match self.next().await.expect("the server closed the connection") {
                Received::Message(message) if message["type"] == kind => return message,
                Received::Message(_) => {}
                Received::Picture(picture) => self.acknowledge(&picture).await,
            }
        }
    }

    /// The next message that answers a request.
    pub async fn message_of(&mut self, id: u32) -> Value {
        loop {
            match self.next().await.expect("the server closed the connection") {
                Received::Message(message) if message["id"] == id => return message,
                Received::Message(_) => {}
                Received::Picture(picture) => self.acknowledge(&picture).await,
            }
        }
    }

    /// Waits for progress of work with this name; for none, until work has ended.
    pub async fn progress_state(&mut self, text: Option<&str>) -> Value {
        loop {
            let state = self.message("state").await;
            if state["text"].as_str() == text {
                return state;
            }
        }
    }

    /// The next picture, which is not acknowledged.
    pub async fn picture(&mut self) -> Picture {
        loop {
            let received = self.next().await.expect("the server closed the connection");
            if let Received::Picture(picture) = received {
                return picture;
            }
        }
    }

    /// The first picture for which the condition holds; all pictures are acknowledged.
    pub async fn wait_for_picture(&mut self, condition: impl Fn(&Picture) -> bool) -> Picture {
        loop {
            let picture = self.picture().await;
            self.acknowledge(&picture).await;
            if condition(&picture) {
                return picture;
            }
        }
    }

    pub async fn finished_picture(&mut self) -> Picture {
        self.wait_for_picture(|picture| picture.is_finished).await
    }

    pub async fn acknowledge(&mut self, picture: &Picture) {
        self.send_json(json!({ "type": "ack", "frame": picture.number })).await;
    }

    /// Waits until the server has handled all messages sent so far; returns the pictures received meanwhile, which
    /// are not acknowledged.
    pub async fn sync(&mut self) -> Vec<Picture> {
        self.send_json(json!({ "type": "export", "id": SYNC_ID, "width": 3, "height": 2 })).await;
        let mut pictures = Vec::new();
        loop {
            match self.next().await.expect("the server closed the connection") {
                Received::Message(message) if message["id"] == SYNC_ID => return pictures,
                Received::Message(_) => {}
                Received::Picture(picture) => pictures.push(picture),
            }
        }
    }

    /// Drops all messages received within this duration.
    pub async fn drain(&mut self, duration: Duration) {
        let _ = timeout(duration, async { while self.next().await.is_some() {} }).await;
    }

    /// The messages received within this duration; pictures are acknowledged.
    pub async fn messages_within(&mut self, duration: Duration) -> Vec<Value> {
        let end = Instant::now() + duration;
        let mut messages = Vec::new();
        let left = || end.saturating_duration_since(Instant::now());
        while let Ok(received) = timeout(left(), self.next()).await {
            match received.expect("the server closed the connection") {
                Received::Message(message) => messages.push(message),
                Received::Picture(picture) => self.acknowledge(&picture).await,
            }
        }
        messages
    }

    /// Drops all messages until the server closes the connection.
    pub async fn wait_until_closed(&mut self) {
        while self.next().await.is_some() {}
    }

    pub async fn set_camera(&mut self, seq: u32, angle_rad: f64, is_moving: bool) {
        let camera = camera(angle_rad);
        let message =
            json!({ "type": "camera", "seq": seq, "camera": camera, "moving": is_moving });
        self.send_json(message).await;
    }

    pub async fn change_settings(&mut self, seq: u32, patch: Value) {
        self.send_json(json!({ "type": "set", "seq": seq, "scene": patch })).await;
    }
}

/// A camera on a circle around the hill.
pub fn camera(angle_rad: f64) -> Value {
    let position = [5.0 * angle_rad.sin(), -5.0 * angle_rad.cos(), 3.0];
    json!({ "position": position, "focal_point": [0, 0, 0], "view_up": [0, 0, 1] })
}

/// The camera of such settings; angles up to that of a scene file's rules are valid.
pub fn camera_of(settings: &Value) -> surfel_web::Result<Camera> {
    let point = |key: &str| {
        let point = serde_json::from_value(settings[key].clone()).map(DVec3::from_array);
        let is_valid = |point: &DVec3| point.is_finite() && point.abs().max_element() < 1e15;
        let point = point.ok().filter(is_valid);
        point.ok_or_else(|| Error::invalid_value(format!("camera.{key}"), "expected a point"))
    };
    let usual = CameraFit::default().view_angle_deg;
    let view_angle_deg = settings["view_angle"].as_f64().unwrap_or(usual);
    if !(0.0 < view_angle_deg && view_angle_deg < 180.0) {
        return Err(Error::invalid_value("camera.view_angle", "expected degrees"));
    }
    let (position, focal_point) = (point("position")?, point("focal_point")?);
    if position == focal_point {
        return Err(Error::invalid_value("camera.position", "is the focal point too"));
    }
    let projection = Projection::Perspective { view_angle_deg };
    Ok(Camera { position, focal_point, view_up: point("view_up")?, projection })
}
