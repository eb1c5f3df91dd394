//! Encrypted connections, with a certificate that the test makes.

use crate::http_client::{Response, begin, read_response};
use crate::test_server::TestServer;
use std::sync::Arc;
use surfel_web::TlsIdentity;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::CertificateDer;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};

/// An encrypted server beyond loopback, and clients that trust its certificate.
fn start() -> (TestServer, TlsConnector) {
    let generated = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let key = generated.signing_key.serialize_pem();
    let identity = TlsIdentity::from_pem(generated.cert.pem().as_bytes(), key.as_bytes()).unwrap();
    (TestServer::start_encrypted("0.0.0.0", identity), connector(generated.cert.der()))
}

/// A connector that trusts this certificate alone.
fn connector(certificate: &CertificateDer<'static>) -> TlsConnector {
    let mut roots = RootCertStore::empty();
    roots.add(certificate.clone()).unwrap();
    let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let builder = builder.with_safe_default_protocol_versions().unwrap();
    Arc::new(builder.with_root_certificates(roots).with_no_client_auth()).into()
}

async fn connect(server: &TestServer, connector: &TlsConnector) -> TlsStream<TcpStream> {
    let stream = begin(server, "").await;
    connector.connect("localhost".try_into().unwrap(), stream).await.unwrap()
}

async fn get(server: &TestServer, connector: &TlsConnector, path: &str, headers: &str) -> Response {
    let mut stream = connect(server, connector).await;
    let head =
        format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{headers}\r\n");
    stream.write_all(head.as_bytes()).await.unwrap();
    read_response(&mut stream).await
}

#[tokio::test]
async fn requests_are_answered_by_tls() {
    let (server, connector) = start();
    assert!(server.link.starts_with("https://localhost:"), "{}", server.link);
    assert_eq!(get(&server, &connector, "/", "").await.status, 200);
    let link = format!("/?token={}", server.token());
    let exchanged = get(&server, &connector, &link, "").await;
    let cookie = exchanged.header("set-cookie").unwrap();
    assert!(cookie.ends_with("; Path=/; HttpOnly; SameSite=Strict; Secure"), "{cookie}");
    let cookie = format!("Cookie: {}\r\n", cookie.split(';').next().unwrap());
    for (origin, status) in [("https://localhost", 200), ("http://localhost", 403)] {
        let headers = format!("Origin: {origin}\r\n{cookie}");
        assert_eq!(get(&server, &connector, "/stats", &headers).await.status, status, "{origin}");
    }
}

#[tokio::test]
async fn unencrypted_requests_and_foreign_certificates_are_refused() {
    let (server, connector) = start();
    let request = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let response = read_response(&mut begin(&server, request).await).await;
    assert_eq!(response.status, 0);
    let stream = begin(&server, "").await;
    let other = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let distrusting = self::connector(other.cert.der());
    assert!(distrusting.connect("localhost".try_into().unwrap(), stream).await.is_err());
    assert_eq!(get(&server, &connector, "/healthz", "").await.status, 200);
}
