//! Adds a file to a page's view: makes room for it, receives its bytes, and has them read.

use crate::added_files::{PageFiles, UploadGuard};
use crate::long_work::{CANCEL_POLL_INTERVAL, run_at_once};
use crate::outgoing::{Outgoing, send_json};
use crate::scene_provider::{Error, Result, SceneProvider, SentFile};
use crate::server_state::ServerState;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use surfel_core::progress::Progress;
use tokio::sync::mpsc;
use tokio::time::timeout;

/// A file that a page is about to send.
pub struct Announcement {
    /// Id of the request.
    pub id: u32,
    /// Name of the file.
    pub name: String,
    /// Size of the file in bytes.
    pub n_bytes: u64,
}

/// Receives and reads a file; returns the message about it.
///
/// # Errors
///
/// Fails for files beyond the limits, for those that do not arrive, as reading does, and if cancelled.
pub async fn run(
    state: &Arc<ServerState>,
    announced: Announcement,
    files: &PageFiles,
    is_cancelled: Arc<AtomicBool>,
    out: &mpsc::Sender<Outgoing>,
) -> Result<Value> {
    let Announcement { id, name, n_bytes } = announced;
    let max_files = state.limits.max_page_files;
    files.names_if_below(max_files)?;
    let mut reservation = state.uploads.reserve(&name, n_bytes)?;
    let upload = state.uploads.expect(n_bytes)?;
    let file_id = upload.name.clone();
    let address = format!("files/{file_id}");
    send_json(out, &json!({ "type": "upload", "id": id, "address": address })).await;
    let bytes = received(state, upload, &is_cancelled, out).await?;
    let bytes =
        bytes.ok_or_else(|| Error::invalid_request(format!("{name} did not arrive whole")))?;
    // One file is read at a time, so that it gets a name that no other one has.
    let _turn = files.turn.lock().await;
    let taken = files.names_if_below(max_files)?;
    let (sent_id, sent_name) = (file_id.clone(), name.clone());
    let max_bytes = state.limits.max_added_file_bytes;
    let read = move |provider: &dyn SceneProvider, progress: &dyn Progress| {
        let (id, name, bytes, taken) = (&sent_id[..], &sent_name[..], &bytes[..], &taken[..]);
        let file = SentFile { id, name, bytes, taken, max_bytes };
        // While a file is read there are its bytes and its content.
        reservation.add_content(name, provider.stated_bytes(&file)?)?;
        Ok((provider.read_added_file(&file, progress)?, reservation))
    };
    let (file, mut reservation) = run_at_once(state, id, is_cancelled, out, read).await?;
    reservation.resize(&name, file.n_bytes())?;
    let mut message = json!({ "type": "added", "id": id, "file": file.description() });
    message["file"]["id"] = json!(file_id);
    files.keep(file, reservation);
    Ok(message)
}

/// The bytes of an upload; none if they do not arrive, or do not begin to in time.
async fn received(
    state: &ServerState,
    mut upload: UploadGuard,
    is_cancelled: &AtomicBool,
    out: &mpsc::Sender<Outgoing>,
) -> Result<Option<Vec<u8>>> {
    let start = Instant::now();
    loop {
        if state.limits.timeouts.request < start.elapsed() && upload.is_awaited() {
            return Ok(None);
        }
        if is_cancelled.load(Ordering::Relaxed) || out.is_closed() || state.is_stopped() {
            return Err(Error::Cancelled);
        }
        if let Ok(received) = timeout(CANCEL_POLL_INTERVAL, &mut upload.receiver).await {
            return Ok(received.ok());
        }
    }
}
