//! The state that all connections of a server share.

use crate::access::AccessGuard;
use crate::added_files::FileUploads;
use crate::client::Client;
use crate::downloads::Downloads;
use crate::limits::Limits;
use crate::progress_reporter::ProgressUpdate;
use crate::render_loop::RenderLoop;
use crate::scene_provider::{Error, Result, SceneProvider};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;
use surfel_core::render::Renderer;
use tokio::runtime::Handle;
use tokio::sync::{Semaphore, watch};

/// The state that all connections of a server share.
pub struct ServerState {
    /// The thread that renders for all clients.
    pub render_loop: Arc<RenderLoop>,
    /// Decides which requests are allowed.
    pub guard: AccessGuard,
    /// Renders interactive pictures and picks.
    pub renderer: Arc<dyn Renderer + Send>,
    /// None until the files are loaded.
    pub provider: watch::Sender<Option<Arc<dyn SceneProvider>>>,
    /// Progress of loading the files; none once they are loaded.
    pub loading: watch::Sender<Option<ProgressUpdate>>,
    /// The limits of the server.
    pub limits: Limits,
    /// One permit for each connected page.
    pub page_permits: Arc<Semaphore>,
    /// One permit for each saved picture, movie or file of points that is being made.
    pub render_permits: Arc<Semaphore>,
    /// Files of points and movies for the pages that have requested them.
    pub downloads: Arc<Downloads>,
    /// Files that pages are adding, and the memory of those that they have added.
    pub uploads: Arc<FileUploads>,
    /// Set from outside to stop the server.
    pub is_stopped: Arc<AtomicBool>,
    /// When the server started.
    pub start: Instant,
    /// Number of pictures rendered for `/render`.
    pub n_pictures: AtomicU64,
    /// Number of pages that have ever been connected.
    n_registered: AtomicU64,
    task_permits: Arc<Semaphore>,
}

impl ServerState {
    /// State without clients and without a loaded scene.
    pub fn new(
        guard: AccessGuard,
        renderer: Arc<dyn Renderer + Send>,
        limits: Limits,
        is_stopped: Arc<AtomicBool>,
    ) -> Self {
        let permits = |n| Arc::new(Semaphore::new(n));
        Self {
            render_loop: Arc::default(),
            guard,
            renderer,
            provider: watch::Sender::new(None),
            loading: watch::Sender::new(None),
            page_permits: permits(limits.max_pages),
            render_permits: permits(limits.max_renders),
            task_permits: permits(limits.max_tasks),
            uploads: Arc::new(FileUploads::new(&limits)),
            limits,
            downloads: Arc::default(),
            is_stopped,
            start: Instant::now(),
            n_pictures: AtomicU64::new(0),
            n_registered: AtomicU64::new(0),
        }
    }

    /// Returns whether the server is to stop.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    /// Waits until the files are loaded. If the server stops before, this ends with its runtime.
    pub async fn provider(&self) -> Arc<dyn SceneProvider> {
        let mut receiver = self.provider.subscribe();
        let loaded = receiver.wait_for(Option::is_some).await;
        let loaded = loaded.expect("the state has the sender");
        loaded.clone().expect("it was waited for")
    }

    /// The provider's facts about the data, with the limits that a page must know.
    pub fn info(&self, provider: &dyn SceneProvider) -> Value {
        let mut info = provider.info();
        info["limits"] = json!({
            "max_pixels": self.limits.max_view_pixels,
            "max_save_pixels": self.limits.max_save_pixels,
            "max_message_bytes": self.limits.max_message_bytes,
            "max_added_file_bytes": self.limits.max_added_file_bytes,
        });
        info
    }

    /// Runs a blocking task on a thread of its own, once a permit is free.
    ///
    /// # Errors
    ///
    /// Fails if the task panics.
    pub async fn run_blocking<R: Send + 'static>(
        &self,
        task: impl FnOnce() -> R + Send + 'static,
    ) -> Result<R> {
        let permit = self.task_permits.clone().acquire_owned().await;
        let guard = self.render_loop.begin_task();
        // The task holds both until it ends, even if nothing waits for its result any more.
        let done = tokio::task::spawn_blocking(move || (task(), permit, guard).0).await;
        done.map_err(|_| Error::Panicked)
    }

    /// Renders for a client for as long as the returned guard lives.
    pub fn register(self: &Arc<Self>, client: Arc<Client>) -> ClientGuard {
        self.n_registered.fetch_add(1, Ordering::Relaxed);
        self.render_loop.add(client.clone());
        ClientGuard { state: self.clone(), client }
    }

    /// Frees what was made for pages unless one connects within a while.
    async fn release_unless_used(self: Arc<Self>) {
        let n_registered = self.n_registered.load(Ordering::Relaxed);
        tokio::time::sleep(self.limits.timeouts.release).await;
        // A page may have come after the last one went and before the number was read.
        let is_used = 0 < self.render_loop.n_clients()
            || self.n_registered.load(Ordering::Relaxed) != n_registered;
        let provider = self.provider.borrow().clone();
        if let Some(provider) = provider.filter(|_| !is_used) {
            let _ = self.run_blocking(move || provider.release()).await;
        }
    }
}

/// Removes its client from the render loop when dropped.
pub struct ClientGuard {
    state: Arc<ServerState>,
    client: Arc<Client>,
}

impl Drop for ClientGuard {
    fn drop(&mut self) {
        self.state.render_loop.remove(&self.client);
        let is_last = self.state.render_loop.n_clients() == 0;
        // A server that ends has no runtime any more.
        if let Some(runtime) = Handle::try_current().ok().filter(|_| is_last) {
            runtime.spawn(self.state.clone().release_unless_used());
        }
    }
}
