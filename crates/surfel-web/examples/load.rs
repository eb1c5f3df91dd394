//! Pages that all turn around the scene at once: what each of them gets, and what it costs the server.
//!
//! `cargo run --release -p surfel-web --example load -- LINK PAGES SECONDS [PID of the server]`
#![allow(clippy::print_stdout, reason = "this program is for its figures")]

use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::error::Error;
use std::time::{Duration, Instant};
use surfel::math::DVec3;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

type Failure = Box<dyn Error + Send + Sync>;

/// Of a page's picture.
const SIZE: (u32, u32) = (1280, 720);
/// Between two cameras, as on a screen of 60 Hz.
const TURN_EVERY: Duration = Duration::from_millis(16);
const RADIANS_PER_S: f64 = 0.5;
/// Between two looks at the server's memory.
const WEIGH_EVERY: Duration = Duration::from_secs(5);

#[tokio::main]
async fn main() -> Result<(), Failure> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [link, n_pages, secs, pid @ ..] = &words[..] else {
        return Err("expected LINK PAGES SECONDS [PID]".into());
    };
    let (n_pages, secs): (usize, f64) = (n_pages.parse()?, secs.parse()?);
    let length = Duration::from_secs_f64(secs);
    let mut pages = Vec::new();
    for _ in 0..n_pages {
        pages.push(open(link).await?);
    }
    let turn = |(socket, camera)| tokio::spawn(look_around(socket, camera, length));
    let pages: Vec<_> = pages.into_iter().map(turn).collect();
    if let Some(pid) = pid.first() {
        weigh(pid, length).await?;
    }
    let mut seen = Vec::new();
    for page in pages {
        seen.push(page.await??);
    }
    report(&seen, secs);
    Ok(())
}

/// Prints the server's memory over time.
async fn weigh(pid: &str, length: Duration) -> Result<(), Failure> {
    let start = Instant::now();
    while start.elapsed() < length {
        let status = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
        let kib = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.strip_suffix("kB"));
        let mib = kib.unwrap_or_default().trim().parse::<f64>()? / 1024.0;
        println!("{:5.0} s {mib:8.1} MiB", start.elapsed().as_secs_f64());
        tokio::time::sleep(WEIGH_EVERY).await;
    }
    Ok(())
}

/// What a page got.
#[derive(Default)]
struct Seen {
    n_pictures: u32,
    /// From a camera to the first picture that obeys it.
    latencies: Vec<Duration>,
}

fn report(pages: &[Seen], secs: f64) {
    let rates: Vec<f64> = pages.iter().map(|page| f64::from(page.n_pictures) / secs).collect();
    let least = rates.iter().copied().fold(f64::INFINITY, f64::min);
    let most = rates.iter().copied().fold(0.0, f64::max);
    let told: Vec<String> = rates.iter().map(|rate| format!("{rate:.1}")).collect();
    println!("pictures a second: {}", told.join(" "));
    println!("least {least:.1}, most {most:.1}, ratio {:.2}", most / least);
    let mut latencies: Vec<Duration> =
        pages.iter().flat_map(|page| &page.latencies).copied().collect();
    latencies.sort();
    let at = |share: f64| latencies.get((share * latencies.len() as f64) as usize);
    if let (Some(median), Some(p95)) = (at(0.5), at(0.95)) {
        println!("input to picture: median {median:.0?}, 95% within {p95:.0?}");
    }
}

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// A page, and the camera that it begins with.
async fn open(link: &str) -> Result<(Socket, Value), Failure> {
    let (place, query) = link.split_once("/?").unwrap_or((link.trim_end_matches('/'), ""));
    let (mut socket, _) =
        connect_async(format!("{}/ws?{query}", place.replacen("http", "ws", 1))).await?;
    say(&mut socket, json!({ "type": "hello", "width": SIZE.0, "height": SIZE.1 })).await?;
    let camera = opening_camera(&mut socket).await?;
    Ok((socket, camera))
}

async fn look_around(mut socket: Socket, camera: Value, length: Duration) -> Result<Seen, Failure> {
    let (mut turns, start) = (tokio::time::interval(TURN_EVERY), Instant::now());
    let (mut seen, mut sent) = (Seen::default(), vec![start]);
    while start.elapsed() < length {
        tokio::select! {
            _ = turns.tick() => {
                let angle = RADIANS_PER_S * start.elapsed().as_secs_f64();
                let camera = turned(&camera, angle)?;
                let input = sent.len();
                sent.push(Instant::now());
                let message =
                    json!({ "type": "camera", "input": input, "camera": camera, "moving": true });
                say(&mut socket, message).await?;
            }
            message = socket.next() => {
                let Message::Binary(bytes) = message.ok_or("the server has gone")?? else { continue };
                let [frame, input] = [4, 8].map(|at| number(&bytes, at));
                seen.n_pictures += 1;
                seen.latencies.push(sent[input as usize].elapsed());
                say(&mut socket, json!({ "type": "seen", "frame": frame })).await?;
            }
        }
    }
    Ok(seen)
}

async fn say(socket: &mut Socket, message: Value) -> Result<(), Failure> {
    Ok(socket.send(Message::text(message.to_string())).await?)
}

async fn opening_camera(socket: &mut Socket) -> Result<Value, Failure> {
    while let Some(message) = socket.next().await {
        let Message::Text(text) = message? else { continue };
        let message: Value = serde_json::from_str(&text)?;
        if message["type"] == "scene" {
            return Ok(message["scene"]["camera"].clone());
        }
    }
    Err("the server has gone".into())
}

fn number(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// The camera, turned around what it looks at.
fn turned(camera: &Value, angle_rad: f64) -> Result<Value, Failure> {
    let [position, focal_point, up] = ["position", "focal_point", "view_up"].map(|key| {
        serde_json::from_value(camera[key].clone()).map(|place: [f64; 3]| DVec3::from_array(place))
    });
    let (position, focal_point, up) = (position?, focal_point?, up?.normalize());
    let offset = position - focal_point;
    let (sin, cos) = angle_rad.sin_cos();
    let offset = offset * cos + up.cross(offset) * sin + up * (up.dot(offset) * (1.0 - cos));
    let mut camera = camera.clone();
    camera["position"] = json!((focal_point + offset).to_array());
    Ok(camera)
}
