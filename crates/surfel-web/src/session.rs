//! One page's connection: its messages in, pictures and answers out.

use crate::camera;
use crate::client::{Client, Outgoing};
use crate::frame;
use crate::hall::Hall;
use crate::limits::{MOST_PICKS, MOST_PIXELS, MOST_SAVED_PIXELS, PATIENCE, Rate, check_size};
use crate::message::Incoming;
use crate::pick;
use crate::staging;
use crate::studio::{Error, Keys};
use crate::telling::{Telling, Told};
use crate::wishes::{Wish, Wishes};
use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::timeout;

/// Messages that wait for a slow page.
const QUEUE: usize = 64;
/// Between two questions whether the page is still there.
const PING_EVERY: Duration = Duration::from_secs(10);
/// Saves of one page at once.
const MOST_SAVES: usize = 2;

pub async fn run(socket: WebSocket, hall: Arc<Hall>) {
    let (sink, mut stream) = socket.split();
    let (out, queue) = mpsc::channel(QUEUE);
    let writer = tokio::spawn(write(sink, queue));
    if let Some((size, patch)) = greeting(&mut stream, &out).await {
        let wishes: Arc<Wishes> = Arc::default();
        let client = Arc::new(Client::new(size, out.clone()));
        let _admission = hall.admit(client.clone());
        let staging =
            tokio::spawn(staging::run(hall.clone(), client.clone(), wishes.clone(), out.clone()));
        let picks = Arc::new(Semaphore::new(MOST_PICKS));
        let mut session = Session { hall, client, wishes, out, picks, saves: HashMap::new() };
        session.wish(Wish { patch, ..Wish::default() }).await;
        session.read(stream).await;
        session.saves.values().for_each(|is_cancelled| is_cancelled.store(true, Ordering::Relaxed));
        staging.abort();
    }
    writer.abort();
}

/// The size and settings that a page begins with.
async fn greeting(
    stream: &mut SplitStream<WebSocket>,
    out: &mpsc::Sender<Outgoing>,
) -> Option<((u32, u32), Keys)> {
    let first = timeout(PATIENCE, first_said(stream)).await.ok()??;
    let greeting = match first {
        Message::Text(text) => Incoming::parse(&text),
        _ => Err("expected hello".into()),
    };
    let greeting = greeting.and_then(|message| match message {
        Incoming::Hello { width, height, scene } => {
            check_size(width, height, MOST_PIXELS).map(|()| ((width, height), scene))
        }
        _ => Err("expected hello first".into()),
    });
    match greeting {
        Ok(greeting) => Some(greeting),
        Err(text) => {
            answer(out, &json!({ "type": "error", "text": text })).await;
            // Time for the writer to say so.
            tokio::time::sleep(Duration::from_millis(100)).await;
            None
        }
    }
}

/// The first message that is more than a sign of life.
async fn first_said(stream: &mut SplitStream<WebSocket>) -> Option<Message> {
    loop {
        match stream.next().await?.ok()? {
            Message::Ping(_) | Message::Pong(_) => {}
            message => return Some(message),
        }
    }
}

/// Sends what is queued; ends when the page takes nothing for too long, as all connections do.
async fn write(mut sink: SplitSink<WebSocket, Message>, mut queue: mpsc::Receiver<Outgoing>) {
    let mut pings = tokio::time::interval(PING_EVERY);
    loop {
        let (message, _held) = tokio::select! {
            outgoing = queue.recv() => match outgoing {
                Some(Outgoing::Text(text)) => (Message::Text(text.into()), None),
                Some(Outgoing::Binary(bytes, held)) => (Message::Binary(bytes.into()), Some(held)),
                None => return,
            },
            _ = pings.tick() => (Message::Ping(Default::default()), None),
        };
        if sink.send(message).await.is_err() {
            return;
        }
    }
}

/// Queues a message; waits while the page does not take what was sent.
pub async fn answer(out: &mpsc::Sender<Outgoing>, message: &Value) {
    let _ = out.send(Outgoing::Text(message.to_string())).await;
}

struct Session {
    hall: Arc<Hall>,
    client: Arc<Client>,
    wishes: Arc<Wishes>,
    out: mpsc::Sender<Outgoing>,
    /// Turns to ask what is at a place.
    picks: Arc<Semaphore>,
    /// Pictures to keep that have not been written to the page yet, with what stops them.
    saves: HashMap<u32, Arc<AtomicBool>>,
}

impl Session {
    async fn read(&mut self, mut stream: SplitStream<WebSocket>) {
        let mut rate = Rate::new(Instant::now());
        let mut is_flood = false;
        while let Some(message) = self.next(&mut stream).await {
            if self.out.is_closed() || self.hall.is_stopped() {
                return;
            }
            if !rate.allows(Instant::now()) {
                if !std::mem::replace(&mut is_flood, true) {
                    self.refuse(None, None, "too many messages; some are not obeyed").await;
                }
                continue;
            }
            is_flood = false;
            match message {
                Message::Text(text) => match Incoming::parse(&text) {
                    Ok(message) => self.obey(message).await,
                    Err(error) => self.refuse(None, None, &error).await,
                },
                Message::Binary(_) => self.refuse(None, None, "expected text, found bytes").await,
                Message::Close(_) => return,
                Message::Ping(_) | Message::Pong(_) => {}
            }
        }
    }

    /// Pages answer pings: one that says nothing for longer is gone.
    async fn next(&self, stream: &mut SplitStream<WebSocket>) -> Option<Message> {
        loop {
            match timeout(PING_EVERY + PATIENCE, stream.next()).await {
                Ok(message) => return message?.ok(),
                // A ping waits behind a large picture.
                Err(_) if self.saves.values().any(is_held) => {}
                Err(_) => return None,
            }
        }
    }

    async fn obey(&mut self, message: Incoming) {
        match message {
            Incoming::Hello { .. } => self.refuse(None, None, "hello was said already").await,
            Incoming::Size { width, height } => self.resize(width, height).await,
            Incoming::Camera { input, camera, moving } => self.turn(input, camera, moving).await,
            Incoming::Set { input, scene, moving } => {
                self.wish(Wish { patch: scene, is_anew: false, input, is_moving: moving }).await;
            }
            Incoming::Seen { frame } => {
                self.client.has_seen(frame);
                self.hall.easel.call();
            }
            Incoming::Pick { id, x, y } => self.pick(id, (x, y)).await,
            Incoming::Save { id, width, height } => self.save(id, width, height).await,
            Incoming::Cancel { id } => {
                let save = self.saves.get(&id);
                save.inspect(|is_cancelled| is_cancelled.store(true, Ordering::Relaxed));
            }
            Incoming::Take { id, width, height } => self.take(id, width, height).await,
            Incoming::Load { id, name, text } => self.load(id, name, text).await,
        }
    }

    async fn refuse(&self, id: Option<u32>, input: Option<u32>, text: &str) {
        answer(&self.out, &refusal(id, input, text)).await;
    }

    async fn resize(&self, width: u32, height: u32) {
        match check_size(width, height, MOST_PIXELS) {
            Ok(()) => self.look(|client| client.look(|sight| sight.size = (width, height))),
            Err(text) => self.refuse(None, None, &text).await,
        }
    }

    async fn turn(&self, input: u32, keys: Value, is_moving: bool) {
        match camera::parse(&keys) {
            Ok(camera) => self.look(|client| {
                client.look(|sight| {
                    sight.camera = Some(camera);
                    sight.camera_keys = keys;
                    (sight.input, sight.is_moving) = (input, is_moving);
                });
            }),
            Err(error) => self.refuse(None, Some(input), &error.to_string()).await,
        }
    }

    fn look(&self, change: impl FnOnce(&Client)) {
        change(&self.client);
        self.hall.easel.call();
    }

    async fn wish(&self, wish: Wish) {
        let input = wish.input;
        if let Err(text) = self.wishes.add(wish) {
            self.refuse(None, Some(input), &text).await;
        }
    }

    async fn pick(&self, id: u32, place: (f64, f64)) {
        let Ok(turn) = self.picks.clone().try_acquire_owned() else {
            return self.refuse(Some(id), None, "several places are being looked at; wait").await;
        };
        let (hall, client, out) = (self.hall.clone(), self.client.clone(), self.out.clone());
        tokio::spawn(async move {
            let _turn = turn;
            let Some(studio) = hall.studio().await else { return };
            let (gone, watched) = (out.clone(), hall.clone());
            let progress = Telling::new(|_| {}, move || gone.is_closed() || watched.is_stopped());
            let renderer = hall.renderer.clone();
            let found = hall.work(move || {
                let (stage, place) = pick::pick(&*renderer, &client.sight(), place, &progress)?;
                Some(studio.describe(&stage, &place))
            });
            let message = match found.await {
                Ok(point) => json!({ "type": "picked", "id": id, "point": point }),
                Err(error) => refusal(Some(id), None, &error.to_string()),
            };
            answer(&out, &message).await;
        });
    }

    /// Settings of what is seen, with the camera and this size.
    fn settings(&self, width: u32, height: u32) -> Option<Keys> {
        let sight = self.client.sight();
        let mut settings = sight.stage?.settings.clone();
        settings.insert("camera".into(), sight.camera_keys);
        settings.insert("resolution".into(), json!(format!("{width}x{height}")));
        Some(settings)
    }

    async fn save(&mut self, id: u32, width: u32, height: u32) {
        self.saves.retain(|_, is_cancelled| is_held(is_cancelled));
        let sized = check_size(width, height, MOST_SAVED_PIXELS);
        let place = match sized {
            Err(text) => Err(text),
            Ok(()) if self.saves.contains_key(&id) => Err("this picture is being saved".into()),
            Ok(()) if MOST_SAVES <= self.saves.len() => {
                Err("pictures are being saved; wait for one or cancel it".into())
            }
            Ok(()) => self.settings(width, height).ok_or_else(|| "nothing to save yet".to_owned()),
        };
        let settings = match place {
            Ok(settings) => settings,
            Err(text) => return self.refuse(Some(id), None, &text).await,
        };
        let is_cancelled: Arc<AtomicBool> = Arc::default();
        self.saves.insert(id, is_cancelled.clone());
        let (hall, out) = (self.hall.clone(), self.out.clone());
        tokio::spawn(async move {
            let message = match saved(&hall, id, settings, is_cancelled.clone(), &out).await {
                Ok(png) => {
                    let bytes = frame::saved(id, (width as u16, height as u16), &png);
                    Outgoing::Binary(bytes, is_cancelled)
                }
                Err(error) => {
                    Outgoing::Text(refusal(Some(id), None, &error.to_string()).to_string())
                }
            };
            let _ = out.send(message).await;
        });
    }

    async fn take(&self, id: u32, width: u32, height: u32) {
        let studio = self.hall.studio.borrow().clone();
        let Some((settings, studio)) = self.settings(width, height).zip(studio) else {
            return self.refuse(Some(id), None, "nothing to take yet").await;
        };
        let written = self.hall.work(move || studio.written(&settings)).await;
        let message = match written.and_then(|written| written) {
            Ok(written) => json!({
                "type": "taken",
                "id": id,
                "command": written.command,
                "toml": written.toml,
                "json": written.json,
            }),
            Err(error) => refusal(Some(id), None, &error.to_string()),
        };
        answer(&self.out, &message).await;
    }

    async fn load(&self, id: u32, name: String, text: String) {
        let Some(studio) = self.hall.studio.borrow().clone() else {
            return self.refuse(Some(id), None, "the files are still being loaded").await;
        };
        let read = self.hall.work(move || studio.read(&name, &text)).await;
        match read.and_then(|read| read) {
            Ok(patch) => self.wish(Wish { patch, is_anew: true, ..Wish::default() }).await,
            Err(error) => self.refuse(Some(id), None, &error.to_string()).await,
        }
    }
}

/// Whether a picture to keep is still being made or sent.
fn is_held(is_cancelled: &Arc<AtomicBool>) -> bool {
    1 < Arc::strong_count(is_cancelled)
}

pub fn refusal(id: Option<u32>, input: Option<u32>, text: &str) -> Value {
    let mut message = json!({ "type": "error", "text": text });
    id.into_iter().for_each(|id| message["id"] = json!(id));
    input.into_iter().for_each(|input| message["input"] = json!(input));
    message
}

/// A finished picture, once it is its turn.
async fn saved(
    hall: &Arc<Hall>,
    id: u32,
    settings: Keys,
    is_cancelled: Arc<AtomicBool>,
    out: &mpsc::Sender<Outgoing>,
) -> Result<Vec<u8>, Error> {
    let _turn = hall.saves.acquire().await.map_err(|_| Error::Cancelled)?;
    let studio = hall.studio().await.ok_or(Error::Cancelled)?;
    let (told, watched) = (out.clone(), hall.clone());
    let tell = move |told_now: Told| {
        let Told { done, left_secs, .. } = told_now;
        let message = json!({ "type": "progress", "id": id, "done": done, "left_secs": left_secs });
        // Progress that finds no room is not missed.
        let _ = told.try_send(Outgoing::Text(message.to_string()));
    };
    let gone = out.clone();
    let is_cancelled =
        move || is_cancelled.load(Ordering::Relaxed) || watched.is_stopped() || gone.is_closed();
    let telling = Telling::new(tell, is_cancelled);
    hall.work(move || studio.picture(&settings, &telling)).await?
}
