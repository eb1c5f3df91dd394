//! The render loop: one thread that renders for all clients in turn.

use crate::client::{Client, MOVING_PAUSE};
use crate::dynamic_resolution::draft_secs;
use crate::lock::lock;
use crate::sample_counts::Stage;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use surfel_core::render::Renderer;

/// After a slice for a slow client, slow clients pause for this many times its duration, unless no other client
/// has work.
const SLOW_CLIENT_PAUSE: u32 = 9;
/// Longest wait for a notification.
const MAX_WAIT: Duration = Duration::from_secs(3600);

/// The clients to render for, shared with the thread that renders.
#[derive(Default)]
pub struct RenderLoop {
    state: Mutex<LoopState>,
    changed: Condvar,
}

#[derive(Default)]
struct LoopState {
    clients: Vec<Arc<Client>>,
    /// Counts notifications, each of which may mean new work.
    n_notifications: u64,
    /// Number of tasks beside the loop: scenes that are prepared, pictures that are saved, questions about points.
    n_tasks: usize,
    is_closed: bool,
}

impl RenderLoop {
    /// Starts the thread, which runs until `close` is called.
    ///
    /// # Errors
    ///
    /// Fails if the system denies a thread.
    pub fn start(
        self: &Arc<Self>,
        renderer: Arc<dyn Renderer + Send>,
    ) -> std::io::Result<JoinHandle<()>> {
        let render_loop = self.clone();
        let run = move || render_loop.run(&*renderer);
        std::thread::Builder::new().name("render-loop".into()).spawn(run)
    }

    /// Renders for this client, too.
    pub fn add(&self, client: Arc<Client>) {
        self.lock().clients.push(client);
        self.notify();
    }

    /// Renders for this client no more.
    pub fn remove(&self, client: &Arc<Client>) {
        self.lock().clients.retain(|other| !Arc::ptr_eq(other, client));
    }

    /// Wakes the thread, as there may be new work.
    pub fn notify(&self) {
        self.lock().n_notifications += 1;
        self.changed.notify_all();
    }

    /// Holds back pictures that are finished and go on at rest, for as long as the returned guard lives.
    pub fn begin_task(self: &Arc<Self>) -> TaskGuard {
        self.lock().n_tasks += 1;
        TaskGuard { render_loop: self.clone() }
    }

    /// Ends the thread after its current slice.
    pub fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_all();
    }

    /// Number of clients.
    pub fn n_clients(&self) -> usize {
        self.lock().clients.len()
    }

    fn run(&self, renderer: &dyn Renderer) {
        let (mut next, mut next_slow) = (0, 0);
        let mut paused_until = Instant::now();
        loop {
            let (clients, n_notifications, has_tasks) = {
                let state = self.lock();
                if state.is_closed {
                    return;
                }
                (state.clients.clone(), state.n_notifications, 0 < state.n_tasks)
            };
            let (slow, quick): (Vec<_>, Vec<_>) =
                clients.into_iter().partition(|client| client.is_slow());
            // Each round draws a draft for every interacting client and refines one idle one: the user who drags
            // notices a delay, the one who only watches does not.
            let n_moving = quick.iter().filter(|client| client.is_moving()).count();
            let secs = draft_secs(n_moving);
            let draft =
                |client: &Arc<Client>| client.catch_failures(|client| client.draft(renderer, secs));
            let refine_to = |client: &Arc<Client>, stage| {
                client.catch_failures(|client| client.refine(renderer, stage))
            };
            let refine = |client: &Arc<Client>| refine_to(client, Stage::Finish);
            let n_drafts = quick.iter().filter(|client| draft(client)).count();
            let mut has_rendered = round_robin(&quick, &mut next, refine) || 0 < n_drafts;
            let start = Instant::now();
            let is_pause_over = paused_until <= start;
            if is_pause_over || n_moving == 0 && !has_rendered {
                let render = |client: &Arc<Client>| draft(client) || refine(client);
                has_rendered |= round_robin(&slow, &mut next_slow, render);
                paused_until = Instant::now() + SLOW_CLIENT_PAUSE * start.elapsed();
            }
            if !has_rendered && !has_tasks {
                has_rendered =
                    round_robin(&quick, &mut next, |client| refine_to(client, Stage::Rest));
            }
            if !has_rendered {
                let max_wait = if is_pause_over { MAX_WAIT } else { paused_until - start };
                let is_any_moving = quick.iter().chain(&slow).any(|client| client.is_moving());
                let max_wait = if is_any_moving { max_wait.min(MOVING_PAUSE) } else { max_wait };
                drop((slow, quick));
                self.wait(n_notifications, max_wait);
            }
        }
    }

    /// Sleeps until there are more notifications than those known, at most for `max_wait`.
    fn wait(&self, n_known: u64, max_wait: Duration) {
        let is_idle = |state: &mut LoopState| state.n_notifications == n_known && !state.is_closed;
        drop(self.changed.wait_timeout_while(self.lock(), max_wait, is_idle));
    }

    fn lock(&self) -> MutexGuard<'_, LoopState> {
        lock(&self.state)
    }
}

/// A task beside the render loop, which ends when this is dropped.
pub struct TaskGuard {
    render_loop: Arc<RenderLoop>,
}

impl Drop for TaskGuard {
    fn drop(&mut self) {
        self.render_loop.lock().n_tasks -= 1;
        self.render_loop.notify();
    }
}

/// Renders for the first client from `next` on that has work; returns whether there was one.
fn round_robin(
    clients: &[Arc<Client>],
    next: &mut usize,
    render: impl Fn(&Arc<Client>) -> bool,
) -> bool {
    let mut candidates = (0..clients.len()).map(|i| (*next + i) % clients.len());
    let found = candidates.find(|&i| render(&clients[i]));
    *next = found.map_or(*next, |i| i + 1);
    found.is_some()
}
