//! A server on a thread of its own, for one test.

use crate::hill_provider::{FaultyRenderer, HillProvider};
use crate::test_page::TestPage;
use serde_json::json;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use surfel_core::progress::Progress;
use surfel_web::{FrameAncestors, Limits, Result, SceneProvider, Server, TlsIdentity};

/// Duration after which a test that waits for the server fails; generous, for busy machines.
pub const TIMEOUT: Duration = Duration::from_secs(60);

/// Waits until a condition holds.
pub async fn wait_until(condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < TIMEOUT, "the condition never held");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

pub struct TestServer {
    /// The link to the page at this machine, with the token if there is one.
    pub link: String,
    pub provider: Arc<HillProvider>,
    pub frame_ancestors: FrameAncestors,
    is_stopped: Arc<AtomicBool>,
    server: Option<JoinHandle<Result<()>>>,
}

impl TestServer {
    /// A server with the default limits on loopback.
    pub fn start() -> Self {
        Self::start_with_limits(Limits::default())
    }

    /// A server with these limits on loopback.
    pub fn start_with_limits(limits: Limits) -> Self {
        Self::start_at("127.0.0.1", limits)
    }

    /// A server with these limits at this host, whose files are loaded.
    pub fn start_at(host: &str, limits: Limits) -> Self {
        let server = Server::bind(host.parse().unwrap(), 0).unwrap().with_limits(limits);
        let started = Self::run(server, |_| Ok(()));
        started.wait_until_loaded();
        started
    }

    /// A server on loopback whose files are loaded once `load` returns.
    pub fn start_loading(load: impl FnOnce(&dyn Progress) -> Result<()> + Send + 'static) -> Self {
        Self::run(Server::bind(Ipv4Addr::LOCALHOST.into(), 0).unwrap(), load)
    }

    /// A server at this host whose connections are encrypted.
    pub fn start_encrypted(host: &str, identity: TlsIdentity) -> Self {
        Self::run(Server::bind(host.parse().unwrap(), 0).unwrap().with_tls(identity), |_| Ok(()))
    }

    fn run(
        server: Server,
        load: impl FnOnce(&dyn Progress) -> Result<()> + Send + 'static,
    ) -> Self {
        let (link, provider) = (server.links().pop().unwrap(), Arc::new(HillProvider::new()));
        let frame_ancestors = server.frame_ancestors();
        let is_stopped: Arc<AtomicBool> = Arc::default();
        let (loaded, stop) = (provider.clone(), is_stopped.clone());
        let open = move |progress: &dyn Progress| {
            load(progress)?;
            Ok(loaded as Arc<dyn SceneProvider>)
        };
        let run = move || server.run(Arc::new(FaultyRenderer), stop, open);
        let server = Some(std::thread::spawn(run));
        Self { link, provider, frame_ancestors, is_stopped, server }
    }

    fn wait_until_loaded(&self) {
        let start = Instant::now();
        loop {
            let mut stream = TcpStream::connect(self.socket_address()).unwrap();
            let request = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
            stream.write_all(request).unwrap();
            let mut response = String::new();
            stream.read_to_string(&mut response).unwrap();
            if response.contains("ready") {
                return;
            }
            assert!(start.elapsed() < TIMEOUT, "the files were never loaded");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Host and port.
    pub fn address(&self) -> &str {
        self.link.split('/').nth(2).unwrap()
    }

    /// The address of the server on loopback.
    pub fn socket_address(&self) -> SocketAddr {
        let port = self.address().rsplit_once(':').unwrap().1;
        (Ipv4Addr::LOCALHOST, port.parse().unwrap()).into()
    }

    /// The token in the link.
    pub fn token(&self) -> &str {
        self.link.split_once("token=").unwrap().1
    }

    /// Waits until the server ends, by itself or because it was stopped.
    pub fn join(&mut self) -> Result<()> {
        self.server.take().unwrap().join().unwrap()
    }

    /// Stops the server.
    pub fn stop(&mut self) -> Result<()> {
        self.is_stopped.store(true, Ordering::Relaxed);
        self.join()
    }

    /// Asserts that a new page gets a finished picture, once there is a permit for it.
    pub async fn assert_serves_pictures(&self) {
        let mut page = TestPage::connect_when_possible(self).await;
        page.send_hello(json!({})).await;
        page.finished_picture().await;
    }
}

impl Drop for TestServer {
    fn drop(&mut self) {
        self.provider.gate.open();
        self.is_stopped.store(true, Ordering::Relaxed);
        if let Some(server) = self.server.take() {
            let _ = server.join();
        }
    }
}
