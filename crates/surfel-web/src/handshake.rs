//! The first message of a page.

use crate::limits::Limits;
use crate::message::Incoming;
use crate::scene_provider::{Error, Result, SettingsMap};
use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt;
use futures_util::stream::SplitStream;
use tokio::time::timeout;

/// The content of a page's first message.
pub struct Hello {
    /// Size of the picture in pixels.
    pub size: (u32, u32),
    /// A patch of the initial settings.
    pub patch: SettingsMap,
    /// Name of the data to which the patch belongs; none if it belongs to any.
    pub name: Option<String>,
}

/// A page's first message; none if the page goes away or sends nothing.
pub async fn handshake(
    stream: &mut SplitStream<WebSocket>,
    limits: &Limits,
) -> Option<Result<Hello>> {
    let first = timeout(limits.timeouts.request, first_message(stream)).await.ok()??;
    let Message::Text(text) = first else {
        return Some(Err(Error::invalid_request("expected hello")));
    };
    Some(Incoming::parse(&text).and_then(|message| match message {
        Incoming::Hello { width, height, scene, name } => {
            let hello = Hello { size: (width, height), patch: scene, name };
            limits.check_view_size(width, height).map(|()| hello)
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
