//! What all connections share.

use crate::client::Client;
use crate::easel::Easel;
use crate::guard::Guard;
use crate::limits::{MOST_CLIENTS, MOST_SAVES};
use crate::studio::{self, Error, Studio};
use crate::telling::Told;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;
use surfel::render::Renderer;
use tokio::sync::{Semaphore, watch};

pub struct Hall {
    pub easel: Arc<Easel>,
    pub guard: Guard,
    pub renderer: Arc<dyn Renderer + Send>,
    /// None until the files are loaded.
    pub studio: watch::Sender<Option<Arc<dyn Studio>>>,
    /// Of loading, until it is done.
    pub loading: watch::Sender<Option<Told>>,
    /// Turns of those who want pictures to keep.
    pub saves: Semaphore,
    /// Set from outside, it ends everything.
    pub is_stopped: Arc<AtomicBool>,
    pub start: Instant,
    pub n_pictures: AtomicU64,
    /// Threads beside those that paint: preparing points for one client must not hold up another's picture.
    workshop: rayon::ThreadPool,
}

impl Hall {
    pub fn new(
        guard: Guard,
        renderer: Arc<dyn Renderer + Send>,
        is_stopped: Arc<AtomicBool>,
    ) -> studio::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(rayon::current_num_threads());
        let workshop = pool.build().map_err(|error| Error::Refused(error.to_string()))?;
        Ok(Self {
            easel: Arc::default(),
            guard,
            renderer,
            studio: watch::Sender::new(None),
            loading: watch::Sender::new(None),
            saves: Semaphore::new(MOST_SAVES),
            is_stopped,
            start: Instant::now(),
            n_pictures: AtomicU64::new(0),
            workshop,
        })
    }

    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    pub fn is_full(&self) -> bool {
        MOST_CLIENTS <= self.easel.n_clients()
    }

    /// Waits until there is something to see.
    pub async fn studio(&self) -> Option<Arc<dyn Studio>> {
        let mut receiver = self.studio.subscribe();
        let studio = receiver.wait_for(Option::is_some).await.ok()?;
        studio.clone()
    }

    /// Does long work away from the connections. A panic in it is an error of its own.
    pub async fn work<R: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce() -> R + Send + 'static,
    ) -> studio::Result<R> {
        let hall = self.clone();
        let done = tokio::task::spawn_blocking(move || hall.workshop.install(work)).await;
        done.map_err(|_| Error::Refused("internal error; please report it".into()))
    }

    /// Lets a client's picture be painted for as long as the result lives.
    pub fn admit(self: &Arc<Self>, client: Arc<Client>) -> Admission {
        self.easel.add(client.clone());
        Admission { hall: self.clone(), client }
    }
}

/// A client among those who are painted for.
pub struct Admission {
    hall: Arc<Hall>,
    client: Arc<Client>,
}

impl Drop for Admission {
    fn drop(&mut self) {
        self.hall.easel.remove(&self.client);
    }
}
