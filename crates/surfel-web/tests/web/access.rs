//! Access control: attacks by foreign web sites, by clients without the token, and by half-open connections.

use crate::http_client::{Response, begin, connect_from, get, read_response, request};
use crate::test_page::TestPage;
use crate::test_server::TestServer;
use serde_json::json;
use std::net::Ipv4Addr;
use std::sync::atomic::Ordering;
use surfel_web::Limits;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

/// Paths of all kinds of requests.
const PATHS: [&str; 9] =
    ["/", "/ws", "/render", "/downloads/x", "/files/x", "/scene", "/stats", "/healthz", "/nothing"];

async fn get_with(server: &TestServer, path: &str, headers: &str) -> Response {
    request(server, &format!("GET {path} HTTP/1.1\r\n{headers}\r\n"), b"").await
}

async fn assert_denied(server: &TestServer, path: &str, headers: &str) {
    let response = get_with(server, path, headers).await;
    let is_error = response.json()["error"].is_string();
    assert_eq!((response.status, is_error), (403, true), "{path} {headers}");
}

fn start_beyond_loopback() -> TestServer {
    TestServer::start_at("0.0.0.0", Limits::default())
}

#[tokio::test]
async fn foreign_hosts_and_origins_are_denied() {
    let server = TestServer::start();
    for path in PATHS {
        for headers in [
            "Host: rebound.example",
            "Host: 127.0.0.1.nip.io",
            "Host: localhost.",
            "Host: 0.0.0.0",
            "Host: ",
            "X: no host",
            "Host: localhost\r\nOrigin: https://evil.example",
            "Host: localhost\r\nOrigin: null",
            "Host: localhost\r\nOrigin: https://localhost",
            "Host: localhost:80\r\nOrigin: http://localhost:81",
        ] {
            assert_denied(&server, path, headers).await;
        }
    }
}

#[tokio::test]
async fn requests_with_two_hosts_are_denied() {
    let server = TestServer::start();
    for path in PATHS {
        assert_denied(&server, path, "Host: localhost\r\nHost: evil.example").await;
        assert_denied(&server, path, "Host: localhost\r\nHost: localhost").await;
    }
    assert_denied(&server, "http://evil.example/scene", "Host: localhost").await;
}

/// A foreign page's image would render a picture, and tell by loading or failing which columns there are.
#[tokio::test]
async fn an_image_of_a_foreign_page_renders_nothing() {
    let server = TestServer::start();
    server.assert_serves_pictures().await;
    for site in ["cross-site", "same-site"] {
        let image = format!(
            "Host: localhost\r\nSec-Fetch-Site: {site}\r\nSec-Fetch-Mode: no-cors\r\nSec-Fetch-Dest: image"
        );
        for path in PATHS {
            assert_denied(&server, path, &image).await;
        }
        assert_denied(&server, "/render?slow=1", &image).await;
    }
    let referer = "Host: localhost\r\nReferer: https://evil.example/page";
    for path in ["/render", "/ws", "/downloads/x", "/scene", "/stats", "/render?slow=1"] {
        assert_denied(&server, path, referer).await;
    }
    assert_eq!(server.provider.n_started.load(Ordering::Relaxed), 0);
    let post = "POST /render HTTP/1.1\r\nHost: localhost\r\nSec-Fetch-Site: cross-site\r\nContent-Length: 2\r\n";
    assert_eq!(request(&server, post, b"{}").await.status, 403);
}

#[tokio::test]
async fn a_link_of_a_foreign_page_leads_to_the_page_alone() {
    let server = TestServer::start();
    let visit = "Host: localhost\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate";
    let in_tab = format!("{visit}\r\nSec-Fetch-Dest: document");
    assert_eq!(get_with(&server, "/", &in_tab).await.status, 200);
    for path in &PATHS[1..] {
        assert_denied(&server, path, &in_tab).await;
    }
    assert_denied(&server, "/", &format!("{visit}\r\nSec-Fetch-Dest: iframe")).await;
    for own in ["Sec-Fetch-Site: none", "Sec-Fetch-Site: same-origin", "Referer: http://localhost/"]
    {
        let headers = format!("Host: localhost\r\n{own}");
        assert_eq!(get_with(&server, "/scene", &headers).await.status, 200, "{own}");
    }
}

#[tokio::test]
async fn every_response_keeps_to_its_origin() {
    let server = start_beyond_loopback();
    for (path, status) in [("/", 200), ("/scene", 401), ("/nothing", 404), ("/a/b", 404)] {
        let response = get(&server, path).await;
        assert_eq!(response.status, status);
        assert_eq!(response.header("cross-origin-resource-policy"), Some("same-origin"), "{path}");
        assert_eq!(response.header("x-content-type-options"), Some("nosniff"), "{path}");
        assert_eq!(response.header("referrer-policy"), Some("same-origin"), "{path}");
    }
    let denied = get_with(&server, "/render", "Host: a\r\nSec-Fetch-Site: cross-site").await;
    assert_eq!(denied.header("cross-origin-resource-policy"), Some("same-origin"));
}

#[tokio::test]
async fn beyond_loopback_a_token_is_required() {
    let server = start_beyond_loopback();
    let token = server.token();
    assert_eq!(token.len(), 32);
    TestPage::open(&server, json!({})).await.finished_picture().await;
    for path in ["/ws", "/render", "/downloads/x", "/scene", "/stats"] {
        for query in ["", "?token=", "?token=0", "?Token=x", &format!("?token={token}0")] {
            let response = get(&server, &format!("{path}{query}")).await;
            let is_error = response.json()["error"].is_string();
            assert_eq!((response.status, is_error), (401, true), "{path}");
        }
    }
    assert_eq!(get(&server, &format!("/scene?token={token}")).await.status, 200);
    for scheme in ["Bearer", "bearer", "BEARER"] {
        let bearer = format!("Host: elsewhere\r\nAuthorization: {scheme} {token}");
        assert_eq!(get_with(&server, "/stats", &bearer).await.status, 200, "{scheme}");
    }
    for path in ["/", "/healthz"] {
        assert_eq!(get(&server, path).await.status, 200);
    }
}

#[tokio::test]
async fn the_token_moves_from_the_address_into_a_cookie() {
    let server = start_beyond_loopback();
    let link = format!("/?a=1&token={}", server.token());
    let exchanged = get_with(&server, &link, "Host: scan.example:8080").await;
    assert_eq!((exchanged.status, exchanged.header("location")), (303, Some("/?a=1")));
    let cookie = exchanged.header("set-cookie").unwrap();
    let expected = format!("surfel-8080={}; Path=/; HttpOnly; SameSite=Strict", server.token());
    assert_eq!(cookie, expected);
    assert_eq!(get(&server, "/?token=0").await.status, 401);
    let with_cookie = |sender: &str| {
        format!(
            "Host: scan.example:8080\r\nCookie: {}\r\n{sender}",
            cookie.split(';').next().unwrap()
        )
    };
    for (sender, status) in [
        ("Sec-Fetch-Site: same-origin", 200),
        ("Referer: http://scan.example:8080/", 200),
        ("Origin: http://scan.example:8080", 200),
        // A page of another port of this host, whose requests hold the cookie too.
        ("Accept: image/png", 401),
        ("Referer: http://scan.example:81/", 403),
        ("Sec-Fetch-Site: same-site", 403),
    ] {
        let found = get_with(&server, "/scene", &with_cookie(sender)).await.status;
        assert_eq!(found, status, "{sender}");
    }
}

/// Connections from these addresses that each have sent the beginning of a request.
async fn half_open(server: &TestServer, n: usize, sources: &[Ipv4Addr]) -> Vec<TcpStream> {
    let mut streams = Vec::new();
    for i in 0..n {
        let mut stream = connect_from(sources[i % sources.len()], server).await;
        // The server may have closed it.
        let _ = stream.write_all(b"GET /ws HTTP/1.1\r\nHost: loc").await;
        streams.push(stream);
    }
    streams
}

#[tokio::test]
async fn half_open_connections_lock_nobody_out() {
    let one = [Ipv4Addr::LOCALHOST];
    let several: Vec<Ipv4Addr> = (1..=100).map(|i| Ipv4Addr::new(127, 0, 0, i)).collect();
    for sources in [&one[..], &several] {
        let server = start_beyond_loopback();
        let mut before = TestPage::open(&server, json!({})).await;
        before.finished_picture().await;
        let attack = half_open(&server, 256, sources).await;
        let path = format!("/scene?token={}", server.token());
        assert_eq!(get(&server, &path).await.status, 200);
        TestPage::open(&server, json!({})).await.finished_picture().await;
        before.sync().await;
        drop(attack);
    }
}

#[tokio::test]
async fn half_open_connections_do_not_close_a_slow_client_of_another_address() {
    let server = start_beyond_loopback();
    let mut slow = connect_from(Ipv4Addr::new(127, 0, 0, 2), &server).await;
    slow.write_all(b"GET /healthz HTTP/1.1\r\nHost: a\r\n").await.unwrap();
    let attack = half_open(&server, 256, &[Ipv4Addr::new(127, 0, 0, 3)]).await;
    slow.write_all(b"Connection: close\r\n\r\n").await.unwrap();
    assert_eq!(read_response(&mut slow).await.status, 200);
    drop(attack);
}

#[tokio::test]
async fn clients_without_the_token_cannot_keep_a_connection() {
    let limits = Limits { max_pending_connections: 2, ..Limits::default() };
    let server = TestServer::start_at("0.0.0.0", limits);
    let request = "GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n";
    let mut answered = begin(&server, request).await;
    let authorized = format!("GET /stats?token={} HTTP/1.1\r\nHost: a\r\n\r\n", server.token());
    let mut kept = begin(&server, &authorized).await;
    for stream in [&mut answered, &mut kept] {
        stream.readable().await.unwrap();
    }
    let later = [begin(&server, request).await, begin(&server, request).await];
    assert_eq!(read_response(&mut answered).await.status, 200);
    kept.write_all(authorized.replace("a\r\n", "a\r\nConnection: close\r\n").as_bytes())
        .await
        .unwrap();
    let both = read_response(&mut kept).await;
    assert!(String::from_utf8_lossy(&both.body).contains("HTTP/1.1 200"));
    drop(later);
}
