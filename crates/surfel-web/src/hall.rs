//! What all connections share.

use crate::client::Client;
use crate::easel::Easel;
use crate::guard::Guard;
use crate::limits::{MOST_CLIENTS, MOST_SAVES, MOST_WORK};
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
    /// Places for pages.
    pub places: Arc<Semaphore>,
    /// Turns of those who want pictures to keep.
    pub saves: Arc<Semaphore>,
    /// Set from outside, it ends everything.
    pub is_stopped: Arc<AtomicBool>,
    pub start: Instant,
    pub n_pictures: AtomicU64,
    /// Turns of those who want long work done.
    turns: Arc<Semaphore>,
}

impl Hall {
    pub fn new(
        guard: Guard,
        renderer: Arc<dyn Renderer + Send>,
        is_stopped: Arc<AtomicBool>,
    ) -> Self {
        let turns = |n| Arc::new(Semaphore::new(n));
        Self {
            easel: Arc::default(),
            guard,
            renderer,
            studio: watch::Sender::new(None),
            loading: watch::Sender::new(None),
            places: turns(MOST_CLIENTS),
            saves: turns(MOST_SAVES),
            is_stopped,
            start: Instant::now(),
            n_pictures: AtomicU64::new(0),
            turns: turns(MOST_WORK),
        }
    }

    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    /// Waits until there is something to see.
    pub async fn studio(&self) -> Option<Arc<dyn Studio>> {
        let mut receiver = self.studio.subscribe();
        let studio = receiver.wait_for(Option::is_some).await.ok()?;
        studio.clone()
    }

    /// Does long work away from the connections. A panic in it is an error of its own.
    pub async fn work<R: Send + 'static>(
        &self,
        work: impl FnOnce() -> R + Send + 'static,
    ) -> studio::Result<R> {
        let turn = self.turns.clone().acquire_owned().await;
        // Held until the work ends, even if nobody waits for it any more.
        let done = tokio::task::spawn_blocking(move || (work(), turn).0).await;
        done.map_err(|_| Error::Panicked)
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
