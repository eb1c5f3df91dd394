//! Listens, and answers until it is told to stop.

use crate::guard::Guard;
use crate::hall::Hall;
use crate::limits::{MOST_CONNECTIONS, PATIENCE};
use crate::routes;
use crate::studio::{Error, Result, Studio};
use crate::telling::Telling;
use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use surfel::progress::Progress;
use surfel::render::Renderer;
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;

/// A port that is listened at, for a server that does not answer yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    guard: Guard,
}

/// Threads that read and write; those that paint are others.
const THREADS: usize = 2;
/// Between two looks whether to stop.
const STOP_EVERY: Duration = Duration::from_millis(50);

impl Server {
    /// Port 0 takes any that is free.
    pub fn bind(host: IpAddr, port: u16) -> Result<Self> {
        let place = SocketAddr::new(host, port);
        let io = |source| Error::Io { place: place.to_string(), source };
        let listener = TcpListener::bind(place).map_err(io)?;
        let address = listener.local_addr().map_err(io)?;
        let guard = Guard::new(host).map_err(|error| Error::Refused(format!("token: {error}")))?;
        Ok(Self { listener, address, guard })
    }

    /// Where the page is, with the token if one is needed.
    pub fn link(&self) -> String {
        let host = match self.address.ip() {
            ip if ip.is_unspecified() => "localhost".to_owned(),
            ip @ IpAddr::V6(_) => format!("[{ip}]"),
            ip => ip.to_string(),
        };
        let token = self.guard.token().map_or(String::new(), |token| format!("?token={token}"));
        format!("http://{host}:{}/{token}", self.address.port())
    }

    /// Answers until `is_stopped`. Pages may come while `open` still loads the files; where that fails, the
    /// server ends with its error.
    pub fn run(
        self,
        renderer: Arc<dyn Renderer + Send>,
        is_stopped: Arc<AtomicBool>,
        open: impl FnOnce(&dyn Progress) -> Result<Arc<dyn Studio>> + Send + 'static,
    ) -> Result<()> {
        let place = self.address.to_string();
        let io = |source| Error::Io { place: place.clone(), source };
        let hall = Arc::new(Hall::new(self.guard, renderer.clone(), is_stopped));
        let easel = hall.easel.start(renderer).map_err(io)?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(THREADS)
            .enable_all()
            .build()
            .map_err(io)?;
        let ended = runtime.block_on(async {
            self.listener.set_nonblocking(true).map_err(io)?;
            let listener = tokio::net::TcpListener::from_std(self.listener).map_err(io)?;
            let accepting = tokio::spawn(accept(listener, routes::router(hall.clone())));
            let opened = load(hall.clone(), open).await;
            if opened.is_ok() {
                stopped(&hall).await;
            }
            accepting.abort();
            opened
        });
        hall.is_stopped.store(true, Ordering::Relaxed);
        hall.easel.close();
        runtime.shutdown_timeout(Duration::from_millis(500));
        drop(easel.join());
        ended
    }
}

async fn load(
    hall: Arc<Hall>,
    open: impl FnOnce(&dyn Progress) -> Result<Arc<dyn Studio>> + Send + 'static,
) -> Result<()> {
    let (told, watched) = (hall.clone(), hall.clone());
    let telling = Telling::new(
        move |line| drop(told.loading.send_replace(Some(line))),
        move || watched.is_stopped(),
    );
    let studio = hall.work(move || open(&telling)).await??;
    hall.studio.send_replace(Some(studio));
    hall.loading.send_replace(None);
    Ok(())
}

async fn stopped(hall: &Hall) {
    while !hall.is_stopped() {
        tokio::time::sleep(STOP_EVERY).await;
    }
}

async fn accept(listener: tokio::net::TcpListener, app: Router) {
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        // Out of file handles, say: others may be free soon.
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(STOP_EVERY).await;
            continue;
        };
        let Ok(place) = places.clone().try_acquire_owned() else { continue };
        // Without, small messages wait for one another.
        let _ = stream.set_nodelay(true);
        let mut stream = Box::pin(TimeoutStream::new(stream));
        // Who asks and does not read the answer would hold its place for ever.
        stream.as_mut().set_write_timeout_pinned(Some(PATIENCE));
        let service = TowerToHyperService::new(app.clone());
        tokio::spawn(async move {
            let _place = place;
            let mut http = http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(PATIENCE);
            // Of a client that breaks off there is nothing to tell.
            let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
        });
    }
}
