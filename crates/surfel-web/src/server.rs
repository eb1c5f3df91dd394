//! The server: listens at a port, accepts connections, and stops on request.

use crate::access::AccessGuard;
use crate::limits::{Limits, Timeouts};
use crate::progress_reporter::ProgressReporter;
use crate::routes;
use crate::scene_provider::{Error, Result, SceneProvider};
use crate::server_state::ServerState;
use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use surfel_core::progress::Progress;
use surfel_core::render::Renderer;
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;

/// A server that is bound to a port and does not answer until it runs.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    guard: AccessGuard,
    limits: Limits,
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
    /// Fails if the system refuses the address or the port, or has no random numbers for a token.
    pub fn bind(host: IpAddr, port: u16) -> Result<Self> {
        let address = SocketAddr::new(host, port);
        let io = |source| Error::Io { address: address.to_string(), source };
        let listener = TcpListener::bind(address).map_err(io)?;
        let bound = listener.local_addr().map_err(io)?;
        let guard = AccessGuard::new(host)
            .map_err(|error| Error::invalid_request(format!("token: {error}")))?;
        Ok(Self { listener, address: bound, guard, limits: Limits::default() })
    }

    /// Replaces the default limits.
    pub fn with_limits(self, limits: Limits) -> Self {
        Self { limits, ..self }
    }

    /// The link to the page, with the token if one is needed.
    pub fn link(&self) -> String {
        let host = match self.address.ip() {
            ip if ip.is_unspecified() => "localhost".to_owned(),
            ip @ IpAddr::V6(_) => format!("[{ip}]"),
            ip => ip.to_string(),
        };
        let token = self.guard.token().map_or(String::new(), |token| format!("?token={token}"));
        format!("http://{host}:{}/{token}", self.address.port())
    }

    /// Answers requests until `is_stopped` is set. Pages may connect while `open` still loads the files.
    ///
    /// # Errors
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
            let accepting = tokio::spawn(accept(listener, state.clone()));
            let loaded = load(state.clone(), open).await;
            if loaded.is_ok() {
                wait_until_stopped(&state).await;
            }
            accepting.abort();
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

async fn accept(listener: tokio::net::TcpListener, state: Arc<ServerState>) {
    let permits = Arc::new(Semaphore::new(state.limits.max_connections));
    let timeouts = state.limits.timeouts;
    let app = routes::router(state);
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(ACCEPT_RETRY_DELAY).await;
            continue;
        };
        let Ok(permit) = permits.clone().try_acquire_owned() else { continue };
        let app = app.clone();
        tokio::spawn(async move {
            let _permit = permit;
            serve(stream, app, timeouts).await;
        });
    }
}

async fn serve(stream: tokio::net::TcpStream, app: Router, timeouts: Timeouts) {
    // Otherwise small messages wait for one another.
    let _ = stream.set_nodelay(true);
    let mut stream = Box::pin(TimeoutStream::new(stream));
    // A client that sends requests and does not read the answers would hold its permit for ever.
    stream.as_mut().set_write_timeout_pinned(Some(timeouts.write));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(timeouts.request);
    // An error means that the client broke off: there is nobody to report it to.
    let service = TowerToHyperService::new(app);
    let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
}
