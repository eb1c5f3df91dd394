//! Long work for a page, with progress and cancellation.

use crate::outgoing::Outgoing;
use crate::progress_reporter::{ProgressReporter, ProgressUpdate};
use crate::scene_provider::{Error, Result, SceneProvider};
use crate::server_state::ServerState;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use surfel_core::progress::Progress;
use tokio::sync::{Semaphore, mpsc};

/// Time between two looks at whether a page has cancelled what it waits for.
pub const CANCEL_POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Does long work for a page once a permit is free, and reports its progress to the page. `page_permit` has the page's
/// one permit, which is taken first: a page does one long work after the other, and leaves room for other pages.
///
/// # Errors
///
/// Fails as the work does, and if it is cancelled.
pub async fn run_slowly<T: Send + 'static>(
    state: &Arc<ServerState>,
    page_permit: &Semaphore,
    id: u32,
    is_cancelled: Arc<AtomicBool>,
    out: &mpsc::Sender<Outgoing>,
    work: impl FnOnce(&dyn SceneProvider, &dyn Progress) -> Result<T> + Send + 'static,
) -> Result<T> {
    let permits = async { (page_permit.acquire().await, state.render_permits.acquire().await) };
    let _permits = tokio::select! {
        permits = permits => permits,
        () = cancelled(state, &is_cancelled, out) => return Err(Error::Cancelled),
    };
    run_at_once(state, id, is_cancelled, out, work).await
}

/// Does work for a page, and reports its progress to the page.
///
/// # Errors
///
/// Fails as the work does, and if it is cancelled.
pub async fn run_at_once<T: Send + 'static>(
    state: &Arc<ServerState>,
    id: u32,
    is_cancelled: Arc<AtomicBool>,
    out: &mpsc::Sender<Outgoing>,
    work: impl FnOnce(&dyn SceneProvider, &dyn Progress) -> Result<T> + Send + 'static,
) -> Result<T> {
    let provider = state.provider().await;
    let (page, for_cancel, queue) = (out.clone(), state.clone(), out.clone());
    let report = move |update: ProgressUpdate| {
        let ProgressUpdate { done, left_secs, .. } = update;
        let message = json!({ "type": "progress", "id": id, "done": done, "left_secs": left_secs });
        // Dropped if the queue is full.
        let _ = queue.try_send(Outgoing::Text(message.to_string()));
    };
    let is_cancelled =
        move || is_cancelled.load(Ordering::Relaxed) || for_cancel.is_stopped() || page.is_closed();
    let reporter = ProgressReporter::new(report, is_cancelled);
    state.run_blocking(move || work(&*provider, &reporter)).await?
}

/// Waits until work that has not begun is cancelled, its page has gone, or the server stops.
async fn cancelled(state: &ServerState, is_cancelled: &AtomicBool, page: &mpsc::Sender<Outgoing>) {
    while !(is_cancelled.load(Ordering::Relaxed) || page.is_closed() || state.is_stopped()) {
        tokio::time::sleep(CANCEL_POLL_INTERVAL).await;
    }
}
