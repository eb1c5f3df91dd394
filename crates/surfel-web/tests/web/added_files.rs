//! Files that pages add: the way of their bytes, and attacks on it.

use crate::http_client::{begin, post, read_response, request};
use crate::test_page::TestPage;
use crate::test_server::{TestServer, wait_until};
use serde_json::{Value, json};
use std::sync::atomic::Ordering;
use std::time::Duration;
use surfel_web::{Limits, Timeouts};
use tokio::io::AsyncWriteExt;

/// A server of small limits.
fn start() -> TestServer {
    start_with_timeouts(Timeouts::default())
}

/// A server of small limits that waits for these durations.
fn start_with_timeouts(timeouts: Timeouts) -> TestServer {
    TestServer::start_with_limits(Limits {
        max_added_file_bytes: 20_000_000,
        max_added_bytes: 30_000_000,
        max_page_files: 3,
        timeouts,
        ..Limits::default()
    })
}

async fn announce(page: &mut TestPage, id: u32, name: &str, n_bytes: u64) {
    page.send_json(json!({ "type": "addFile", "id": id, "name": name, "n_bytes": n_bytes })).await;
}

/// The path to which a page may send a file that it has announced.
async fn announced(page: &mut TestPage, id: u32, name: &str, n_bytes: usize) -> String {
    announce(page, id, name, n_bytes as u64).await;
    format!("/{}", page.message("upload").await["address"].as_str().unwrap())
}

/// Announces and sends a file; returns what the server says about it.
async fn add(server: &TestServer, page: &mut TestPage, name: &str, bytes: &[u8]) -> Value {
    let path = announced(page, 1, name, bytes.len()).await;
    assert_eq!(post(server, &path, bytes).await.status, 204);
    page.message("added").await["file"].clone()
}

async fn assert_refused(page: &mut TestPage, reason: &str) {
    let error = page.message("error").await;
    assert!(error["text"].as_str().unwrap().contains(reason), "{error}");
}

#[tokio::test]
async fn a_file_is_added_under_a_name_of_its_own() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    // Larger than any other message or body may be.
    let bytes = vec![b'x'; 3_000_000];
    let first = add(&server, &mut page, "a.xyz", &bytes).await;
    assert_eq!((&first["name"], &first["points"]), (&json!("a.xyz"), &json!(3_000_000)));
    let second = add(&server, &mut page, "a.xyz", b"1 2 3").await;
    assert_eq!(second["name"], "a.xyz'");
    assert_ne!(first["id"], second["id"]);
    page.change_settings(1, json!({ "added_files": [first["id"]] })).await;
    page.wait_for_picture(|picture| picture.seq == 1).await;
    server.assert_serves_pictures().await;
}

#[tokio::test]
async fn files_beyond_the_limits_are_refused_before_they_are_sent() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    for (name, n_bytes, reason) in [
        ("a", 20_000_001, "expected at most"),
        ("a", u64::MAX, "expected at most"),
        ("a", 0, "is empty"),
        ("", 1, "needs a name"),
        (&"a".repeat(300), 1, "needs a name"),
    ] {
        announce(&mut page, 1, name, n_bytes).await;
        assert_refused(&mut page, reason).await;
    }
}

#[tokio::test]
async fn announced_files_of_all_pages_count() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    add(&server, &mut page, "a", &vec![b'x'; 20_000_000]).await;
    let mut other = TestPage::open(&server, json!({})).await;
    announce(&mut other, 3, "b", 10_000_001).await;
    assert_refused(&mut other, "leave").await;
    drop(page);
    // A page that goes leaves its memory to others.
    loop {
        announce(&mut other, 4, "b", 10_000_001).await;
        if other.message_of(4).await["type"] == "upload" {
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test]
async fn content_counts_while_it_is_read() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    let path = announced(&mut page, 1, "a", 4).await;
    assert_eq!(post(&server, &path, b"slow").await.status, 204);
    wait_until(|| server.provider.n_started.load(Ordering::Relaxed) == 1).await;
    let mut other = TestPage::open(&server, json!({})).await;
    announce(&mut other, 2, "b", 10_000_000).await;
    assert_refused(&mut other, "leave").await;
    page.send_json(json!({ "type": "cancel", "id": 1 })).await;
    assert_refused(&mut page, "cancelled").await;
    announce(&mut other, 3, "b", 10_000_000).await;
    assert_eq!(other.message_of(3).await["type"], "upload");
}

#[tokio::test]
async fn files_that_are_sent_at_once_have_names_of_their_own() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    let paths = [announced(&mut page, 1, "a", 5).await, announced(&mut page, 2, "a", 5).await];
    for path in paths {
        assert_eq!(post(&server, &path, b"1 2 3").await.status, 204);
    }
    let names = [page.message("added").await, page.message("added").await];
    let names = names.map(|message| message["file"]["name"].clone());
    assert_ne!(names[0], names[1]);
}

#[tokio::test]
async fn a_page_adds_few_files() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    for _ in 0..3 {
        add(&server, &mut page, "a", b"1 2 3").await;
    }
    announce(&mut page, 5, "a", 5).await;
    assert_refused(&mut page, "3 files").await;
}

#[tokio::test]
async fn many_announcements_at_once_are_refused() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    for id in 0..50 {
        announce(&mut page, id, "a", 5).await;
    }
    for _ in 2..50 {
        assert_refused(&mut page, "wait for one").await;
    }
    server.assert_serves_pictures().await;
}

#[tokio::test]
async fn broken_and_dense_files_are_refused_and_take_no_memory() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    let dense = [b"dense".to_vec(), vec![b' '; 20_000]].concat();
    for (bytes, reason) in [(&b"broken"[..], "is broken"), (&dense, "expected at most")] {
        for _ in 0..4 {
            let path = announced(&mut page, 1, "a", bytes.len()).await;
            assert_eq!(post(&server, &path, bytes).await.status, 204);
            assert_refused(&mut page, reason).await;
        }
    }
    announced(&mut page, 2, "a", 20_000_000).await;
}

#[tokio::test]
async fn only_announced_bytes_are_taken() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    assert_eq!(post(&server, "/files/x", b"12345").await.status, 404);
    for (body, status) in [(&b"123"[..], 400), (b"1234567", 413)] {
        let path = announced(&mut page, 1, "a", 5).await;
        assert_eq!(post(&server, &path, body).await.status, status);
        assert_refused(&mut page, "did not arrive").await;
        assert_eq!(post(&server, &path, b"12345").await.status, 404);
    }
    let path = announced(&mut page, 1, "a", 5).await;
    for method in ["GET", "PUT", "DELETE"] {
        let head = format!("{method} {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n");
        assert_eq!(request(&server, &head, b"12345").await.status, 405);
    }
    assert_eq!(post(&server, &path, b"12345").await.status, 204);
    page.message("added").await;
}

#[tokio::test]
async fn foreign_pages_and_clients_without_the_token_send_nothing() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    let path = announced(&mut page, 1, "a", 5).await;
    let denied = [
        "Host: evil.example",
        "Host: localhost\r\nOrigin: https://evil.example",
        "Host: localhost\r\nSec-Fetch-Site: cross-site",
        "Host: localhost\r\nReferer: https://evil.example/",
    ];
    for headers in denied {
        let head = format!("POST {path} HTTP/1.1\r\n{headers}\r\nContent-Length: 5\r\n");
        assert_eq!(request(&server, &head, b"12345").await.status, 403, "{headers}");
    }
    assert_eq!(post(&server, &path, b"12345").await.status, 204);
    let beyond = TestServer::start_at("0.0.0.0", Limits::default());
    assert_eq!(post(&beyond, "/files/x", b"12345").await.status, 401);
}

#[tokio::test]
async fn slow_and_silent_clients_are_given_up() {
    let request = Duration::from_secs(3);
    let server = start_with_timeouts(Timeouts { request, ..Timeouts::default() });
    let mut page = TestPage::open(&server, json!({})).await;
    // One never sends.
    announced(&mut page, 1, "a", 5).await;
    assert_refused(&mut page, "did not arrive").await;
    // One stops in the middle.
    let path = announced(&mut page, 2, "a", 50).await;
    let part = |path: &str| {
        format!("POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 50\r\n\r\n123")
    };
    let mut stream = begin(&server, &part(&path)).await;
    assert_eq!(read_response(&mut stream).await.status, 408);
    assert_refused(&mut page, "did not arrive").await;
    // One goes away.
    let path = announced(&mut page, 3, "a", 50).await;
    begin(&server, &part(&path)).await.shutdown().await.unwrap();
    assert_refused(&mut page, "did not arrive").await;
    server.assert_serves_pictures().await;
}

#[tokio::test]
async fn adding_is_cancelled_while_a_file_is_sent_and_while_it_is_read() {
    let server = start();
    let mut page = TestPage::open(&server, json!({})).await;
    announced(&mut page, 1, "a", 5).await;
    page.send_json(json!({ "type": "cancel", "id": 1 })).await;
    assert_refused(&mut page, "cancelled").await;
    let path = announced(&mut page, 2, "a", 4).await;
    assert_eq!(post(&server, &path, b"slow").await.status, 204);
    wait_until(|| server.provider.n_started.load(Ordering::Relaxed) == 1).await;
    page.send_json(json!({ "type": "cancel", "id": 2 })).await;
    assert_refused(&mut page, "cancelled").await;
    // The work of a page that goes is cancelled too.
    let path = announced(&mut page, 3, "a", 4).await;
    assert_eq!(post(&server, &path, b"slow").await.status, 204);
    wait_until(|| server.provider.n_started.load(Ordering::Relaxed) == 2).await;
    drop(page);
    wait_until(|| server.provider.n_cancelled.load(Ordering::Relaxed) == 2).await;
}
