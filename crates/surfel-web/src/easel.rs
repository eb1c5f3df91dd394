//! The thread that paints for all clients in turn.

use crate::client::Client;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use surfel::render::Renderer;

/// Of a second: a frame while one client moves, without its encoding.
const DRAFT_SECS: f64 = 0.8 / 30.0;
/// Less is all overhead.
const LEAST_DRAFT_SECS: f64 = 0.008;
/// Those whose pictures take long wait this many times as long in between, if there is something to
/// paint for others.
const REST: u32 = 9;
const FOREVER: Duration = Duration::from_secs(3600);

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
        let (mut turn, mut slow_turn) = (0, 0);
        let mut rest_until = Instant::now();
        loop {
            let (clients, n_calls) = {
                let room = self.room();
                if room.is_closed {
                    return;
                }
                (room.clients.clone(), room.n_calls)
            };
            let (slow, quick): (Vec<_>, Vec<_>) =
                clients.into_iter().partition(|client| client.is_slow());
            // Whoever moves gets a draft in each round, all others together one piece: waiting is
            // noticed at the mouse, not by who looks on.
            let n_moving = quick.iter().filter(|client| client.is_moving()).count();
            let secs = (DRAFT_SECS / n_moving.max(1) as f64).max(LEAST_DRAFT_SECS);
            let draft =
                |client: &Arc<Client>| client.attempt(|client| client.draft(renderer, secs));
            let refine = |client: &Arc<Client>| client.attempt(|client| client.refine(renderer));
            let n_drafts = quick.iter().filter(|client| draft(client)).count();
            let mut has_painted = in_turn(&quick, &mut turn, refine) || 0 < n_drafts;
            let start = Instant::now();
            let has_rested = rest_until <= start;
            if has_rested || n_moving == 0 && !has_painted {
                let paint = |client: &Arc<Client>| draft(client) || refine(client);
                has_painted |= in_turn(&slow, &mut slow_turn, paint);
                rest_until = Instant::now() + REST * start.elapsed();
            }
            if !has_painted {
                drop((slow, quick));
                self.wait(n_calls, if has_rested { FOREVER } else { rest_until - start });
            }
        }
    }

    /// Sleeps until there was another call than those known, or for so long.
    fn wait(&self, n_calls: u64, most: Duration) {
        let room = self.room();
        let is_idle = |room: &mut Room| room.n_calls == n_calls && !room.is_closed;
        drop(self.changed.wait_timeout_while(room, most, is_idle));
    }

    fn room(&self) -> MutexGuard<'_, Room> {
        self.room.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Goes on with the first one, from `turn`, for whom there is something to paint; returns whether there was.
fn in_turn(
    clients: &[Arc<Client>],
    turn: &mut usize,
    paint: impl Fn(&Arc<Client>) -> bool,
) -> bool {
    let mut from_turn = (0..clients.len()).map(|i| (*turn + i) % clients.len());
    let found = from_turn.find(|&i| paint(&clients[i]));
    *turn = found.map_or(*turn, |i| i + 1);
    found.is_some()
}
