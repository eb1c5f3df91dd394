//! Fuzzes the server of `surfel view`: messages of a page, one per line, if the first byte is odd, and the raw
//! bytes of a connection otherwise. Afterwards the server must still respond to others.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Shutdown, TcpStream};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use surfel_core::render::CpuRenderer;
use surfel_core::trace::Simd;
use surfel_web::Server;
use tungstenite::{Error, Message, WebSocket, client};

/// Time limit for any response; the scene has only seven points.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(60);
const HELLO: &str = r#"{"type":"hello","width":40,"height":30}"#;
/// The last request. Its response follows those of all earlier messages.
const LAST_REQUEST: &str = r#"{"type":"export","id":4294967295,"width":9,"height":9}"#;
/// Text that identifies the response to the last request.
const LAST_RESPONSE: &str = r#""id":4294967295"#;

fuzz_target!(|bytes: &[u8]| {
    let Some((first, rest)) = bytes.split_first() else { return };
    let port = port();
    if first % 2 == 1 {
        send_messages(port, rest)
    } else {
        send_bytes(port, rest)
    }
    assert!(is_ready(port));
});

fn is_ready(port: u16) -> bool {
    let mut stream = connect(port);
    stream.write_all(b"GET /healthz HTTP/1.0\r\nHost: localhost\r\n\r\n").unwrap();
    read_response(stream).ends_with(br#"{"status":"ready"}"#)
}

/// Returns the port of a server that shows a small cloud until the process ends.
fn port() -> u16 {
    static PORT: OnceLock<u16> = OnceLock::new();
    *PORT.get_or_init(|| {
        let cloud = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/ply/full.ply");
        let options = ["--spp", "1", "--light-samples", "1", "--resolution", "64x48"];
        let arguments = ["surfel", "view", cloud].into_iter().chain(options);
        let provider = surfel_cli::scene_provider(arguments.map(Into::into).collect());
        let provider = provider.expect("run `cargo run --bin seeds` first");
        let server = Server::bind(IpAddr::V4(Ipv4Addr::LOCALHOST), 0).unwrap();
        let link = server.links().swap_remove(0);
        let renderer = Arc::new(CpuRenderer { simd: Simd::detect() });
        let is_stopped = Arc::new(AtomicBool::new(false));
        std::thread::spawn(move || server.run(renderer, is_stopped, |_| Ok(provider)));
        let port = link.trim_end_matches('/').rsplit(':').next().unwrap().parse().unwrap();
        while !is_ready(port) {
            std::thread::sleep(Duration::from_millis(1));
        }
        port
    })
}

fn connect(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(RESPONSE_TIMEOUT)).unwrap();
    stream.set_nodelay(true).unwrap();
    stream
}

/// Reads until the server closes the connection.
fn read_response(mut stream: TcpStream) -> Vec<u8> {
    let mut response = Vec::new();
    match stream.read_to_end(&mut response) {
        Err(error) if error.kind() == ErrorKind::WouldBlock => {
            panic!("no end after {RESPONSE_TIMEOUT:?}")
        }
        _ => response,
    }
}

fn send_bytes(port: u16, bytes: &[u8]) {
    let mut stream = connect(port);
    // The server may close the connection early.
    let _ = stream.write_all(bytes).and_then(|()| stream.shutdown(Shutdown::Write));
    let response = read_response(stream);
    assert!(response.is_empty() || response.starts_with(b"HTTP/1."), "{response:?}");
}

fn send_messages(port: u16, lines: &[u8]) {
    let mut page = open_page(port);
    // The server drops messages beyond its rate limit, possibly the last request.
    for line in lines.split(|byte| *byte == b'\n').take(700) {
        let message = match String::from_utf8(line.to_vec()) {
            Ok(text) => Message::text(text),
            Err(error) => Message::binary(error.into_bytes()),
        };
        if page.send(message).is_err() {
            return;
        }
    }
    if page.send(Message::text(LAST_REQUEST)).is_err() {
        return;
    }
    let start = Instant::now();
    loop {
        match page.read() {
            Ok(Message::Text(text)) if text.contains(LAST_RESPONSE) => {
                return drop(page.close(None));
            }
            Ok(_) => assert!(start.elapsed() < RESPONSE_TIMEOUT, "no response"),
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => panic!("no response"),
            Err(_) => return,
        }
    }
}

/// Opens a page, and retries while earlier connections are still closing.
fn open_page(port: u16) -> WebSocket<TcpStream> {
    let start = Instant::now();
    loop {
        let address = format!("ws://localhost:{}/ws", port);
        match client(address, connect(port)) {
            Ok((mut page, _)) => {
                page.send(Message::text(HELLO)).unwrap();
                return page;
            }
            Err(error) => assert!(start.elapsed() < RESPONSE_TIMEOUT, "{error}"),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
