//! Messages to pages: the queue's items, and errors that answer requests.

use crate::scene_provider::Error;
use axum::extract::ws::{Message, WebSocket};
use futures_util::SinkExt;
use futures_util::stream::SplitSink;
use serde_json::{Value, json};
use std::any::Any;
use std::sync::Arc;
use std::time::Duration;
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

impl RequestRef {
    /// The request that a page's message makes, as far as it can be read.
    pub fn of(message: &Message) -> Self {
        let text = message.to_text().unwrap_or_default();
        let message: Value = serde_json::from_str(text).unwrap_or_default();
        let number = |key: &str| message[key].as_u64().and_then(|found| found.try_into().ok());
        match (number("id"), number("seq")) {
            (Some(id), _) => Self::Id(id),
            (None, Some(seq)) => Self::Seq(seq),
            (None, None) => Self::Unnumbered,
        }
    }
}

/// Sends what is queued. Ends if the connection's write timeout passes, or once all senders are gone.
pub async fn write(
    mut sink: SplitSink<WebSocket, Message>,
    mut queue: mpsc::Receiver<Outgoing>,
    ping_interval: Duration,
) {
    let mut pings = tokio::time::interval(ping_interval);
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
