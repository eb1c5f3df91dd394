//! Messages to pages: the queue's items, and errors that answer requests.

use crate::scene_provider::Error;
use serde_json::{Value, json};
use std::any::Any;
use std::sync::Arc;
use tokio::sync::mpsc;

/// A message to a page.
#[derive(Debug)]
pub enum Outgoing {
    /// A JSON message.
    Text(String),
    /// A picture, and a value that is dropped once the picture is written to the connection.
    Binary(Vec<u8>, Arc<dyn Any + Send + Sync>),
}

/// The request that an error message answers.
#[derive(Clone, Copy, Debug)]
pub enum RequestRef {
    /// A message that carries no number.
    Unnumbered,
    /// A request with an id.
    Id(u32),
    /// A camera or settings change with a sequence number.
    Seq(u32),
}

/// Queues a message; waits while the queue is full.
pub async fn send_json(out: &mpsc::Sender<Outgoing>, message: &Value) {
    let _ = out.send(Outgoing::Text(message.to_string())).await;
}

/// The error message that answers a request.
pub fn rejection(request: RequestRef, error: &Error) -> Value {
    let mut message = json!({ "type": "error" });
    match request {
        RequestRef::Unnumbered => {}
        RequestRef::Id(id) => message["id"] = json!(id),
        RequestRef::Seq(seq) => message["seq"] = json!(seq),
    }
    match error {
        Error::InvalidRequest { key: Some(key), text } => {
            message["key"] = json!(key);
            message["text"] = json!(text);
        }
        error => message["text"] = json!(error.to_string()),
    }
    message
}
