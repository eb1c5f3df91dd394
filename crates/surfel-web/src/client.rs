//! One who looks: what is looked at, and how much of its picture has been painted.

use crate::canvas::{Canvas, Quality};
use crate::frame::Frame;
use crate::studio::{Error, Stage};
use serde_json::{Value, json};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use surfel::progress::Progress;
use surfel::render::Renderer;
use surfel::scene::Camera;
use tokio::sync::mpsc;

/// What goes to a page.
#[derive(Debug)]
pub enum Outgoing {
    Text(String),
    /// With what is let go of once the page has taken it.
    Binary(Vec<u8>, Arc<dyn Any + Send + Sync>),
}

/// What a client looks at.
#[derive(Clone)]
pub struct Sight {
    pub stage: Option<Arc<Stage>>,
    /// Number of the stage, which pictures of it carry.
    pub stage_number: u16,
    pub camera: Option<Camera>,
    /// The same as it was said.
    pub camera_keys: Value,
    /// Of the page's picture, in pixels.
    pub size: (u32, u32),
    /// Number of the last message that it obeys.
    pub input: u32,
    /// Whether a hand is at the mouse.
    pub is_moving: bool,
}

pub struct Client {
    sight: Mutex<Sight>,
    /// Counts changes of the sight: work for an older one is stopped.
    version: AtomicU64,
    canvas: Mutex<Canvas>,
    flow: Mutex<Flow>,
    /// Shared with the pictures that have not been written yet, whatever the page says to have seen.
    unwritten: Arc<()>,
    out: mpsc::Sender<Outgoing>,
}

/// Pictures on their way: a slow page gets fewer, never older ones.
#[derive(Default)]
struct Flow {
    sent: u32,
    seen: u32,
    /// When numbers about pictures were last sent.
    told: Option<Instant>,
    /// When the last pictures were sent.
    times: Vec<Instant>,
}

/// Pictures that a page has not yet said to have seen, at most: one to show, one on its way.
const MOST_UNSEEN: u32 = 2;
/// Room that pictures leave in the queue for answers.
const ROOM_FOR_ANSWERS: usize = 8;
/// Between two messages with numbers.
const TELL_EVERY: Duration = Duration::from_millis(250);
/// A draft that takes longer is given up for a newer one.
const PATIENCE: Duration = Duration::from_millis(80);

impl Client {
    pub fn new(size: (u32, u32), out: mpsc::Sender<Outgoing>) -> Self {
        let sight = Sight {
            stage: None,
            stage_number: 0,
            camera: None,
            camera_keys: Value::Null,
            size,
            input: 0,
            is_moving: false,
        };
        Self {
            sight: Mutex::new(sight),
            version: AtomicU64::new(1),
            canvas: Mutex::default(),
            flow: Mutex::default(),
            unwritten: Arc::default(),
            out,
        }
    }

    /// Changes what is looked at.
    pub fn look(&self, change: impl FnOnce(&mut Sight)) {
        let mut sight = lock(&self.sight);
        change(&mut sight);
        self.version.fetch_add(1, Ordering::Relaxed);
    }

    /// Says whether a hand is still at the mouse, where nothing else has changed.
    pub fn rest(&self, is_moving: bool) {
        lock(&self.sight).is_moving = is_moving;
    }

    pub fn sight(&self) -> Sight {
        lock(&self.sight).clone()
    }

    /// Takes note that the page shows a picture.
    pub fn has_seen(&self, frame: u32) {
        let mut flow = lock(&self.flow);
        flow.seen = flow.seen.max(frame.min(flow.sent));
    }

    pub fn is_moving(&self) -> bool {
        lock(&self.sight).is_moving
    }

    /// Whether each of its pictures takes long.
    pub fn is_slow(&self) -> bool {
        lock(&self.canvas).is_slow()
    }

    fn may_send(&self) -> bool {
        let flow = lock(&self.flow);
        flow.sent - flow.seen < MOST_UNSEEN
            && Arc::strong_count(&self.unwritten) <= MOST_UNSEEN as usize
            && ROOM_FOR_ANSWERS < self.out.capacity()
            && !self.out.is_closed()
    }

    /// Paints and sends a draft within about `secs` if something has changed; returns whether it did.
    pub fn draft(&self, renderer: &dyn Renderer, secs: f64) -> surfel::Result<bool> {
        let (sight, version) = self.current();
        let mut canvas = lock(&self.canvas);
        if canvas.version() == version || !sight.is_complete() || !self.may_send() {
            return Ok(false);
        }
        let watch = self.watch(version, PATIENCE);
        if let Some(frame) = canvas.draft(renderer, &sight, secs, &watch)? {
            canvas.begin(version);
            self.send(frame, &sight);
        }
        Ok(true)
    }

    /// Paints a little more of the finished picture; returns whether there was something to do.
    pub fn refine(&self, renderer: &dyn Renderer) -> surfel::Result<bool> {
        let (sight, version) = self.current();
        let mut canvas = lock(&self.canvas);
        if canvas.version() != version || !sight.is_complete() || self.out.is_closed() {
            return Ok(false);
        }
        let watch = self.watch(version, Duration::ZERO);
        let has_painted = canvas.refine(renderer, &sight, &watch)?;
        let due = if self.may_send() { canvas.due(&sight) } else { None };
        let is_due = due.is_some();
        due.into_iter().for_each(|frame| self.send(frame, &sight));
        Ok(has_painted || is_due)
    }

    /// Whether `paint` found something to do. Where it fails or panics, this client is told and sees nothing
    /// new until its settings change; others are painted for as before.
    pub fn attempt(&self, paint: impl FnOnce(&Self) -> surfel::Result<bool>) -> bool {
        let error = match catch_unwind(AssertUnwindSafe(|| paint(self))) {
            Ok(Ok(has_painted)) => return has_painted,
            Ok(Err(surfel::Error::Cancelled)) => return true,
            Ok(Err(error)) => Error::from(error),
            Err(_) => Error::Panicked,
        };
        self.look(|sight| sight.stage = None);
        let message = json!({ "type": "error", "text": error.to_string() });
        let _ = self.out.try_send(Outgoing::Text(message.to_string()));
        true
    }

    fn watch(&self, version: u64, patience: Duration) -> Watch<'_> {
        Watch { client: self, version, start: Instant::now(), patience }
    }

    fn current(&self) -> (Sight, u64) {
        let sight = lock(&self.sight);
        (sight.clone(), self.version.load(Ordering::Relaxed))
    }

    /// Never waits: there is room, as this is all that fills it beside answers.
    fn send(&self, frame: Frame, sight: &Sight) {
        let mut flow = lock(&self.flow);
        flow.sent += 1;
        let now = Instant::now();
        flow.times.retain(|time| now - *time < Duration::from_secs(1));
        flow.times.push(now);
        let is_finished = frame.quality == Quality::Finished;
        let numbers =
            (is_finished || flow.told.is_none_or(|told| TELL_EVERY <= now - told)).then(|| {
                flow.told = Some(now);
                json!({
                    "type": "stats",
                    "frame": flow.sent,
                    "trace_ms": 1e3 * frame.trace_secs,
                    "encode_ms": 1e3 * frame.encode_secs,
                    "frames_per_s": flow.times.len(),
                    "mrays_per_s": frame.mrays_per_s,
                    "width": frame.width,
                    "height": frame.height,
                    "samples": frame.samples,
                    "of_samples": frame.of_samples,
                })
            });
        let binary = frame.message(flow.sent, sight.stage_number, sight.input);
        // A page that is gone is told of elsewhere.
        let _ = self.out.try_send(Outgoing::Binary(binary, self.unwritten.clone()));
        if let Some(numbers) = numbers {
            let _ = self.out.try_send(Outgoing::Text(numbers.to_string()));
        }
    }
}

impl Sight {
    fn is_complete(&self) -> bool {
        self.stage.is_some() && self.camera.is_some()
    }
}

/// Stops work for what is no longer looked at, and for those who are gone.
struct Watch<'c> {
    client: &'c Client,
    version: u64,
    start: Instant,
    /// For so long it goes on all the same.
    patience: Duration,
}

impl Progress for Watch<'_> {
    fn is_cancelled(&self) -> bool {
        let is_old = self.client.version.load(Ordering::Relaxed) != self.version;
        self.client.out.is_closed() || is_old && self.patience < self.start.elapsed()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
