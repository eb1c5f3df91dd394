//! The thread that paints for all clients in turn.

use crate::client::Client;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use surfel::render::Renderer;

/// Of a second: a frame while one client moves, without its encoding.
const DRAFT_SECS: f64 = 0.8 / 30.0;
/// Less is all overhead.
const LEAST_DRAFT_SECS: f64 = 0.008;

#[derive(Default)]
pub struct Easel {
    room: Mutex<Room>,
    changed: Condvar,
}

#[derive(Default)]
struct Room {
    clients: Vec<Arc<Client>>,
    /// Counts what may mean new work.
    n_calls: u64,
    is_closed: bool,
}

impl Easel {
    /// Paints on a thread of its own until `close` is called.
    pub fn start(
        self: &Arc<Self>,
        renderer: Arc<dyn Renderer + Send>,
    ) -> std::io::Result<JoinHandle<()>> {
        let easel = self.clone();
        std::thread::Builder::new().name("easel".into()).spawn(move || easel.paint(&*renderer))
    }

    pub fn add(&self, client: Arc<Client>) {
        self.room().clients.push(client);
        self.call();
    }

    pub fn remove(&self, client: &Arc<Client>) {
        self.room().clients.retain(|other| !Arc::ptr_eq(other, client));
    }

    /// Says that there may be something to do.
    pub fn call(&self) {
        self.room().n_calls += 1;
        self.changed.notify_all();
    }

    pub fn close(&self) {
        self.room().is_closed = true;
        self.changed.notify_all();
    }

    pub fn n_clients(&self) -> usize {
        self.room().clients.len()
    }

    fn paint(&self, renderer: &dyn Renderer) {
        let mut turn = 0;
        loop {
            let (clients, n_calls) = {
                let room = self.room();
                if room.is_closed {
                    return;
                }
                (room.clients.clone(), room.n_calls)
            };
            // Whoever moves gets a draft in each round, all others together one piece: waiting is
            // noticed at the mouse, not by who looks on.
            let n_moving = clients.iter().filter(|client| client.is_moving()).count();
            let secs = (DRAFT_SECS / n_moving.max(1) as f64).max(LEAST_DRAFT_SECS);
            let draft =
                |client: &&Arc<Client>| client.attempt(|client| client.draft(renderer, secs));
            let n_drafts = clients.iter().filter(draft).count();
            let mut in_turn = (0..clients.len()).map(|i| (turn + i) % clients.len());
            let refine = |&i: &usize| clients[i].attempt(|client| client.refine(renderer));
            let refined = in_turn.find(refine);
            turn = refined.map_or(turn, |i| i + 1);
            if n_drafts == 0 && refined.is_none() {
                drop(clients);
                self.wait(n_calls);
            }
        }
    }

    /// Sleeps until there was another call than those known.
    fn wait(&self, n_calls: u64) {
        let room = self.room();
        let is_idle = |room: &mut Room| room.n_calls == n_calls && !room.is_closed;
        drop(self.changed.wait_while(room, is_idle));
    }

    fn room(&self) -> MutexGuard<'_, Room> {
        self.room.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
