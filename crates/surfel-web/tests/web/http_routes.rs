//! HTTP: paths, and pictures for programs.

use crate::http_client::{begin, get, post, read_response};
use crate::test_page::TestPage;
use crate::test_server::{TestServer, wait_until};
use serde_json::json;
use std::sync::atomic::Ordering;
use std::time::Duration;
use surfel_web::Limits;
use tokio::io::AsyncWriteExt;
use tokio_tungstenite::tungstenite::Error;

#[tokio::test]
async fn paths_do_not_reach_the_file_system() {
    let server = TestServer::start();
    for path in [
        "/nothing",
        "/a/b",
        "/..%2f..%2fCargo.toml",
        "/../../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/..%5c..%5cCargo.toml",
        "//etc/passwd",
        "/%2fetc%2fpasswd",
        "/index.html%00.js",
        "/%00",
        "/.",
        "/index.html/",
    ] {
        assert_eq!(get(&server, path).await.status, 404, "{path}");
    }
    assert_eq!(get(&server, "/%ff").await.status, 400);
}

#[tokio::test]
async fn every_error_is_json() {
    let server = TestServer::start();
    for (path, status) in [("/nothing", 404), ("/a/b", 404), ("/%ff", 400), ("/downloads/%ff", 400)]
    {
        let response = get(&server, path).await;
        assert_eq!(response.status, status, "{path}");
        assert!(response.json()["error"].is_string(), "{path}");
    }
    let response = post(&server, "/scene", b"{}").await;
    assert_eq!((response.status, response.header("allow")), (405, Some("GET,HEAD")));
    assert_eq!(response.json()["error"], "POST is not answered at this address");
}

#[tokio::test]
async fn programs_get_pictures_settings_and_statistics() {
    let server = TestServer::start();
    server.assert_serves_pictures().await;
    let expected = server.provider.finished_picture((30, 20));
    for response in [
        get(&server, "/render?resolution=30x20").await,
        post(&server, "/render", br#"{"resolution": "30x20"}"#).await,
    ] {
        assert_eq!((response.status, response.header("content-type")), (200, Some("image/png")));
        assert_eq!(image::load_from_memory(&response.body).unwrap().into_rgba8(), expected);
    }
    let scene = get(&server, "/scene").await.json();
    assert_eq!(scene["tint"], 0);
    let stats = get(&server, "/stats").await.json();
    assert_eq!((&stats["pictures"], &stats["info"]["name"]), (&json!(2), &json!("hill")));
    assert_eq!(get(&server, "/healthz").await.json(), json!({ "status": "ready" }));
}

#[tokio::test]
async fn a_page_that_cannot_connect_learns_why() {
    let server = TestServer::start_with_limits(Limits { max_pages: 1, ..Limits::default() });
    assert_eq!(get(&server, "/ws").await.status, 204);
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("welcome").await;
    let refused = get(&server, "/ws").await;
    assert_eq!(refused.status, 503);
    assert!(refused.json()["error"].as_str().unwrap().contains("too many pages"));
}

#[tokio::test]
async fn invalid_queries_are_errors() {
    let server = TestServer::start();
    server.assert_serves_pictures().await;
    let large = vec![b' '; Limits::default().max_message_bytes + 1];
    let deep = "[".repeat(200_000);
    for (response, status) in [
        (get(&server, "/render?invalid=1").await, 400),
        (get(&server, "/render?panic=1").await, 500),
        (post(&server, "/render", b"{").await, 400),
        (post(&server, "/render", b"7").await, 400),
        (post(&server, "/render", deep.as_bytes()).await, 400),
        (post(&server, "/render", &large).await, 413),
    ] {
        assert_eq!((response.status, response.json()["error"].is_string()), (status, true));
    }
    assert_eq!(get(&server, "/render?invalid=1").await.json()["error"], "invalid: unknown key");
    server.assert_serves_pictures().await;
}

#[tokio::test]
async fn renders_are_limited_and_end_with_their_requests() {
    let server = TestServer::start_with_limits(Limits { max_renders: 2, ..Limits::default() });
    server.assert_serves_pictures().await;
    let slow = r#"{"slow": 1000}"#;
    let length = slow.len();
    let head = format!(
        "POST /render HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n\r\n{slow}"
    );
    let requests = [begin(&server, &head).await, begin(&server, &head).await];
    wait_until(|| server.provider.n_started.load(Ordering::Relaxed) == 2).await;
    assert_eq!(get(&server, "/render").await.status, 429);
    drop(requests);
    wait_until(|| server.provider.n_cancelled.load(Ordering::Relaxed) == 2).await;
    // The permits come back a moment after the tasks have noticed their cancellation.
    while get(&server, "/render").await.status == 429 {}
    assert_eq!(get(&server, "/render").await.status, 200);
}

#[tokio::test]
async fn programs_are_rejected_while_files_are_loaded() {
    let server = TestServer::start_loading(|progress| {
        while !progress.is_cancelled() {
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    });
    assert_eq!(get(&server, "/healthz").await.json(), json!({ "status": "loading" }));
    for path in ["/scene", "/render"] {
        assert_eq!(get(&server, path).await.status, 503);
    }
}

#[tokio::test]
async fn pages_beyond_the_limit_are_rejected_until_another_disconnects() {
    let server = TestServer::start_with_limits(Limits { max_pages: 3, ..Limits::default() });
    let mut pages = Vec::new();
    for _ in 0..3 {
        pages.push(TestPage::connect(&server).await.unwrap());
    }
    let rejected = TestPage::connect(&server).await;
    assert!(matches!(rejected, Err(Error::Http(response)) if response.status() == 503));
    pages.pop();
    TestPage::connect_when_possible(&server).await;
}

#[tokio::test]
async fn malformed_requests_are_rejected() {
    let server = TestServer::start();
    for text in ["\r\n\r\n\r\n", "GET\r\n\r\n", "\u{0}\u{1}\u{2}\r\n\r\n", "PRI * HTTP/2.0\r\n\r\n"]
    {
        let mut stream = begin(&server, text).await;
        stream.shutdown().await.unwrap();
        assert!([0, 400, 505].contains(&read_response(&mut stream).await.status), "{text:?}");
    }
    server.assert_serves_pictures().await;
}
