//! One page as the render loop sees it: the view it shows, and the pictures that are on their way to it.

use crate::accumulator::Accumulator;
use crate::frame::{Frame, Quality};
use crate::lock::lock;
use crate::outgoing::Outgoing;
use crate::sample_counts::Stage;
use crate::scene_provider::Error;
use crate::view::ViewState;
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use surfel_core::progress::Progress;
use surfel_core::render::Renderer;
use tokio::sync::mpsc;

/// A page's view, its picture, and the queue of messages to it.
pub struct Client {
    view: Mutex<ViewState>,
    /// Counts changes of the view; work for an older version is cancelled.
    version: AtomicU64,
    accumulator: Mutex<Accumulator>,
    flow: Mutex<FlowControl>,
    /// Shared with each picture that is not written to the connection yet, whatever the page acknowledges.
    unwritten: Arc<()>,
    out: mpsc::Sender<Outgoing>,
}

/// Flow control of pictures: a slow page gets fewer pictures, never older ones.
#[derive(Default)]
struct FlowControl {
    /// Number of pictures sent.
    n_sent: u32,
    /// Number of the last picture that the page acknowledged.
    last_acked: u32,
    /// When statistics were last sent.
    last_stats: Option<Instant>,
    /// When each picture of the last second was sent.
    send_times: Vec<Instant>,
}

/// Maximum number of pictures that are not acknowledged: one being shown, one on its way.
const MAX_UNACKED: u32 = 2;
/// Capacity of the queue that pictures leave free for answers.
const RESERVED_CAPACITY: usize = 8;
/// Minimum duration between two messages with statistics.
const STATS_INTERVAL: Duration = Duration::from_millis(250);
/// Duration after which a draft of an older view is cancelled.
const STALE_DRAFT_TIMEOUT: Duration = Duration::from_millis(80);
/// Duration for which a view that is being moved must stay as it is before its picture is refined: between two drafts
/// the page needs the processor to show the first one.
pub const MOVING_PAUSE: Duration = Duration::from_millis(100);

impl Client {
    /// A client without a scene, whose pictures have this size.
    pub fn new(size: (u32, u32), out: mpsc::Sender<Outgoing>) -> Self {
        let view = ViewState {
            scene: None,
            scene_number: 0,
            camera: None,
            camera_settings: Value::Null,
            size,
            seq: 0,
            is_moving: false,
            changed_at: Instant::now(),
        };
        Self {
            view: Mutex::new(view),
            version: AtomicU64::new(1),
            accumulator: Mutex::default(),
            flow: Mutex::default(),
            unwritten: Arc::default(),
            out,
        }
    }

    /// Changes the view and cancels work for the old one.
    pub fn update_view(&self, change: impl FnOnce(&mut ViewState)) {
        let mut view = lock(&self.view);
        change(&mut view);
        view.changed_at = Instant::now();
        self.version.fetch_add(1, Ordering::Relaxed);
    }

    /// Records whether the user is dragging, without a change of the view.
    pub fn set_moving(&self, is_moving: bool) {
        lock(&self.view).is_moving = is_moving;
    }

    /// A copy of the view.
    pub fn view(&self) -> ViewState {
        lock(&self.view).clone()
    }

    /// Records that the page has shown a picture.
    pub fn acknowledge(&self, frame: u32) {
        let mut flow = lock(&self.flow);
        flow.last_acked = flow.last_acked.max(frame.min(flow.n_sent));
    }

    /// Returns whether the user is dragging.
    pub fn is_moving(&self) -> bool {
        lock(&self.view).is_moving
    }

    /// Returns whether even the smallest slice of its picture takes long.
    pub fn is_slow(&self) -> bool {
        lock(&self.accumulator).is_slow()
    }

    fn can_send(&self) -> bool {
        let flow = lock(&self.flow);
        flow.n_sent - flow.last_acked < MAX_UNACKED
            && Arc::strong_count(&self.unwritten) <= MAX_UNACKED as usize
            && RESERVED_CAPACITY < self.out.capacity()
            && !self.out.is_closed()
    }

    /// Renders and sends a draft within about `secs` if the view has changed; returns whether it had.
    ///
    /// # Errors
    ///
    /// Fails if rendering fails or is cancelled.
    pub fn draft(&self, renderer: &dyn Renderer, secs: f64) -> surfel_core::Result<bool> {
        let (view, version) = self.versioned_view();
        let mut accumulator = lock(&self.accumulator);
        if accumulator.version() == version || !view.is_complete() || !self.can_send() {
            return Ok(false);
        }
        let check = self.stale_check(version, STALE_DRAFT_TIMEOUT);
        if let Some(frame) = accumulator.draft(renderer, &view, secs, &check)? {
            accumulator.begin(version);
            self.send(frame, &view);
        }
        Ok(true)
    }

    /// Renders one slice of the picture of a stage; returns whether there was anything to do.
    ///
    /// # Errors
    ///
    /// Fails if rendering fails or is cancelled.
    pub fn refine(&self, renderer: &dyn Renderer, stage: Stage) -> surfel_core::Result<bool> {
        let (view, version) = self.versioned_view();
        if view.is_moving && (stage == Stage::Rest || view.changed_at.elapsed() < MOVING_PAUSE) {
            return Ok(false);
        }
        let mut accumulator = lock(&self.accumulator);
        if accumulator.version() != version || !view.is_complete() || self.out.is_closed() {
            return Ok(false);
        }
        let check = self.stale_check(version, Duration::ZERO);
        let has_rendered = accumulator.refine(renderer, &view, stage, &check)?;
        let frame = if self.can_send() { accumulator.take_frame(&view) } else { None };
        let has_frame = frame.is_some();
        frame.into_iter().for_each(|frame| self.send(frame, &view));
        Ok(has_rendered || has_frame)
    }

    /// Runs `render` and returns whether it found anything to do. If it fails or panics, this client gets an error
    /// and no picture until its settings change; other clients are not affected.
    pub fn catch_failures(&self, render: impl FnOnce(&Self) -> surfel_core::Result<bool>) -> bool {
        let error = match catch_unwind(AssertUnwindSafe(|| render(self))) {
            Ok(Ok(has_rendered)) => return has_rendered,
            Ok(Err(surfel_core::Error::Cancelled)) => return true,
            Ok(Err(error)) => Error::from(error),
            Err(_) => Error::Panicked,
        };
        self.update_view(|view| view.scene = None);
        let message = json!({ "type": "error", "text": error.to_string() });
        let _ = self.out.try_send(Outgoing::Text(message.to_string()));
        true
    }

    fn stale_check(&self, version: u64, stale_timeout: Duration) -> StaleCheck<'_> {
        StaleCheck { client: self, version, start: Instant::now(), stale_timeout }
    }

    fn versioned_view(&self) -> (ViewState, u64) {
        let view = lock(&self.view);
        (view.clone(), self.version.load(Ordering::Relaxed))
    }

    /// Queues a picture. It never waits: `can_send` has checked the queue's capacity.
    fn send(&self, frame: Frame, view: &ViewState) {
        let mut flow = lock(&self.flow);
        flow.n_sent += 1;
        let now = Instant::now();
        flow.send_times.retain(|time| now - *time < Duration::from_secs(1));
        flow.send_times.push(now);
        let is_finished = frame.quality == Quality::Finished;
        let is_due = flow.last_stats.is_none_or(|last| STATS_INTERVAL <= now - last);
        let stats = (is_finished || is_due).then(|| {
            flow.last_stats = Some(now);
            json!({
                "type": "stats",
                "frame": flow.n_sent,
                "trace_ms": 1e3 * frame.trace_secs,
                "encode_ms": 1e3 * frame.encode_secs,
                "frames_per_s": flow.send_times.len(),
                "mrays_per_s": frame.mrays_per_s,
                "width": frame.width,
                "height": frame.height,
                "samples": frame.samples,
                "of_samples": frame.of_samples,
            })
        });
        let binary = frame.message(flow.n_sent, view.scene_number, view.seq);
        // Sending fails only if the page has gone, which the session notices.
        let _ = self.out.try_send(Outgoing::Binary(binary, self.unwritten.clone()));
        if let Some(stats) = stats {
            let _ = self.out.try_send(Outgoing::Text(stats.to_string()));
        }
    }
}

/// Cancels work for an older view, and for a page that has gone.
struct StaleCheck<'c> {
    client: &'c Client,
    version: u64,
    start: Instant,
    /// Duration for which work goes on although its view is old.
    stale_timeout: Duration,
}

impl Progress for StaleCheck<'_> {
    fn is_cancelled(&self) -> bool {
        let is_stale = self.client.version.load(Ordering::Relaxed) != self.version;
        self.client.out.is_closed() || is_stale && self.stale_timeout < self.start.elapsed()
    }
}
