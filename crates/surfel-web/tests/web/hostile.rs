//! Whatever strangers send, the server goes on for everyone else, in bounded memory.

use crate::http::{begin, rest};
use crate::page::{Page, camera};
use crate::viewer::Viewer;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tokio::io::AsyncWriteExt;
use tokio_tungstenite::tungstenite::Message;

/// Numbers without an end, the same in each run.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn pick<T: Clone>(&mut self, from: &[T]) -> T {
        from[self.roll() as usize % from.len()].clone()
    }

    /// A value as messages have them, or as they should not.
    fn value(&mut self) -> Value {
        self.pick(&[
            json!(0),
            json!(1),
            json!(-1),
            json!(64),
            json!(u32::MAX),
            json!(u64::MAX),
            json!(1e308),
            json!(-1e-308),
            json!(0.5),
            json!(null),
            json!(true),
            json!(""),
            json!("x\u{0}"),
            json!([]),
            json!([1e308, 0, 0]),
            json!({}),
            json!({ "tint": 1, "tint2": null }),
            json!({ "camera": { "position": [0, 0, 0] } }),
            camera(1.0),
        ])
    }

    /// Some of the keys of some message, with any values.
    fn message(&mut self) -> Value {
        let kinds = [
            "hello", "size", "camera", "set", "seen", "pick", "save", "cancel", "take", "load", "",
        ];
        let keys = [
            "width", "height", "scene", "input", "camera", "moving", "frame", "id", "x", "y",
            "name", "text",
        ];
        let mut message = json!({ "type": self.pick(&kinds) });
        for key in keys {
            if !self.roll().is_multiple_of(4) {
                message[key] = self.value();
            }
        }
        // Most are of the right shape, so that what they say matters.
        for (key, right) in [("width", 40), ("height", 30), ("input", 7), ("id", 3), ("frame", 1)] {
            if self.roll().is_multiple_of(2) {
                message[key] = json!(right);
            }
        }
        message
    }

    fn bytes(&mut self) -> Vec<u8> {
        (0..self.roll() % 300).map(|_| self.roll() as u8).collect()
    }
}

/// Of this process, the tests beside this one among it.
fn resident_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.strip_suffix("kB"));
    kib.map_or(0.0, |kib| kib.trim().parse::<f64>().unwrap() / 1024.0)
}

const MOST_MIB: f64 = 1500.0;

async fn bears(viewer: &Viewer) {
    viewer.still_works().await;
    assert!(resident_mib() < MOST_MIB, "{}", resident_mib());
}

/// Sends as much as the server takes, reading now and then, and says how much that was.
async fn send_all(page: &mut Page, messages: impl Iterator<Item = Message>) -> usize {
    let mut n_sent = 0;
    for message in messages {
        if page.send(message).await.is_err() {
            break;
        }
        n_sent += 1;
        if n_sent % 50 == 0 {
            page.all_within(Duration::from_millis(20)).await;
        }
    }
    n_sent
}

#[tokio::test]
async fn messages_of_any_content() {
    let viewer = Viewer::start();
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    for round in 0..8 {
        let mut page = Page::open(&viewer, json!({})).await;
        page.told("scene").await;
        let messages = (0..400).map(|_| {
            if round % 2 == 0 {
                return Message::text(dice.message().to_string());
            }
            let bytes = dice.bytes();
            let text = String::from_utf8_lossy(&bytes).into_owned();
            if dice.roll().is_multiple_of(2) { Message::text(text) } else { Message::binary(bytes) }
        });
        let n_sent = send_all(&mut page, messages).await;
        assert_eq!(n_sent, 400, "round {round}");
        page.say(json!({ "type": "size", "width": 50, "height": 41 })).await;
    }
    bears(&viewer).await;
}

/// A page, once there is a place for it.
async fn connected(viewer: &Viewer) -> Page {
    loop {
        if let Ok(page) = Page::connect(viewer).await {
            return page;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn first_messages_of_any_content() {
    let viewer = Viewer::start();
    let mut dice = Dice(7);
    for _ in 0..200 {
        // Those who have just gone may still hold all places.
        let Ok(mut page) = Page::connect(&viewer).await else { continue };
        page.send(Message::text(dice.message().to_string())).await.unwrap();
    }
    for first in [
        Message::binary(vec![1, 2]),
        Message::text("hello"),
        Message::text(json!({ "type": "pick", "id": 1, "x": 0, "y": 0 }).to_string()),
        Message::text(json!({ "type": "hello", "width": 0, "height": 9 }).to_string()),
        Message::text(
            json!({ "type": "hello", "width": u32::MAX, "height": u32::MAX }).to_string(),
        ),
    ] {
        let mut page = connected(&viewer).await;
        page.send(first).await.unwrap();
        page.told("error").await;
        assert!(page.next().await.is_none());
    }
    bears(&viewer).await;
}

#[tokio::test]
async fn bytes_that_are_no_messages() {
    let viewer = Viewer::start();
    let mut dice = Dice(11);
    let upgrade = "GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\n\
        Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
        Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
    for round in 0..200 {
        let mut stream = begin(&viewer, if round % 2 == 0 { upgrade } else { "" }).await;
        let _ = stream.write_all(&dice.bytes()).await;
    }
    bears(&viewer).await;
}

#[tokio::test]
async fn numbers_and_texts_beyond_all_measure() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.told("scene").await;
    let scene = |text: &str| format!(r#"{{"type":"set","input":1,"scene":{text}}}"#);
    for text in [
        scene(&"[".repeat(100_000)),
        scene(&format!("{}1{}", r#"{"a":"#.repeat(30_000), "}".repeat(30_000))),
        scene(&format!(r#"{{"tint":"{}"}}"#, "x".repeat(200_000))),
        r#"{"type":"set","input":4294967296,"scene":{}}"#.into(),
        r#"{"type":"size","width":1e308,"height":1}"#.into(),
        r#"{"type":"pick","id":1,"x":NaN,"y":0}"#.into(),
        r#"{"type":"seen","frame":4294967295}"#.into(),
    ] {
        page.send(Message::text(text)).await.unwrap();
    }
    for (input, place) in [1e308, -1e308, 9.9e11, 1e-300, 0.0].into_iter().enumerate() {
        let mut camera = camera(0.0);
        camera["position"] = json!([place, place, place]);
        page.say(json!({ "type": "camera", "input": input, "camera": camera })).await;
    }
    page.turn(u32::MAX, 0.3, false).await;
    page.picture_that(|picture| picture.is_finished && picture.input == u32::MAX).await;
    let _ = page.send(Message::text("x".repeat(1 << 19))).await;
    while page.next().await.is_some() {}
    bears(&viewer).await;
}

#[tokio::test]
async fn floods_of_questions() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    let message = |i: u32| match i % 5 {
        0 => json!({ "type": "pick", "id": i, "x": 32, "y": 24 }),
        1 => json!({ "type": "save", "id": 1, "width": 2000, "height": 2000 }),
        2 => json!({ "type": "save", "id": i, "width": 2000, "height": 2000 }),
        3 => json!({ "type": "take", "id": i, "width": 30, "height": 20 }),
        _ => json!({ "type": "set", "input": i, "scene": { "tint": i, "stubborn": 0.2 } }),
    };
    let messages = (0..3000).map(|i| Message::text(message(i).to_string()));
    send_all(&mut page, messages).await;
    let mut other = Page::open(&viewer, json!({})).await;
    other.finished().await;
    other.say(json!({ "type": "pick", "id": 1, "x": 32, "y": 24 })).await;
    other.told("picked").await;
    drop(page);
    bears(&viewer).await;
}

/// Changes that no scene can keep up with are refused, not kept.
#[tokio::test]
async fn floods_of_large_changes() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.told("scene").await;
    page.set(1, json!({ "stubborn": 3 })).await;
    let text = "x".repeat(200_000);
    for i in 0..100 {
        page.set(2, json!({ i.to_string(): text })).await;
    }
    while !page.told("error").await["text"].as_str().unwrap().contains("wait to be seen") {}
    bears(&viewer).await;
}

/// Pages that say to have seen everything, and read nothing.
#[tokio::test]
async fn readers_that_do_not_read() {
    let viewer = Viewer::start();
    let before = resident_mib();
    let mut pages = Vec::new();
    for _ in 0..4 {
        let mut page = Page::open(&viewer, json!({})).await;
        page.say(json!({ "type": "size", "width": 1400, "height": 1000 })).await;
        pages.push(page);
    }
    let start = Instant::now();
    let mut input = 0;
    while start.elapsed() < Duration::from_secs(5) {
        for page in &mut pages {
            input += 1;
            page.turn(input, f64::from(input), input % 40 == 0).await;
            page.say(json!({ "type": "seen", "frame": u32::MAX })).await;
            let save = json!({ "type": "save", "id": input, "width": 1000, "height": 1000 });
            page.say(save).await;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    viewer.still_works().await;
    assert!(resident_mib() - before < MOST_MIB);
}

/// As many connections as a machine gives, most of which say nothing.
#[tokio::test]
async fn connections_by_the_hundred() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    let mut silent = Vec::new();
    for _ in 0..300 {
        silent.push(begin(&viewer, "").await);
    }
    page.turn(1, 1.0, false).await;
    page.picture_that(|picture| picture.is_finished && picture.input == 1).await;
    drop(silent);
    tokio::time::sleep(Duration::from_millis(500)).await;
    bears(&viewer).await;
}

/// Connections that begin something and never end it are closed within the server's patience.
#[tokio::test]
async fn silence_at_each_step() {
    let viewer = Viewer::start();
    let mut upgraded = Page::connect(&viewer).await.unwrap();
    let start = Instant::now();
    let begun = [
        begin(&viewer, "").await,
        begin(&viewer, "GET / HTTP/1.1\r\nHost: loc").await,
        begin(&viewer, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").await,
        begin(&viewer, "POST /render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n{")
            .await,
    ];
    let mut statuses = Vec::new();
    for mut stream in begun {
        statuses.push(rest(&mut stream).await.status);
    }
    assert!(statuses[..2].iter().all(|status| [0, 408].contains(status)), "{statuses:?}");
    assert_eq!(statuses[2..], [200, 408]);
    while upgraded.next().await.is_some() {}
    assert!(start.elapsed() < Duration::from_secs(35), "{:?}", start.elapsed());
    bears(&viewer).await;
}

/// A page that never says to have seen anything costs two pictures.
#[tokio::test]
async fn who_never_answers_is_not_waited_for() {
    let viewer = Viewer::start();
    let mut silent = Vec::new();
    for _ in 0..10 {
        silent.push(Page::open(&viewer, json!({})).await);
    }
    let mut page = Page::open(&viewer, json!({})).await;
    for input in 1..=20 {
        page.turn(input, f64::from(input), true).await;
        page.picture_that(|picture| picture.input == input).await;
    }
    bears(&viewer).await;
}
