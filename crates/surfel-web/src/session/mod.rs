//! One page's connection: reads its messages, and writes pictures and answers.

use crate::add_file::{self, Announcement};
use crate::added_files::PageFiles;
use crate::client::Client;
use crate::downloads::DownloadGuard;
use crate::frame;
use crate::handshake::handshake;
use crate::limits::RateLimiter;
use crate::lock::lock;
use crate::long_work::run_slowly;
use crate::message::Incoming;
use crate::outgoing::{Outgoing, RequestRef, rejection, send_json, write};
use crate::pending_changes::{PendingChanges, SettingsChange};
use crate::profile;
use crate::scene_provider::{Error, MovieRequest, Result, SceneProvider, SettingsMap, WrittenFile};
use crate::scene_update;
use crate::server_state::ServerState;
use crate::volume;
use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt;
use futures_util::stream::SplitStream;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use surfel_core::progress::Progress;
use tokio::sync::{Semaphore, mpsc};
use tokio::time::timeout;

mod queries;

/// Maximum number of messages that wait for a slow page.
const OUTGOING_CAPACITY: usize = 64;

/// Serves a page until its connection ends.
pub async fn run(socket: WebSocket, state: Arc<ServerState>) {
    let (sink, mut stream) = socket.split();
    let (out, queue) = mpsc::channel(OUTGOING_CAPACITY);
    let timeouts = state.limits.timeouts;
    let mut writer = tokio::spawn(write(sink, queue, timeouts.ping_interval));
    match handshake(&mut stream, &state.limits).await {
        Some(Ok(hello)) => {
            let pending = Arc::new(PendingChanges::new(state.limits.max_pending_bytes));
            let client = Arc::new(Client::new(hello.size, out.clone()));
            let _guard = state.register(client.clone());
            let updates = tokio::spawn(scene_update::run(
                state.clone(),
                client.clone(),
                pending.clone(),
                out.clone(),
                hello,
            ));
            let queries = Arc::new(Semaphore::new(state.limits.max_page_queries));
            let mut session = Session {
                state,
                client,
                pending,
                out,
                queries,
                save_permit: Arc::new(Semaphore::new(1)),
                saves: HashMap::new(),
                downloads: Arc::default(),
                files: Arc::default(),
                last_seq: 0,
            };
            session.read(stream).await;
            session.saves.values().for_each(cancel);
            updates.abort();
        }
        Some(Err(error)) => {
            send_json(&out, &rejection(RequestRef::Unnumbered, &error)).await;
            // The writer ends once it has sent the error.
            drop(out);
            let _ = timeout(timeouts.write, &mut writer).await;
        }
        None => {}
    }
    writer.abort();
}

/// The kinds of files that a page requests; it has one of each.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum FileKind {
    Points,
    Movie,
}

impl FileKind {
    /// Returns the type of its messages, and their field for the number of items.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Points => ("points", "n_points"),
            Self::Movie => ("movie", "n_frames"),
        }
    }
}

struct Session {
    state: Arc<ServerState>,
    client: Arc<Client>,
    pending: Arc<PendingChanges>,
    out: mpsc::Sender<Outgoing>,
    /// One permit for each question about points that is being answered.
    queries: Arc<Semaphore>,
    /// The permit for the saved picture, movie or file of points that is being made; others of the page wait for it.
    save_permit: Arc<Semaphore>,
    /// The cancellation flags of saved pictures, movies and files of points that are not sent completely, by request id.
    saves: HashMap<u32, Arc<AtomicBool>>,
    /// The file of points and the movie that the page requested last.
    downloads: Arc<Mutex<HashMap<FileKind, DownloadGuard>>>,
    /// The files that the page has added.
    files: Arc<PageFiles>,
    /// Sequence number of the last camera or settings change.
    last_seq: u32,
}

impl Session {
    async fn read(&mut self, mut stream: SplitStream<WebSocket>) {
        let mut limiter = RateLimiter::new(&self.state.limits, Instant::now());
        let mut is_flooding = false;
        while let Some(message) = self.next(&mut stream).await {
            if self.out.is_closed() || self.state.is_stopped() {
                return;
            }
            let parsed = match &message {
                Message::Text(text) => Incoming::parse(text),
                Message::Binary(_) => Err(Error::invalid_request("expected text, found bytes")),
                Message::Close(_) => return,
                Message::Ping(_) | Message::Pong(_) => continue,
            };
            // A picture whose acknowledgement is ignored would count as on its way for ever.
            if matches!(parsed, Ok(Incoming::Ack { .. })) || limiter.allows(Instant::now()) {
                is_flooding = false;
                match parsed {
                    Ok(message) => self.handle(message).await,
                    Err(error) => self.reject(RequestRef::of(&message), &error).await,
                }
                continue;
            }
            let request = RequestRef::of(&message);
            // Each request is answered; one error is enough for all other messages of a flood.
            if !is_flooding || !matches!(request, RequestRef::Unnumbered) {
                let text = "too many messages; this one is ignored";
                self.reject(request, &Error::invalid_request(text)).await;
            }
            is_flooding = true;
        }
    }

    /// The next message; none if the page has gone. Pages answer pings, so a silent page has gone.
    async fn next(&self, stream: &mut SplitStream<WebSocket>) -> Option<Message> {
        loop {
            match timeout(self.state.limits.timeouts.idle, stream.next()).await {
                Ok(message) => return message?.ok(),
                // A ping may be queued behind a large picture.
                Err(_) if self.saves.values().any(is_held) => {}
                Err(_) => return None,
            }
        }
    }

    async fn handle(&mut self, message: Incoming) {
        match message {
            Incoming::Hello { .. } => self.reject_text("hello was sent already").await,
            Incoming::Size { width, height } => self.resize(width, height).await,
            Incoming::Camera { seq, camera, moving } => {
                self.last_seq = seq;
                self.set_camera(seq, camera, moving).await;
            }
            Incoming::Set { seq, scene, moving } => {
                self.last_seq = seq;
                let (patch, is_moving) = (scene, moving);
                self.change(SettingsChange { patch, seq, is_moving, ..SettingsChange::default() })
                    .await;
            }
            Incoming::Ack { frame } => {
                self.client.acknowledge(frame);
                self.state.render_loop.notify();
            }
            Incoming::Ping => send_json(&self.out, &json!({ "type": "pong" })).await,
            Incoming::Pick { id, x, y } => self.pick(id, (x, y)).await,
            Incoming::Visible { id, points } => self.visible(id, points).await,
            Incoming::Profile { id, points, width, up } => {
                self.profile(id, profile::parse(&points, width, up)).await;
            }
            Incoming::Volume { id, points, up, base, cell_size } => {
                self.volume(id, volume::parse(&points, up, &base, cell_size)).await;
            }
            Incoming::Histogram { id, column } => self.histogram(id, column).await,
            Incoming::Save { id, width, height } => self.save(id, width, height).await,
            Incoming::Points { id, format } => self.points(id, format).await,
            Incoming::Movie { id, format, width, height, fps } => {
                self.movie(id, (width, height), MovieRequest { format, fps }).await;
            }
            Incoming::AddFile { id, name, n_bytes } => {
                self.add_file(Announcement { id, name, n_bytes }).await;
            }
            Incoming::Cancel { id } => self.saves.get(&id).into_iter().for_each(cancel),
            Incoming::Export { id, width, height, measurements } => {
                self.export(id, (width, height), measurements).await
            }
            Incoming::LoadScene { id, name, text } => self.load_scene(id, name, text).await,
        }
    }

    async fn reject(&self, request: RequestRef, error: &Error) {
        send_json(&self.out, &rejection(request, error)).await;
    }

    async fn reject_text(&self, text: &str) {
        self.reject(RequestRef::Unnumbered, &Error::invalid_request(text)).await;
    }

    async fn resize(&self, width: u32, height: u32) {
        match self.state.limits.check_view_size(width, height) {
            Ok(()) => {
                self.client.update_view(|view| view.size = (width, height));
                self.state.render_loop.notify();
            }
            Err(error) => self.reject(RequestRef::Unnumbered, &error).await,
        }
    }

    async fn set_camera(&self, seq: u32, camera_settings: Value, is_moving: bool) {
        let provider = self.state.provider.borrow().clone();
        let loading = || Error::invalid_request("the files are still being loaded");
        match provider.ok_or_else(loading).and_then(|provider| provider.camera(&camera_settings)) {
            Ok(camera) => {
                self.client.update_view(|view| {
                    view.camera = Some(camera);
                    view.camera_settings = camera_settings;
                    (view.seq, view.is_moving) = (seq, is_moving);
                });
                self.state.render_loop.notify();
            }
            Err(error) => self.reject(RequestRef::Seq(seq), &error).await,
        }
    }

    async fn change(&self, change: SettingsChange) {
        let request = change.load_id.map_or(RequestRef::Seq(change.seq), RequestRef::Id);
        if let Err(error) = self.pending.add(change) {
            self.reject(request, &error).await;
        }
    }

    /// The current settings with the page's camera, for a picture of this size; none before the first scene.
    fn settings(&self, width: u32, height: u32) -> Option<SettingsMap> {
        let view = self.client.view();
        let mut settings = view.scene?.settings.clone();
        settings.insert("camera".into(), view.camera_settings);
        settings.insert("resolution".into(), json!(format!("{width}x{height}")));
        Some(settings)
    }

    /// Checks that the page may save or add another file.
    fn check_saves(&mut self, id: u32) -> Result<()> {
        self.saves.retain(|_, is_cancelled| is_held(is_cancelled));
        if self.saves.contains_key(&id) {
            return Err(Error::invalid_request("this is being saved"));
        }
        if self.state.limits.max_page_saves <= self.saves.len() {
            let text = "files are being saved or added; wait for one or cancel it";
            return Err(Error::invalid_request(text));
        }
        Ok(())
    }

    /// Returns the flag that cancels the work on a file.
    fn begin_save(&mut self, id: u32) -> Arc<AtomicBool> {
        let is_cancelled: Arc<AtomicBool> = Arc::default();
        self.saves.insert(id, is_cancelled.clone());
        is_cancelled
    }

    fn settings_to_save(&mut self, id: u32, (width, height): (u32, u32)) -> Result<SettingsMap> {
        self.check_saves(id)?;
        let settings = self.settings(width, height);
        settings.ok_or_else(|| Error::invalid_request("there is nothing to save yet"))
    }

    async fn add_file(&mut self, announced: Announcement) {
        let id = announced.id;
        if let Err(error) = self.check_saves(id) {
            return self.reject(RequestRef::Id(id), &error).await;
        }
        let is_cancelled = self.begin_save(id);
        let (state, files, out) = (self.state.clone(), self.files.clone(), self.out.clone());
        tokio::spawn(async move {
            let added = add_file::run(&state, announced, &files, is_cancelled, &out).await;
            let message = added.unwrap_or_else(|error| rejection(RequestRef::Id(id), &error));
            send_json(&out, &message).await;
        });
    }

    async fn save(&mut self, id: u32, width: u32, height: u32) {
        let checked = self.state.limits.check_save_size(width, height);
        let settings = match checked.and_then(|()| self.settings_to_save(id, (width, height))) {
            Ok(settings) => settings,
            Err(error) => return self.reject(RequestRef::Id(id), &error).await,
        };
        let is_cancelled = self.begin_save(id);
        let (state, out, permit) = (self.state.clone(), self.out.clone(), self.save_permit.clone());
        tokio::spawn(async move {
            let render = move |provider: &dyn SceneProvider, progress: &dyn Progress| {
                let drawable = provider.drawable_settings(&settings, progress);
                provider.render_png(&drawable, progress)
            };
            let png = run_slowly(&state, &permit, id, is_cancelled.clone(), &out, render).await;
            let message = match png {
                Ok(png) => {
                    let bytes = frame::saved_message(id, (width as u16, height as u16), &png);
                    Outgoing::Binary(bytes, is_cancelled)
                }
                Err(error) => {
                    // Another save may begin as soon as the page has the error.
                    drop(is_cancelled);
                    Outgoing::Text(rejection(RequestRef::Id(id), &error).to_string())
                }
            };
            let _ = out.send(message).await;
        });
    }

    /// Writes the points that are shown.
    async fn points(&mut self, id: u32, format: String) {
        let size = self.client.view().size;
        self.write_file(id, size, FileKind::Points, move |provider, settings, progress| {
            provider.write_points(settings, &format, progress)
        })
        .await;
    }

    /// Writes the movie of the camera's path.
    async fn movie(&mut self, id: u32, size: (u32, u32), options: MovieRequest) {
        if let Err(error) = self.state.limits.check_save_size(size.0, size.1) {
            return self.reject(RequestRef::Id(id), &error).await;
        }
        self.write_file(id, size, FileKind::Movie, move |provider, settings, progress| {
            let drawable = provider.drawable_settings(settings, progress);
            provider.write_movie(&drawable, &options, progress)
        })
        .await;
    }

    /// Writes a file, which the page then fetches by its name. It replaces the page's file of the same kind.
    async fn write_file(
        &mut self,
        id: u32,
        size: (u32, u32),
        kind: FileKind,
        write: impl FnOnce(
            &dyn SceneProvider,
            &SettingsMap,
            &dyn Progress,
        ) -> Result<Arc<dyn WrittenFile>>
        + Send
        + 'static,
    ) {
        let settings = match self.settings_to_save(id, size) {
            Ok(settings) => settings,
            Err(error) => return self.reject(RequestRef::Id(id), &error).await,
        };
        let is_cancelled = self.begin_save(id);
        let (state, out) = (self.state.clone(), self.out.clone());
        let downloads = self.downloads.clone();
        let permit = self.save_permit.clone();
        tokio::spawn(async move {
            let write = move |provider: &dyn SceneProvider, progress: &dyn Progress| {
                write(provider, &settings, progress)
            };
            let written = run_slowly(&state, &permit, id, is_cancelled, &out, write).await;
            let kept = written.and_then(|file| Ok((state.downloads.add(file.clone())?, file)));
            let message = match kept {
                Ok((guard, file)) => {
                    let address = format!("downloads/{}", guard.name);
                    // The file of this kind before it goes.
                    lock(&downloads).insert(kind, guard);
                    let (name, count) = kind.words();
                    json!({ "type": name, "id": id, "address": address, count: file.n_items(), "n_bytes": file.n_bytes() })
                }
                Err(error) => rejection(RequestRef::Id(id), &error),
            };
            send_json(&out, &message).await;
        });
    }

    async fn export(&self, id: u32, (width, height): (u32, u32), measurements: Option<Value>) {
        let provider = self.state.provider.borrow().clone();
        let Some((mut settings, provider)) = self.settings(width, height).zip(provider) else {
            let error = Error::invalid_request("there is nothing to export yet");
            return self.reject(RequestRef::Id(id), &error).await;
        };
        if let Some(measurements) = measurements {
            settings.insert("measurements".into(), measurements);
        }
        let export = move |progress: &dyn Progress| {
            let export = provider.export(&settings, progress)?;
            Ok(json!({
                "type": "export",
                "id": id,
                "command": export.command,
                "toml": export.toml,
                "json": export.json,
                "movie": export.movie,
            }))
        };
        self.answer(id, export).await;
    }

    async fn load_scene(&self, id: u32, name: String, text: String) {
        let Some(provider) = self.state.provider.borrow().clone() else {
            let error = Error::invalid_request("the files are still being loaded");
            return self.reject(RequestRef::Id(id), &error).await;
        };
        let read = self.state.run_blocking(move || provider.read_scene_file(&name, &text)).await;
        match read.flatten() {
            Ok(patch) => {
                let (from_startup, is_moving, load_id) = (true, false, Some(id));
                let seq = self.last_seq;
                self.change(SettingsChange { patch, from_startup, seq, is_moving, load_id }).await;
            }
            Err(error) => self.reject(RequestRef::Id(id), &error).await,
        }
    }
}

fn cancel(is_cancelled: &Arc<AtomicBool>) {
    is_cancelled.store(true, Ordering::Relaxed);
}

/// Returns whether a saved picture is still being rendered or sent.
fn is_held(is_cancelled: &Arc<AtomicBool>) -> bool {
    1 < Arc::strong_count(is_cancelled)
}
