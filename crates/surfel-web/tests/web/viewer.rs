//! A server on a thread of its own, for one test.

use crate::page::Page;
use crate::studio::{HillStudio, MoodyRenderer};
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use surfel::progress::Progress;
use surfel_web::{Result, Server, Studio};

pub struct Viewer {
    /// With the token, if there is one.
    pub link: String,
    pub studio: Arc<HillStudio>,
    is_stopped: Arc<AtomicBool>,
    server: Option<JoinHandle<Result<()>>>,
}

impl Viewer {
    pub fn start() -> Self {
        Self::start_at("127.0.0.1", |_| Ok(()))
    }

    /// The studio is there once `load` is done.
    pub fn start_at(
        host: &str,
        load: impl FnOnce(&dyn Progress) -> Result<()> + Send + 'static,
    ) -> Self {
        let server = Server::bind(host.parse().unwrap(), 0).unwrap();
        let (link, studio) = (server.link(), Arc::new(HillStudio::new()));
        let is_stopped: Arc<AtomicBool> = Arc::default();
        let (opened, stop) = (studio.clone(), is_stopped.clone());
        let open = move |progress: &dyn Progress| {
            load(progress)?;
            Ok(opened as Arc<dyn Studio>)
        };
        let run = move || server.run(Arc::new(MoodyRenderer), stop, open);
        Self { link, studio, is_stopped, server: Some(std::thread::spawn(run)) }
    }

    /// Host and port.
    pub fn place(&self) -> &str {
        self.link["http://".len()..].split_once('/').unwrap().0
    }

    /// The end of a server that ends by itself, or is told to.
    pub fn ended(&mut self) -> Result<()> {
        self.server.take().unwrap().join().unwrap()
    }

    pub fn stop(&mut self) -> Result<()> {
        self.is_stopped.store(true, Ordering::Relaxed);
        self.ended()
    }

    /// Whether someone new is shown a finished picture.
    pub async fn still_works(&self) {
        let mut page = Page::open(self, json!({})).await;
        page.finished().await;
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.is_stopped.store(true, Ordering::Relaxed);
        if let Some(server) = self.server.take() {
            let _ = server.join();
        }
    }
}
