//! Raw HTTP requests: a proper client would not send invalid ones.

use crate::test_server::TestServer;
use serde_json::Value;
use std::net::Ipv4Addr;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

pub struct Response {
    /// The status code; 0 if the server closed the connection without a response.
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

pub async fn get(server: &TestServer, path: &str) -> Response {
    request(server, &format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n"), b"").await
}

pub async fn post(server: &TestServer, path: &str, body: &[u8]) -> Response {
    let length = body.len();
    let head = format!("POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n");
    request(server, &head, body).await
}

/// The response to a request with this head, given without its final empty line.
pub async fn request(server: &TestServer, head: &str, body: &[u8]) -> Response {
    let mut stream = begin(server, head).await;
    stream.write_all(b"Connection: close\r\n\r\n").await.unwrap();
    // The server does not read a rejected body to its end.
    let _ = stream.write_all(body).await;
    read_response(&mut stream).await
}

/// A connection from this address, which is one of loopback, on which nothing has been sent.
pub async fn connect_from(source: Ipv4Addr, server: &TestServer) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((source, 0).into()).unwrap();
    socket.connect(server.socket_address()).await.unwrap()
}

/// A connection on which this text has been sent.
pub async fn begin(server: &TestServer, text: &str) -> TcpStream {
    let mut stream = TcpStream::connect(server.address()).await.unwrap();
    stream.write_all(text.as_bytes()).await.unwrap();
    stream
}

/// Reads until the server closes the connection.
pub async fn read_response(stream: &mut (impl AsyncRead + Unpin)) -> Response {
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes).await;
    let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap_or(bytes.len());
    let headers = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let status = headers.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    Response { status, headers, body: bytes.split_off(bytes.len().min(end + 4)) }
}
