//! The server: listens at a port, accepts connections, and stops on request.

use crate::access::{AccessGuard, Scheme};
use crate::connections::ConnectionTable;
use crate::frame_ancestors::FrameAncestors;
use crate::limits::{Limits, Timeouts};
use crate::progress_reporter::ProgressReporter;
use crate::routes;
use crate::scene_provider::{Error, Result, SceneProvider};
use crate::server_state::ServerState;
use crate::tls::TlsIdentity;
use axum::Router;
use axum::extract::Extension;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use surfel_core::progress::Progress;
use surfel_core::render::Renderer;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::timeout;
use tokio_io_timeout::TimeoutStream;
use tokio_rustls::TlsAcceptor;

/// A server that is bound to a port and does not answer until it runs.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    guard: AccessGuard,
    limits: Limits,
    tls: Option<TlsIdentity>,
}

/// Number of threads for network input and output; rendering has threads of its own.
const N_IO_THREADS: usize = 2;
/// Interval between two checks of the stop flag.
const STOP_POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Duration after a failed `accept`, such as for lack of file handles, before the next one.
const ACCEPT_RETRY_DELAY: Duration = Duration::from_millis(50);
/// Duration for which running tasks may delay the server's end.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(500);

impl Server {
    /// Binds to a port; port 0 takes any free one.
    ///
    /// # Errors
    ///
    /// Fails if the system refuses the address or the port, or has no random numbers for a token.
    pub fn bind(host: IpAddr, port: u16) -> Result<Self> {
        let address = SocketAddr::new(host, port);
        let io = |source| Error::Io { address: address.to_string(), source };
        let listener = TcpListener::bind(address).map_err(io)?;
        let bound = listener.local_addr().map_err(io)?;
        let guard = AccessGuard::new(host)?;
        Ok(Self { listener, address: bound, guard, limits: Limits::default(), tls: None })
    }

    /// Replaces the default limits.
    pub fn with_limits(self, limits: Limits) -> Self {
        Self { limits, ..self }
    }

    /// Returns the limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Encrypts all connections.
    pub fn with_tls(self, identity: TlsIdentity) -> Self {
        let mut guard = self.guard;
        guard.scheme = Scheme::Https;
        Self { guard, tls: Some(identity), ..self }
    }

    /// The origins whose pages may show the page in a frame. They can be allowed while the server runs, too.
    pub fn frame_ancestors(&self) -> FrameAncestors {
        self.guard.frame_ancestors.clone()
    }

    /// The links to the page, with the token if one is needed. A server that listens at all addresses has one for
    /// other machines, if it has a network, and one for its own.
    pub fn links(&self) -> Vec<String> {
        let ip = self.address.ip();
        let hosts = if ip.is_unspecified() {
            let outer = outer_address(ip).map(host_name);
            outer.into_iter().chain(["localhost".to_owned()]).collect()
        } else {
            vec![host_name(ip)]
        };
        let (scheme, port) = (self.guard.scheme.name(), self.address.port());
        let token = self.guard.token().map_or(String::new(), |token| format!("?token={token}"));
        hosts.iter().map(|host| format!("{scheme}://{host}:{port}/{token}")).collect()
    }

    /// Answers requests until `is_stopped` is set. Pages may connect while `open` still loads the files.
    ///
    /// # Errors
    ///
    /// Fails if `open` fails, or if the system denies threads or the listener.
    pub fn run(
        self,
        renderer: Arc<dyn Renderer + Send>,
        is_stopped: Arc<AtomicBool>,
        open: impl FnOnce(&dyn Progress) -> Result<Arc<dyn SceneProvider>> + Send + 'static,
    ) -> Result<()> {
        let address = self.address.to_string();
        let io = |source| Error::Io { address: address.clone(), source };
        let state =
            Arc::new(ServerState::new(self.guard, renderer.clone(), self.limits, is_stopped));
        let render_thread = state.render_loop.start(renderer).map_err(io)?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(N_IO_THREADS)
            .enable_all()
            .build()
            .map_err(io)?;
        let ended = runtime.block_on(async {
            self.listener.set_nonblocking(true).map_err(io)?;
            let listener = tokio::net::TcpListener::from_std(self.listener).map_err(io)?;
            let acceptor = self.tls.map(|identity| identity.acceptor());
            let accepting = tokio::spawn(accept(listener, acceptor, state.clone()));
            let loaded = load(state.clone(), open).await;
            if loaded.is_ok() {
                wait_until_stopped(&state).await;
            }
            accepting.abort();
            // The port is closed once the task has ended: no connection may be accepted after that.
            let _ = accepting.await;
            loaded
        });
        state.is_stopped.store(true, Ordering::Relaxed);
        state.render_loop.close();
        runtime.shutdown_timeout(SHUTDOWN_TIMEOUT);
        drop(render_thread.join());
        ended
    }
}

async fn load(
    state: Arc<ServerState>,
    open: impl FnOnce(&dyn Progress) -> Result<Arc<dyn SceneProvider>> + Send + 'static,
) -> Result<()> {
    let (for_updates, for_cancel) = (state.clone(), state.clone());
    let reporter = ProgressReporter::new(
        move |update| drop(for_updates.loading.send_replace(Some(update))),
        move || for_cancel.is_stopped(),
    );
    let provider = state.run_blocking(move || open(&reporter)).await??;
    state.provider.send_replace(Some(provider));
    state.loading.send_replace(None);
    Ok(())
}

async fn wait_until_stopped(state: &ServerState) {
    while !state.is_stopped() {
        tokio::time::sleep(STOP_POLL_INTERVAL).await;
    }
}

async fn accept(
    listener: tokio::net::TcpListener,
    acceptor: Option<TlsAcceptor>,
    state: Arc<ServerState>,
) {
    let connections = Arc::new(ConnectionTable::new(&state.limits));
    let timeouts = state.limits.timeouts;
    let app = routes::router(state);
    loop {
        let Ok((stream, address)) = listener.accept().await else {
            tokio::time::sleep(ACCEPT_RETRY_DELAY).await;
            continue;
        };
        let entry = Arc::new(connections.add(address.ip()));
        let app = app.clone().layer(Extension(entry.clone()));
        let served = serve(stream, acceptor.clone(), app, timeouts);
        tokio::spawn(async move {
            tokio::select! {
                () = served => {}
                () = entry.evicted() => {}
            }
        });
    }
}

async fn serve(
    stream: tokio::net::TcpStream,
    acceptor: Option<TlsAcceptor>,
    app: Router,
    timeouts: Timeouts,
) {
    // Otherwise small messages wait for one another.
    let _ = stream.set_nodelay(true);
    let mut stream = Box::pin(TimeoutStream::new(stream));
    // A client that sends requests and does not read the answers would keep its place for ever.
    stream.as_mut().set_write_timeout_pinned(Some(timeouts.write));
    match acceptor {
        None => serve_http(stream, app, timeouts).await,
        Some(acceptor) => {
            if let Ok(Ok(stream)) = timeout(timeouts.request, acceptor.accept(stream)).await {
                serve_http(stream, app, timeouts).await;
            }
        }
    }
}

async fn serve_http(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    app: Router,
    timeouts: Timeouts,
) {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(timeouts.request);
    // An error means that the client broke off: there is nobody to report it to.
    let service = TowerToHyperService::new(app);
    let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
}

/// A host as an address has it.
fn host_name(ip: IpAddr) -> String {
    match ip {
        IpAddr::V6(ip) => format!("[{ip}]"),
        IpAddr::V4(ip) => ip.to_string(),
    }
}

/// The address by which other machines reach this one: that of the network interface with the default route.
fn outer_address(listening: IpAddr) -> Option<IpAddr> {
    // These addresses are reserved for documentation (RFC 5737, RFC 3849). A UDP socket sends nothing when it connects.
    let v4 = (IpAddr::V4(Ipv4Addr::UNSPECIFIED), IpAddr::from([192, 0, 2, 1]));
    let v6 =
        (IpAddr::V6(Ipv6Addr::UNSPECIFIED), Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1).into());
    let routes = if listening.is_ipv4() { vec![v4] } else { vec![v4, v6] };
    let address = |(from, to): (IpAddr, IpAddr)| {
        let socket = UdpSocket::bind((from, 0)).ok()?;
        socket.connect((to, 9)).ok()?;
        socket.local_addr().ok().map(|address| address.ip())
    };
    routes.into_iter().find_map(address).filter(|address| !address.is_loopback())
}
