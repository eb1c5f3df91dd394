//! The page's files: their number and size at first load, their headers, caching and compression.

use crate::http_client::{Response, request};
use crate::test_server::TestServer;

/// Maximum number of requests at first load, the WebSocket's among them.
const MAX_REQUESTS: usize = 10;
/// Maximum number of bytes of all responses at first load, headers included.
const MAX_BYTES: usize = 60_000;

async fn get(server: &TestServer, path: &str, headers: &str) -> Response {
    let head = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n{headers}");
    request(server, &head, b"").await
}

/// The files that the page names.
fn linked_files(page: &Response) -> Vec<String> {
    let text = String::from_utf8(page.body.clone()).unwrap();
    let names = [" href=\"", " src=\""].into_iter().flat_map(|attribute| {
        let values = text.split(attribute).skip(1);
        values.map(|rest| rest.split('"').next().unwrap().to_owned()).collect::<Vec<_>>()
    });
    names.filter(|name| !name.starts_with('#')).collect()
}

#[tokio::test]
async fn the_first_load_is_light() {
    let server = TestServer::start();
    let mut files = linked_files(&get(&server, "/", "").await);
    assert_eq!(files.len(), 3, "{files:?}");
    files.push(String::new());
    let mut n_bytes = 0;
    for name in &files {
        let file = get(&server, &format!("/{name}"), "Accept-Encoding: gzip, deflate\r\n").await;
        assert_eq!((file.status, file.header("content-encoding")), (200, Some("gzip")), "{name}");
        n_bytes += file.headers.len() + file.body.len();
    }
    let n_requests = files.len() + 1;
    assert!(n_requests <= MAX_REQUESTS, "{n_requests} requests");
    assert!(n_bytes <= MAX_BYTES, "{n_bytes} bytes");
}

#[tokio::test]
async fn page_files_have_security_headers() {
    let server = TestServer::start();
    let files = linked_files(&get(&server, "/", "").await);
    for path in ["/".to_owned()].into_iter().chain(files.iter().map(|name| format!("/{name}"))) {
        let file = get(&server, &path, "").await;
        let content_type = match path.rsplit_once('.').map(|(_, extension)| extension) {
            Some("css") => "text/css; charset=utf-8",
            Some("js") => "text/javascript; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => "text/html; charset=utf-8",
        };
        assert_eq!((file.status, file.header("content-type")), (200, Some(content_type)));
        let policy = file.header("content-security-policy").unwrap();
        assert!(policy.contains("default-src 'none'") && policy.contains("connect-src 'self'"));
        assert!(!policy.contains("unsafe"), "{policy}");
        assert!(policy.ends_with("; frame-ancestors 'none'"), "{policy}");
        assert!(!file.body.is_empty());
    }
}

#[tokio::test]
async fn frames_are_for_pages_of_allowed_origins() {
    let server = TestServer::start();
    let frame =
        "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: iframe\r\n";
    assert_eq!(get(&server, "/", frame).await.status, 403);
    server.frame_ancestors.allow("http://localhost:8888").unwrap();
    let page = get(&server, "/", frame).await;
    let policy = page.header("content-security-policy").unwrap();
    assert_eq!(page.status, 200);
    assert!(policy.ends_with("; frame-ancestors http://localhost:8888"), "{policy}");
    for path in ["/ws", "/render", "/downloads/x", "/scene", "/stats", "/healthz"] {
        assert_eq!(get(&server, path, frame).await.status, 403, "{path}");
    }
}

#[tokio::test]
async fn page_files_are_cached_by_their_content() {
    let server = TestServer::start();
    let page = get(&server, "/", "").await;
    assert_eq!(page.header("cache-control"), Some("no-cache"));
    let tag = page.header("etag").unwrap();
    let again = get(&server, "/", &format!("If-None-Match: {tag}\r\n")).await;
    assert_eq!((again.status, again.body.len()), (304, 0));
    assert_eq!(get(&server, "/", "If-None-Match: \"0\"\r\n").await.status, 200);
    for name in linked_files(&page) {
        let file = get(&server, &format!("/{name}"), "").await;
        assert!(file.header("cache-control").unwrap().contains("immutable"));
        let hash = file.header("etag").unwrap().trim_matches('"');
        assert!(name.contains(hash), "{name} {hash}");
    }
}

#[tokio::test]
async fn content_is_compressed_for_those_who_accept_it() {
    let server = TestServer::start();
    let plain = get(&server, "/", "").await;
    assert_eq!(plain.header("vary"), Some("accept-encoding"));
    for (accepted, is_compressed) in [
        ("gzip", true),
        ("br, GZIP;q=0.5", true),
        ("gzip;q=0", false),
        ("br", false),
        ("gzip;q=x", false),
        ("x-gzip-not", false),
    ] {
        let found = get(&server, "/", &format!("Accept-Encoding: {accepted}\r\n")).await;
        let encoding = found.header("content-encoding");
        assert_eq!(encoding.is_some(), is_compressed, "{accepted}");
        assert_eq!(found.body == plain.body, !is_compressed, "{accepted}");
    }
}
