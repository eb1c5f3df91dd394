//! Misbehaving clients: whatever they send, the server keeps serving others in bounded memory.

use crate::http_client::{begin, get, read_response};
use crate::test_page::{TestPage, camera};
use crate::test_server::{TIMEOUT, TestServer};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use surfel_web::{Limits, Timeouts};
use tokio::io::AsyncWriteExt;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::Message;

/// A xorshift generator, for the same messages in each run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn choose<T: Clone>(&mut self, from: &[T]) -> T {
        from[self.next() as usize % from.len()].clone()
    }

    /// A valid or invalid value of some key.
    fn value(&mut self) -> Value {
        self.choose(&[
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

    /// A message of some type with some keys, which have any values.
    fn message(&mut self) -> Value {
        let kinds = [
            "hello",
            "size",
            "camera",
            "set",
            "ack",
            "ping",
            "pick",
            "profile",
            "volume",
            "histogram",
            "points",
            "movie",
            "addFile",
            "save",
            "cancel",
            "export",
            "loadScene",
            "",
        ];
        let keys = [
            "width",
            "height",
            "scene",
            "seq",
            "camera",
            "moving",
            "frame",
            "n_bytes",
            "fps",
            "id",
            "x",
            "y",
            "name",
            "text",
            "points",
            "up",
            "base",
            "cell_size",
            "column",
            "format",
        ];
        let mut message = json!({ "type": self.choose(&kinds) });
        for key in keys {
            if !self.next().is_multiple_of(4) {
                message[key] = self.value();
            }
        }
        // Many messages are well-formed, so that their values are tested, too.
        for (key, valid) in [("width", 40), ("height", 30), ("seq", 7), ("id", 3), ("frame", 1)] {
            if self.next().is_multiple_of(2) {
                message[key] = json!(valid);
            }
        }
        message
    }

    fn bytes(&mut self) -> Vec<u8> {
        (0..self.next() % 300).map(|_| self.next() as u8).collect()
    }
}

/// Resident memory of this process, which runs all tests; only Linux tells it.
fn resident_mib() -> Option<f64> {
    let read = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let kib = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.strip_suffix("kB"));
        kib.unwrap().trim().parse::<f64>().unwrap() / 1024.0
    };
    cfg!(target_os = "linux").then(read)
}

/// More than three times what all tests at once were measured to take: 150 MiB, with 2 threads as with 16.
const MAX_MIB: f64 = 500.0;

async fn assert_healthy(server: &TestServer) {
    server.assert_serves_pictures().await;
    let mib = resident_mib();
    assert!(mib.is_none_or(|mib| mib < MAX_MIB), "{mib:?}");
}

/// Sends messages until the server closes the connection, reading now and then; returns the number of those sent.
async fn send_all(page: &mut TestPage, messages: impl Iterator<Item = Message>) -> usize {
    let mut n_sent = 0;
    for message in messages {
        if page.send(message).await.is_err() {
            break;
        }
        n_sent += 1;
        if n_sent % 50 == 0 {
            page.drain(Duration::from_millis(20)).await;
        }
    }
    n_sent
}

#[tokio::test]
async fn messages_of_any_content_are_survived() {
    let server = TestServer::start();
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for round in 0..8 {
        let mut page = TestPage::open(&server, json!({})).await;
        page.message("scene").await;
        let messages = (0..400).map(|_| {
            if round % 2 == 0 {
                return Message::text(random.message().to_string());
            }
            let bytes = random.bytes();
            let text = String::from_utf8_lossy(&bytes).into_owned();
            let is_text = random.next().is_multiple_of(2);
            if is_text { Message::text(text) } else { Message::binary(bytes) }
        });
        let n_sent = send_all(&mut page, messages).await;
        assert_eq!(n_sent, 400, "round {round}");
        page.send_json(json!({ "type": "size", "width": 50, "height": 41 })).await;
    }
    assert_healthy(&server).await;
}

#[tokio::test]
async fn first_messages_of_any_content_are_survived() {
    let server = TestServer::start();
    let mut random = Random(7);
    for _ in 0..200 {
        // Pages that have just disconnected may still hold all permits.
        let mut page = TestPage::connect_when_possible(&server).await;
        page.send(Message::text(random.message().to_string())).await.unwrap();
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
        let mut page = TestPage::connect_when_possible(&server).await;
        page.send(first).await.unwrap();
        page.message("error").await;
        assert!(page.next().await.is_none());
    }
    assert_healthy(&server).await;
}

#[tokio::test]
async fn random_bytes_are_survived() {
    let server = TestServer::start();
    let mut random = Random(11);
    let upgrade = "GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\n\
        Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
        Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
    for round in 0..200 {
        let mut stream = begin(&server, if round % 2 == 0 { upgrade } else { "" }).await;
        let _ = stream.write_all(&random.bytes()).await;
    }
    assert_healthy(&server).await;
}

#[tokio::test]
async fn extreme_numbers_and_texts_are_survived() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    let scene = |text: &str| format!(r#"{{"type":"set","seq":1,"scene":{text}}}"#);
    for text in [
        scene(&"[".repeat(100_000)),
        scene(&format!("{}1{}", r#"{"a":"#.repeat(30_000), "}".repeat(30_000))),
        scene(&format!(r#"{{"tint":"{}"}}"#, "x".repeat(200_000))),
        r#"{"type":"set","seq":4294967296,"scene":{}}"#.into(),
        r#"{"type":"size","width":1e308,"height":1}"#.into(),
        r#"{"type":"pick","id":1,"x":NaN,"y":0}"#.into(),
        r#"{"type":"ack","frame":4294967295}"#.into(),
    ] {
        page.send(Message::text(text)).await.unwrap();
    }
    for (seq, coordinate) in [1e308, -1e308, 9.9e11, 1e-300, 0.0].into_iter().enumerate() {
        let mut camera = camera(0.0);
        camera["position"] = json!([coordinate, coordinate, coordinate]);
        page.send_json(json!({ "type": "camera", "seq": seq, "camera": camera })).await;
    }
    page.set_camera(u32::MAX, 0.3, false).await;
    page.wait_for_picture(|picture| picture.is_finished && picture.seq == u32::MAX).await;
    let _ = page.send(Message::text("x".repeat(1 << 19))).await;
    page.wait_until_closed().await;
    assert_healthy(&server).await;
}

#[tokio::test]
async fn floods_of_requests_do_not_block_other_pages() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    let message = |i: u32| match i % 5 {
        0 => json!({ "type": "pick", "id": i, "x": 32, "y": 24 }),
        1 => json!({ "type": "save", "id": 1, "width": 2000, "height": 2000 }),
        2 => json!({ "type": "save", "id": i, "width": 2000, "height": 2000 }),
        3 => json!({ "type": "export", "id": i, "width": 30, "height": 20 }),
        _ => json!({ "type": "set", "seq": i, "scene": { "tint": i, "slow": 0.2 } }),
    };
    let messages = (0..3000).map(|i| Message::text(message(i).to_string()));
    send_all(&mut page, messages).await;
    let mut other = TestPage::open(&server, json!({})).await;
    other.finished_picture().await;
    other.send_json(json!({ "type": "pick", "id": 1, "x": 32, "y": 24 })).await;
    other.message("pick").await;
    drop(page);
    assert_healthy(&server).await;
}

#[tokio::test]
async fn floods_are_answered_and_pictures_go_on() {
    let limits = Limits { max_message_rate: 1e-3, max_message_burst: 20.0, ..Limits::default() };
    let server = TestServer::start_with_limits(limits);
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    for seq in 1..=40 {
        page.change_settings(seq, json!({ "tint": seq })).await;
    }
    for id in 1..=3 {
        page.send_json(json!({ "type": "histogram", "id": id, "column": "z" })).await;
    }
    for id in 1..=3 {
        let answer = page.message_of(id).await;
        assert!(answer["text"].as_str().unwrap().contains("too many messages"), "{answer}");
    }
    // Acknowledgements count for nothing: all pictures of the last change arrive.
    page.finished_picture().await;
}

#[tokio::test]
async fn messages_with_wrong_fields_are_answered() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    let movie = json!({ "type": "movie", "id": 7, "format": "gif", "width": 1280.5, "height": 2, "fps": 5 });
    page.send_json(movie).await;
    assert_eq!(page.message("error").await["id"], 7);
    page.send_json(json!({ "type": "set", "seq": 8, "scene": [] })).await;
    assert_eq!(page.message("error").await["seq"], 8);
    page.send_json(json!({ "type": "dance", "id": -1 })).await;
    assert_eq!(page.message("error").await["id"], Value::Null);
}

#[tokio::test]
async fn pending_changes_beyond_the_limit_are_rejected() {
    let server =
        TestServer::start_with_limits(Limits { max_pending_bytes: 5000, ..Limits::default() });
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    page.change_settings(1, json!({ "gated": true })).await;
    for i in 0..10 {
        page.change_settings(2, json!({ i.to_string(): "x".repeat(2000) })).await;
    }
    while !page.message("error").await["text"].as_str().unwrap().contains("pending") {}
    server.provider.gate.open();
    assert_healthy(&server).await;
}

/// The pages acknowledge all pictures, and read none.
#[tokio::test]
async fn slow_readers_are_closed() {
    let timeouts = Timeouts { write: Duration::from_millis(500), ..Timeouts::default() };
    let server = TestServer::start_with_limits(Limits { timeouts, ..Limits::default() });
    let before = resident_mib();
    let mut pages = Vec::new();
    for _ in 0..4 {
        let mut page = TestPage::connect_with_small_buffer(&server).await;
        // Exports of these settings soon fill the send buffer.
        page.send_hello(json!({ "tint": "x".repeat(100_000) })).await;
        page.send_json(json!({ "type": "size", "width": 1400, "height": 1000 })).await;
        pages.push(page);
    }
    let start = Instant::now();
    let mut seq = 0;
    while !pages.is_empty() {
        let mut open = Vec::new();
        for mut page in pages {
            seq += 1;
            let camera = camera(f64::from(seq));
            let messages = [
                json!({ "type": "camera", "seq": seq, "camera": camera, "moving": true }),
                json!({ "type": "ack", "frame": u32::MAX }),
                json!({ "type": "export", "id": seq, "width": 1000, "height": 1000 }),
            ];
            let mut is_open = true;
            for message in messages {
                is_open &= page.send(Message::text(message.to_string())).await.is_ok();
            }
            if is_open {
                open.push(page);
            }
        }
        pages = open;
        assert!(start.elapsed() < TIMEOUT, "{} pages are still open", pages.len());
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    server.assert_serves_pictures().await;
    let grown = resident_mib().zip(before).map(|(after, before)| after - before);
    assert!(grown.is_none_or(|mib| mib < MAX_MIB), "{grown:?}");
}

#[tokio::test]
async fn connections_beyond_the_limit_do_not_block_pages() {
    let server = TestServer::start_with_limits(Limits { max_connections: 20, ..Limits::default() });
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    let mut silent = Vec::new();
    for _ in 0..30 {
        silent.push(begin(&server, "").await);
    }
    page.set_camera(1, 1.0, false).await;
    page.wait_for_picture(|picture| picture.is_finished && picture.seq == 1).await;
    drop(silent);
    assert_healthy(&server).await;
}

#[tokio::test]
async fn idle_connections_time_out() {
    let timeouts = Timeouts { request: Duration::from_secs(3), ..Timeouts::default() };
    let server = TestServer::start_with_limits(Limits { timeouts, ..Limits::default() });
    let mut upgraded = TestPage::connect(&server).await.unwrap();
    let requests = [
        begin(&server, "").await,
        begin(&server, "GET / HTTP/1.1\r\nHost: loc").await,
        begin(&server, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").await,
        begin(&server, "POST /render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n{")
            .await,
    ];
    let mut statuses = Vec::new();
    for mut stream in requests {
        let response = timeout(TIMEOUT, read_response(&mut stream)).await;
        statuses.push(response.expect("the connection is still open").status);
    }
    assert!(statuses[..2].iter().all(|status| [0, 408].contains(status)), "{statuses:?}");
    assert_eq!(statuses[2..], [200, 408]);
    upgraded.wait_until_closed().await;
    assert_healthy(&server).await;
}

/// A client answers pings only while it reads.
#[tokio::test]
async fn pages_that_do_not_answer_pings_are_closed() {
    let timeouts = Timeouts {
        ping_interval: Duration::from_millis(100),
        idle: Duration::from_secs(2),
        ..Timeouts::default()
    };
    let server = TestServer::start_with_limits(Limits { timeouts, ..Limits::default() });
    let mut reading = TestPage::open(&server, json!({})).await;
    let mut silent = TestPage::open(&server, json!({})).await;
    reading.drain(timeouts.idle + Duration::from_secs(1)).await;
    reading.sync().await;
    // A page that reads again answers its pings: it is left alone until the server has closed it.
    let start = Instant::now();
    while get(&server, "/stats").await.json()["clients"] != 1 {
        assert!(start.elapsed() < TIMEOUT, "the silent page is still connected");
        reading.drain(Duration::from_millis(100)).await;
    }
    silent.wait_until_closed().await;
}

#[tokio::test]
async fn unacked_clients_do_not_block_others() {
    let server = TestServer::start();
    let mut silent = Vec::new();
    for _ in 0..10 {
        silent.push(TestPage::open(&server, json!({})).await);
    }
    let mut page = TestPage::open(&server, json!({})).await;
    for seq in 1..=20 {
        page.set_camera(seq, f64::from(seq), true).await;
        page.wait_for_picture(|picture| picture.seq == seq).await;
    }
    assert_healthy(&server).await;
}
