//! Whatever pages and programs send to `surfel view`: what a page says, line by line, where the first byte is
//! odd, else the bytes of a connection. Afterwards the server still answers others.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Shutdown, TcpStream};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use surfel::render::CpuRenderer;
use surfel::trace::Simd;
use surfel_web::Server;
use tungstenite::{Error, Message, WebSocket, client};

/// Longer than anything that is asked for of seven points may take.
const PATIENCE: Duration = Duration::from_secs(60);
const HELLO: &str = r#"{"type":"hello","width":40,"height":30}"#;
/// An answer to it comes after all that was said before has been obeyed.
const LAST: &str = r#"{"type":"take","id":4294967295,"width":9,"height":9}"#;
const ANSWER: &str = r#""id":4294967295"#;

fuzz_target!(|bytes: &[u8]| {
    let Some((first, rest)) = bytes.split_first() else { return };
    let port = port();
    if first % 2 == 1 {
        talk(port, rest)
    } else {
        send(port, rest)
    }
    assert!(is_ready(port));
});

fn is_ready(port: u16) -> bool {
    let mut stream = connect(port);
    stream.write_all(b"GET /healthz HTTP/1.0\r\nHost: localhost\r\n\r\n").unwrap();
    answer(stream).ends_with(br#"{"status":"ready"}"#)
}

/// The port of a server that views a small cloud for as long as the process runs.
fn port() -> u16 {
    static PORT: OnceLock<u16> = OnceLock::new();
    *PORT.get_or_init(|| {
        let cloud = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/ply/full.ply");
        let quick = ["--spp", "1", "--samples", "1", "--resolution", "64x48"];
        let words = ["surfel", "view", cloud].into_iter().chain(quick);
        let studio = surfel_cli::studio(words.map(Into::into).collect());
        let studio = studio.expect("first, cargo run --bin seeds");
        let server = Server::bind(IpAddr::V4(Ipv4Addr::LOCALHOST), 0).unwrap();
        let link = server.link();
        let renderer = Arc::new(CpuRenderer { simd: Simd::detect() });
        let is_stopped = Arc::new(AtomicBool::new(false));
        std::thread::spawn(move || server.run(renderer, is_stopped, |_| Ok(studio)));
        let port = link.trim_end_matches('/').rsplit(':').next().unwrap().parse().unwrap();
        while !is_ready(port) {
            std::thread::sleep(Duration::from_millis(1));
        }
        port
    })
}

fn connect(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.set_nodelay(true).unwrap();
    stream
}

/// All that is answered until the server closes.
fn answer(mut stream: TcpStream) -> Vec<u8> {
    let mut answer = Vec::new();
    match stream.read_to_end(&mut answer) {
        Err(error) if error.kind() == ErrorKind::WouldBlock => panic!("no end after {PATIENCE:?}"),
        _ => answer,
    }
}

fn send(port: u16, bytes: &[u8]) {
    let mut stream = connect(port);
    // The server may have closed before the end.
    let _ = stream.write_all(bytes).and_then(|()| stream.shutdown(Shutdown::Write));
    let answer = answer(stream);
    assert!(answer.is_empty() || answer.starts_with(b"HTTP/1."), "{answer:?}");
}

fn talk(port: u16, lines: &[u8]) {
    let mut page = open(port);
    // Of more at once some would be left out, the last one perhaps.
    for line in lines.split(|byte| *byte == b'\n').take(700) {
        let message = match String::from_utf8(line.to_vec()) {
            Ok(text) => Message::text(text),
            Err(error) => Message::binary(error.into_bytes()),
        };
        if page.send(message).is_err() {
            return;
        }
    }
    if page.send(Message::text(LAST)).is_err() {
        return;
    }
    let start = Instant::now();
    loop {
        match page.read() {
            Ok(Message::Text(text)) if text.contains(ANSWER) => return drop(page.close(None)),
            Ok(_) => assert!(start.elapsed() < PATIENCE, "no answer"),
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => panic!("no answer"),
            Err(_) => return,
        }
    }
}

/// A page once there is a place for it: those before it may still be leaving.
fn open(port: u16) -> WebSocket<TcpStream> {
    let start = Instant::now();
    loop {
        let address = format!("ws://localhost:{}/ws", port);
        match client(address, connect(port)) {
            Ok((mut page, _)) => {
                page.send(Message::text(HELLO)).unwrap();
                return page;
            }
            Err(error) => assert!(start.elapsed() < PATIENCE, "{error}"),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
