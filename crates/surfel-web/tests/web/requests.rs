//! HTTP: the page's files, pictures for programs, and who may ask.

use crate::http::{ask, begin, get, post, rest};
use crate::page::Page;
use crate::viewer::Viewer;
use serde_json::json;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use tokio_tungstenite::tungstenite::Error;

#[tokio::test]
async fn the_page_comes_with_its_policy() {
    let viewer = Viewer::start();
    for (path, content_type) in [
        ("/", "text/html; charset=utf-8"),
        ("/index.html", "text/html; charset=utf-8"),
        ("/main.js", "text/javascript; charset=utf-8"),
        ("/base.css", "text/css; charset=utf-8"),
        ("/icon.svg", "image/svg+xml"),
    ] {
        let file = get(&viewer, path).await;
        assert_eq!((file.status, file.header("content-type")), (200, Some(content_type)));
        assert!(file.header("content-security-policy").unwrap().contains("default-src 'self'"));
        assert_eq!(file.header("x-content-type-options"), Some("nosniff"));
        assert_eq!(file.header("referrer-policy"), Some("no-referrer"));
        assert!(!file.body.is_empty());
    }
}

#[tokio::test]
async fn no_path_leads_to_files() {
    let viewer = Viewer::start();
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
        assert_eq!(get(&viewer, path).await.status, 404, "{path}");
    }
    assert_eq!(get(&viewer, "/%ff").await.status, 400);
}

#[tokio::test]
async fn programs_get_pictures() {
    let viewer = Viewer::start();
    viewer.still_works().await;
    let own = viewer.studio.finished((30, 20));
    for answer in [
        get(&viewer, "/render?resolution=30x20").await,
        post(&viewer, "/render", br#"{"resolution": "30x20"}"#).await,
    ] {
        assert_eq!((answer.status, answer.header("content-type")), (200, Some("image/png")));
        assert_eq!(image::load_from_memory(&answer.body).unwrap().into_rgba8(), own);
    }
    let scene = get(&viewer, "/scene").await.json();
    assert_eq!(scene["tint"], 0);
    let stats = get(&viewer, "/stats").await.json();
    assert_eq!((&stats["pictures"], &stats["info"]["name"]), (&json!(2), &json!("hill")));
    assert_eq!(get(&viewer, "/healthz").await.json(), json!({ "status": "ready" }));
}

#[tokio::test]
async fn what_is_refused_says_why_in_json() {
    let viewer = Viewer::start();
    viewer.still_works().await;
    let large = vec![b' '; (1 << 18) + 1];
    let deep = "[".repeat(200_000);
    for (answer, status) in [
        (get(&viewer, "/render?wrong=1").await, 400),
        (get(&viewer, "/render?panics=1").await, 400),
        (post(&viewer, "/render", b"{").await, 400),
        (post(&viewer, "/render", b"7").await, 400),
        (post(&viewer, "/render", deep.as_bytes()).await, 400),
        (post(&viewer, "/render", &large).await, 413),
    ] {
        assert_eq!((answer.status, answer.json()["error"].is_string()), (status, true));
    }
    viewer.still_works().await;
}

#[tokio::test]
async fn pictures_for_programs_are_made_two_at_once_and_end_with_their_requests() {
    let viewer = Viewer::start();
    viewer.still_works().await;
    let slow = r#"{"slow": 100}"#;
    let length = slow.len();
    let head = format!(
        "POST /render HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n\r\n{slow}"
    );
    let asking = [begin(&viewer, &head).await, begin(&viewer, &head).await];
    tokio::time::sleep(Duration::from_millis(500)).await;
    assert_eq!(get(&viewer, "/render").await.status, 429);
    drop(asking);
    while viewer.studio.n_cancelled.load(Ordering::Relaxed) < 2 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(get(&viewer, "/render").await.status, 200);
}

#[tokio::test]
async fn while_files_are_loaded_programs_are_told_so() {
    let viewer = Viewer::start_at("127.0.0.1", |progress| {
        while !progress.is_cancelled() {
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    });
    assert_eq!(get(&viewer, "/healthz").await.json(), json!({ "status": "loading" }));
    for path in ["/scene", "/render"] {
        assert_eq!(get(&viewer, path).await.status, 503);
    }
}

#[tokio::test]
async fn foreign_names_and_pages_are_kept_out() {
    let viewer = Viewer::start();
    for path in ["/", "/main.js", "/ws", "/render", "/scene", "/stats", "/healthz", "/nothing"] {
        for headers in [
            "Host: rebound.example",
            "Host: 127.0.0.1.nip.io",
            "Host: localhost.",
            "Host: 0.0.0.0",
            "Host: ",
            "X: no host",
            "Host: localhost\r\nOrigin: https://evil.example",
            "Host: localhost\r\nOrigin: null",
            "Host: localhost:80\r\nOrigin: http://localhost:81",
        ] {
            let head = format!("GET {path} HTTP/1.1\r\n{headers}\r\n");
            let answer = ask(&viewer, &head, b"").await;
            assert_eq!((answer.status, answer.json()["error"].is_string()), (403, true), "{head}");
        }
    }
}

#[tokio::test]
async fn beyond_loopback_all_but_the_page_needs_the_token() {
    let viewer = Viewer::start_at("0.0.0.0", |_| Ok(()));
    let token = viewer.link.split_once("token=").unwrap().1.to_owned();
    assert_eq!(token.len(), 32);
    Page::open(&viewer, json!({})).await.finished().await;
    for path in ["/ws", "/render", "/scene", "/stats"] {
        for query in ["", "?token=", "?token=0", "?Token=x", &format!("?token={}0", token)] {
            let answer = get(&viewer, &format!("{path}{query}")).await;
            assert_eq!((answer.status, answer.json()["error"].is_string()), (401, true), "{path}");
        }
    }
    assert_eq!(get(&viewer, &format!("/scene?token={token}")).await.status, 200);
    let bearer =
        format!("GET /stats HTTP/1.1\r\nHost: elsewhere\r\nAuthorization: Bearer {token}\r\n");
    assert_eq!(ask(&viewer, &bearer, b"").await.status, 200);
    for path in ["/", "/healthz"] {
        assert_eq!(get(&viewer, path).await.status, 200);
    }
}

#[tokio::test]
async fn one_page_too_many_is_turned_away_until_another_leaves() {
    let viewer = Viewer::start();
    let mut pages = Vec::new();
    for _ in 0..32 {
        pages.push(Page::connect(&viewer).await.unwrap());
    }
    assert!(
        matches!(Page::connect(&viewer).await, Err(Error::Http(answer)) if answer.status() == 503)
    );
    pages.pop();
    while Page::connect(&viewer).await.is_err() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn requests_that_are_none_are_answered_so() {
    let viewer = Viewer::start();
    for text in ["\r\n\r\n\r\n", "GET\r\n\r\n", "\u{0}\u{1}\u{2}\r\n\r\n", "PRI * HTTP/2.0\r\n\r\n"]
    {
        let mut stream = begin(&viewer, text).await;
        stream.shutdown().await.unwrap();
        assert!([0, 400, 505].contains(&rest(&mut stream).await.status), "{text:?}");
    }
    viewer.still_works().await;
}
