//! Requests as they go over the wire: a proper client would not send the wrong ones.

use crate::viewer::Viewer;
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

pub struct Response {
    pub status: u16,
    pub headers: String,
    pub body: Vec<u8>,
}

impl Response {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_default()
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        let headers = self.headers.lines().filter_map(|line| line.split_once(": "));
        headers.filter(|(found, _)| found.eq_ignore_ascii_case(name)).map(|(_, value)| value).next()
    }
}

pub async fn get(viewer: &Viewer, path: &str) -> Response {
    ask(viewer, &format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n"), b"").await
}

pub async fn post(viewer: &Viewer, path: &str, body: &[u8]) -> Response {
    let length = body.len();
    let head = format!("POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n");
    ask(viewer, &head, body).await
}

/// The answer to a request with this head, all but its last empty line.
pub async fn ask(viewer: &Viewer, head: &str, body: &[u8]) -> Response {
    let mut stream = begin(viewer, head).await;
    stream.write_all(b"Connection: close\r\n\r\n").await.unwrap();
    // Refused bodies are not read to their end.
    let _ = stream.write_all(body).await;
    rest(&mut stream).await
}

/// A connection on which so much has been said.
pub async fn begin(viewer: &Viewer, text: &str) -> TcpStream {
    let mut stream = TcpStream::connect(viewer.place()).await.unwrap();
    stream.write_all(text.as_bytes()).await.unwrap();
    stream
}

/// What the server says before it closes the connection.
pub async fn rest(stream: &mut TcpStream) -> Response {
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes).await;
    let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap_or(bytes.len());
    let headers = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let status = headers.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    Response { status, headers, body: bytes.split_off(bytes.len().min(end + 4)) }
}
