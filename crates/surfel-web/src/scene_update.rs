//! Applies a page's settings changes: prepares one scene at a time, from all changes that wait.

use crate::client::Client;
use crate::handshake::Hello;
use crate::merge_patch::apply_merge_patch;
use crate::outgoing::{Outgoing, RequestRef, rejection, send_json};
use crate::pending_changes::{PendingChanges, SettingsChange};
use crate::progress_reporter::{ProgressReporter, ProgressUpdate};
use crate::scene_provider::{Error, PreparedScene, SceneProvider, SettingsMap};
use crate::server_state::ServerState;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};
use surfel_core::progress::Progress;
use tokio::sync::mpsc;

/// Prepares scenes for a page until it has gone, the server stops, or the task is aborted.
pub async fn run(
    state: Arc<ServerState>,
    client: Arc<Client>,
    pending: Arc<PendingChanges>,
    out: mpsc::Sender<Outgoing>,
    hello: Hello,
) {
    let Some(provider) = wait_for_provider(&state, &out).await else { return };
    let (width, height) = client.view().size;
    let (for_facts, of_scene) = (state.clone(), provider.clone());
    let facts = move || (of_scene.initial_settings(width, height), for_facts.info(&*of_scene));
    let (settings, info) = match state.run_blocking(facts).await {
        Ok(found) => found,
        Err(error) => return send_json(&out, &rejection(RequestRef::Unnumbered, &error)).await,
    };
    // A server that was started again may show other data than those of the page's patch.
    let is_for_these = hello.name.is_none_or(|name| info["name"] == name);
    let patch = if is_for_these { hello.patch } else { SettingsMap::default() };
    pending.requeue(SettingsChange { patch, ..SettingsChange::default() });
    let welcome = json!({ "type": "welcome", "scene": settings, "info": info });
    send_json(&out, &welcome).await;
    let (shows_preview, stale_after) = (false, state.limits.timeouts.stale_update);
    let mut updater = SceneUpdater {
        state,
        client,
        pending,
        out,
        provider,
        settings,
        shows_preview,
        stale_after,
    };
    // Nothing would be prepared any more: the change would be cancelled and taken again without end.
    while !updater.out.is_closed() && !updater.state.is_stopped() {
        let mut change = updater.pending.take().await;
        updater.show_preview(&mut change).await;
        updater.apply(change).await;
    }
}

/// Waits until the files are loaded, and reports the progress of loading to the page.
async fn wait_for_provider(
    state: &ServerState,
    out: &mpsc::Sender<Outgoing>,
) -> Option<Arc<dyn SceneProvider>> {
    let mut loading = state.loading.subscribe();
    loading.mark_changed();
    loop {
        tokio::select! {
            provider = state.provider() => return Some(provider),
            changed = loading.changed() => {
                changed.ok()?;
                let update = loading.borrow_and_update().clone();
                send_json(out, &progress_message(update.as_ref())).await;
            }
        }
    }
}

/// The message about long work under way; none means that it has ended.
fn progress_message(update: Option<&ProgressUpdate>) -> Value {
    json!({
        "type": "state",
        "text": update.map(|update| &update.stage),
        "done": update.and_then(|update| update.done),
        "left_secs": update.and_then(|update| update.left_secs),
    })
}

struct SceneUpdater {
    state: Arc<ServerState>,
    client: Arc<Client>,
    pending: Arc<PendingChanges>,
    out: mpsc::Sender<Outgoing>,
    provider: Arc<dyn SceneProvider>,
    /// The settings of the last whole scene.
    settings: SettingsMap,
    /// True if the page shows a preview of later settings.
    shows_preview: bool,
    /// Duration after which a preparation is cancelled if newer settings wait.
    stale_after: Duration,
}

/// Ratio of the time that a preparation may take to that of the one before it.
const STALE_FACTOR: f64 = 1.5;

impl SceneUpdater {
    /// Shows a subset of the points before the whole scene is prepared, if that takes long.
    async fn show_preview(&mut self, change: &mut SettingsChange) {
        let (provider, settings) = (self.provider.clone(), self.settings_with(change));
        let reporter = self.reporter();
        let task = move || provider.preview(&settings, &reporter);
        if let Ok(Some(Ok(scene))) = self.state.run_blocking(task).await {
            self.show(scene, change).await;
            self.shows_preview = true;
            change.load_id = None;
        }
    }

    /// Replaces a preview of settings that were rejected by the last whole scene.
    async fn take_back_preview(&mut self, change: &SettingsChange) {
        let kept = SettingsChange { seq: change.seq, ..SettingsChange::default() };
        let (provider, settings) = (self.provider.clone(), self.settings_with(&kept));
        let reporter = self.reporter();
        let task = move || provider.prepare(&settings, &reporter);
        if let Ok(Ok(scene)) = self.state.run_blocking(task).await {
            self.shows_preview = false;
            self.show(scene, &kept).await;
        }
    }

    /// Prepares and shows the scene with this change, or reports the reason why it cannot.
    async fn apply(&mut self, change: SettingsChange) {
        let (provider, settings) = (self.provider.clone(), self.settings_with(&change));
        let (reporter, start) = (self.reporter(), Instant::now());
        let prepared =
            self.state.run_blocking(move || provider.prepare(&settings, &reporter)).await;
        match prepared.flatten() {
            Ok(scene) => {
                // While settings keep coming, those that take as long are prepared to their end.
                self.stale_after = start.elapsed().mul_f64(STALE_FACTOR).max(self.stale_update());
                self.settings = scene.settings.clone();
                self.shows_preview = false;
                self.show(scene, &change).await;
            }
            Err(Error::Cancelled) => {
                // Work that was cancelled again and again would show nothing.
                self.stale_after *= 2;
                self.pending.requeue(change);
            }
            Err(error) => {
                if self.shows_preview {
                    self.take_back_preview(&change).await;
                }
                let mut message = rejection(RequestRef::Seq(change.seq), &error);
                if let Some(id) = change.load_id {
                    message["id"] = json!(id);
                }
                send_json(&self.out, &message).await;
                self.client.set_moving(change.is_moving);
                // A page whose first settings are invalid shows the initial scene.
                if self.client.view().scene.is_none() && !change.patch.is_empty() {
                    let initial = SettingsChange { seq: change.seq, ..SettingsChange::default() };
                    self.pending.requeue(initial);
                }
            }
        }
        send_json(&self.out, &progress_message(None)).await;
    }

    fn settings_with(&self, change: &SettingsChange) -> SettingsMap {
        let mut settings = if change.from_startup {
            self.provider.startup_settings()
        } else {
            self.settings.clone()
        };
        let camera_settings = self.client.view().camera_settings;
        if !change.from_startup && !camera_settings.is_null() {
            settings.insert("camera".into(), camera_settings);
        }
        apply_merge_patch(&mut settings, &change.patch);
        settings
    }

    async fn show(&self, scene: PreparedScene, change: &SettingsChange) {
        let camera_settings = scene.settings.get("camera").cloned().unwrap_or_default();
        let shown_camera = scene.animated_camera.as_ref().unwrap_or(&camera_settings);
        // Pictures of the previous scene may still be on their way; the number tells them apart.
        let scene_number = self.client.view().scene_number.wrapping_add(1);
        let mut message = json!({
            "type": "scene",
            "number": scene_number,
            "seq": change.seq,
            "scene": scene.settings,
            "camera": shown_camera,
            "legend": scene.legend,
        });
        if let Some(id) = change.load_id {
            message["id"] = json!(id);
        }
        // The page must know the settings before it gets the first picture of them.
        send_json(&self.out, &message).await;
        let sets_camera = scene.animated_camera.is_some()
            || change.from_startup
            || change.patch.contains_key("camera");
        // A preview whose camera is still to be chosen has none that the page knows.
        let camera = (!shown_camera.is_null()).then_some(scene.flat.camera);
        let scene = Arc::new(scene);
        self.client.update_view(|view| {
            // The user may have moved the camera while the scene was prepared.
            let is_newest = sets_camera && view.seq <= change.seq;
            if view.camera.is_none() || is_newest {
                (view.camera, view.camera_settings) = (camera, camera_settings);
            }
            (view.scene, view.scene_number) = (Some(scene), scene_number);
            view.seq = view.seq.max(change.seq);
            view.is_moving = change.is_moving;
        });
        self.state.render_loop.notify();
    }

    fn stale_update(&self) -> Duration {
        self.state.limits.timeouts.stale_update
    }

    /// Reports progress to the page. Cancels work once newer settings have waited long enough, or once nobody
    /// waits for the result any more.
    fn reporter(&self) -> impl Progress + Send + 'static {
        let (queue, page) = (self.out.clone(), self.out.clone());
        let (state, pending, start) = (self.state.clone(), self.pending.clone(), Instant::now());
        let report = move |update: ProgressUpdate| {
            // Dropped if the queue is full.
            let _ = queue.try_send(Outgoing::Text(progress_message(Some(&update)).to_string()));
        };
        let stale_after = self.stale_after;
        let is_cancelled = move || {
            let is_stale = stale_after < start.elapsed() && !pending.is_empty();
            is_stale || state.is_stopped() || page.is_closed()
        };
        ProgressReporter::new(report, is_cancelled)
    }
}
