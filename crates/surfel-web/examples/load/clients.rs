//! Pages that orbit a scene at once, each with a new camera for every frame of a screen.

use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::error::Error;
use std::time::{Duration, Instant};
use surfel_core::math::DVec3;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

/// The reason why a page got no pictures.
pub type Failure = Box<dyn Error + Send + Sync>;

/// Size of a page's picture in pixels.
const SIZE: (u32, u32) = (1280, 720);
/// Interval between two cameras: a screen of 60 Hz.
const CAMERA_INTERVAL: Duration = Duration::from_millis(16);
const RADIANS_PER_S: f64 = 0.5;

/// Measurements of one page.
#[derive(Default)]
pub struct PageStats {
    /// Number of pictures received.
    pub n_pictures: u32,
    /// Duration from a camera to the first picture that obeys it.
    pub latencies: Vec<Duration>,
}

/// Opens this many pages of the viewer at `link` and lets all of them orbit.
///
/// # Errors
///
/// Fails if a page cannot be opened, or if the server closes its connection.
pub async fn orbit_pages(
    link: &str,
    n_pages: usize,
    duration: Duration,
) -> Result<Vec<PageStats>, Failure> {
    let mut pages = Vec::new();
    for _ in 0..n_pages {
        pages.push(open(link).await?);
    }
    let start = |(socket, camera)| tokio::spawn(orbit(socket, camera, duration));
    let pages: Vec<_> = pages.into_iter().map(start).collect();
    let mut stats = Vec::new();
    for page in pages {
        stats.push(page.await??);
    }
    Ok(stats)
}

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Connects a page; returns its initial camera, too.
async fn open(link: &str) -> Result<(Socket, Value), Failure> {
    let (base, query) = link.split_once("/?").unwrap_or((link.trim_end_matches('/'), ""));
    let (mut socket, _) =
        connect_async(format!("{}/ws?{query}", base.replacen("http", "ws", 1))).await?;
    send(&mut socket, json!({ "type": "hello", "width": SIZE.0, "height": SIZE.1 })).await?;
    let camera = initial_camera(&mut socket).await?;
    Ok((socket, camera))
}

async fn orbit(
    mut socket: Socket,
    camera: Value,
    duration: Duration,
) -> Result<PageStats, Failure> {
    let (mut ticks, start) = (tokio::time::interval(CAMERA_INTERVAL), Instant::now());
    let (mut stats, mut send_times) = (PageStats::default(), vec![start]);
    while start.elapsed() < duration {
        tokio::select! {
            _ = ticks.tick() => {
                let angle = RADIANS_PER_S * start.elapsed().as_secs_f64();
                let camera = rotated(&camera, angle)?;
                let seq = send_times.len();
                send_times.push(Instant::now());
                let message =
                    json!({ "type": "camera", "seq": seq, "camera": camera, "moving": true });
                send(&mut socket, message).await?;
            }
            message = socket.next() => {
                let message = message.ok_or("the server closed the connection")??;
                let Message::Binary(bytes) = message else { continue };
                let [frame, seq] = [4, 8].map(|offset| read_u32(&bytes, offset));
                stats.n_pictures += 1;
                stats.latencies.push(send_times[seq as usize].elapsed());
                send(&mut socket, json!({ "type": "ack", "frame": frame })).await?;
            }
        }
    }
    Ok(stats)
}

async fn send(socket: &mut Socket, message: Value) -> Result<(), Failure> {
    Ok(socket.send(Message::text(message.to_string())).await?)
}

async fn initial_camera(socket: &mut Socket) -> Result<Value, Failure> {
    while let Some(message) = socket.next().await {
        let Message::Text(text) = message? else { continue };
        let message: Value = serde_json::from_str(&text)?;
        if message["type"] == "scene" {
            return Ok(message["scene"]["camera"].clone());
        }
    }
    Err("the server closed the connection".into())
}

fn read_u32(bytes: &[u8], offset: usize) -> u32 {
    u32::from_le_bytes([bytes[offset], bytes[offset + 1], bytes[offset + 2], bytes[offset + 3]])
}

/// The camera rotated about its focal point.
fn rotated(camera: &Value, angle_rad: f64) -> Result<Value, Failure> {
    let [position, focal_point, up] = ["position", "focal_point", "view_up"].map(|key| {
        serde_json::from_value(camera[key].clone()).map(|point: [f64; 3]| DVec3::from_array(point))
    });
    let (position, focal_point, up) = (position?, focal_point?, up?.normalize());
    let offset = position - focal_point;
    let (sin, cos) = angle_rad.sin_cos();
    let offset = offset * cos + up.cross(offset) * sin + up * (up.dot(offset) * (1.0 - cos));
    let mut camera = camera.clone();
    camera["position"] = json!((focal_point + offset).to_array());
    Ok(camera)
}
