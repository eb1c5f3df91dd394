//! The first message of a page.

use crate::limits::Limits;
use crate::message::Incoming;
use crate::scene_provider::{Error, Result, SettingsMap};
use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt;
use futures_util::stream::SplitStream;
use tokio::time::timeout;

/// The picture size and the settings in a page's first message; none if the page goes away or sends nothing.
pub async fn handshake(
    stream: &mut SplitStream<WebSocket>,
    limits: &Limits,
) -> Option<Result<((u32, u32), SettingsMap)>> {
    let first = timeout(limits.timeouts.request, first_message(stream)).await.ok()??;
    let Message::Text(text) = first else {
        return Some(Err(Error::invalid_request("expected hello")));
    };
    Some(Incoming::parse(&text).and_then(|message| match message {
        Incoming::Hello { width, height, scene } => {
            limits.check_view_size(width, height).map(|()| ((width, height), scene))
        }
        _ => Err(Error::invalid_request("expected hello first")),
    }))
}

/// The first message that is not a ping or pong.
async fn first_message(stream: &mut SplitStream<WebSocket>) -> Option<Message> {
    loop {
        match stream.next().await?.ok()? {
            Message::Ping(_) | Message::Pong(_) => {}
            message => return Some(message),
        }
    }
}
