//! What the server answers: the page, the socket, and pictures for programs.

use crate::guard::Refusal;
use crate::hall::Hall;
use crate::limits::{MOST_BYTES, PATIENCE};
use crate::page;
use crate::session;
use crate::studio::{Error, Keys, Studio, merge};
use axum::body::{Body, to_bytes};
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, Query, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use axum::{Json, Router};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use surfel::progress::Progress;

pub fn router(hall: Arc<Hall>) -> Router {
    let guarded = Router::new()
        .route("/ws", any(socket))
        .route("/scene", get(scene))
        .route("/stats", get(stats))
        .route("/render", get(render_query).post(render_body))
        .route_layer(from_fn_with_state(hall.clone(), with_token));
    Router::new()
        .route("/", get(|| async { page::file("") }))
        .route("/{file}", get(|Path(file): Path<String>| async move { page::file(&file) }))
        .route("/healthz", get(health))
        .merge(guarded)
        .layer(from_fn_with_state(hall.clone(), from_here))
        .with_state(hall)
}

/// An answer that says why there is no other.
struct Failure(StatusCode, String);

impl IntoResponse for Failure {
    fn into_response(self) -> Response {
        (self.0, Json(json!({ "error": self.1 }))).into_response()
    }
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        let status = match refusal {
            Refusal::Token => StatusCode::UNAUTHORIZED,
            Refusal::Host | Refusal::Origin => StatusCode::FORBIDDEN,
        };
        Self(status, refusal.text().into())
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self(StatusCode::BAD_REQUEST, error.to_string())
    }
}

type Answer = Result<Response, Failure>;

async fn from_here(State(hall): State<Arc<Hall>>, request: Request, next: Next) -> Answer {
    hall.guard.check(request.headers())?;
    Ok(next.run(request).await)
}

async fn with_token(State(hall): State<Arc<Hall>>, request: Request, next: Next) -> Answer {
    hall.guard.check_token(request.headers(), request.uri())?;
    Ok(next.run(request).await)
}

async fn socket(State(hall): State<Arc<Hall>>, upgrade: WebSocketUpgrade) -> Answer {
    let Ok(place) = hall.places.clone().try_acquire_owned() else {
        let text = "all places are taken; close another page or try again later";
        return Err(Failure(StatusCode::SERVICE_UNAVAILABLE, text.into()));
    };
    let upgrade = upgrade.max_message_size(MOST_BYTES).max_frame_size(MOST_BYTES);
    Ok(upgrade.on_upgrade(async move |socket| {
        session::run(socket, hall).await;
        drop(place);
    }))
}

async fn health(State(hall): State<Arc<Hall>>) -> Response {
    let is_ready = hall.studio.borrow().is_some();
    Json(json!({ "status": if is_ready { "ready" } else { "loading" } })).into_response()
}

fn ready(hall: &Hall) -> Result<Arc<dyn Studio>, Failure> {
    hall.studio.borrow().clone().ok_or_else(|| {
        Failure(StatusCode::SERVICE_UNAVAILABLE, "the files are still being loaded".into())
    })
}

/// Size of a picture where none is said.
const USUAL_SIZE: (u32, u32) = (1920, 1080);

async fn scene(State(hall): State<Arc<Hall>>) -> Answer {
    let (width, height) = USUAL_SIZE;
    Ok(Json(ready(&hall)?.opening(width, height)).into_response())
}

async fn stats(State(hall): State<Arc<Hall>>) -> Answer {
    let info = hall.studio.borrow().as_ref().map(|studio| studio.info());
    Ok(Json(json!({
        "clients": hall.easel.n_clients(),
        "uptime_secs": hall.start.elapsed().as_secs_f64(),
        "pictures": hall.n_pictures.load(Ordering::Relaxed),
        "info": info,
    }))
    .into_response())
}

/// Keys in the address, as they are typed on a command line: `?resolution=640x480&camera-azimuth-angle=30`.
async fn render_query(
    State(hall): State<Arc<Hall>>,
    Query(pairs): Query<Vec<(String, String)>>,
) -> Answer {
    let pairs = pairs.into_iter().filter(|(key, _)| key != "token");
    render(hall, pairs.map(|(key, value)| (key, Value::String(value))).collect()).await
}

/// Keys as JSON, as in a scene file.
async fn render_body(State(hall): State<Arc<Hall>>, body: Body) -> Answer {
    let bytes = tokio::time::timeout(PATIENCE, to_bytes(body, MOST_BYTES)).await;
    let bytes = match bytes {
        Ok(Ok(bytes)) => bytes,
        Ok(Err(_)) => {
            let text = format!("body: expected at most {MOST_BYTES} bytes");
            return Err(Failure(StatusCode::PAYLOAD_TOO_LARGE, text));
        }
        Err(_) => return Err(Failure(StatusCode::REQUEST_TIMEOUT, "body: came too slowly".into())),
    };
    let keys = serde_json::from_slice(&bytes)
        .map_err(|error| Failure(StatusCode::BAD_REQUEST, format!("body: {error}")))?;
    render(hall, keys).await
}

async fn render(hall: Arc<Hall>, keys: Keys) -> Answer {
    let studio = ready(&hall)?;
    // Ends the work when the one who asked goes away.
    let going = Going(Arc::default());
    let Ok(turn) = hall.saves.clone().try_acquire_owned() else {
        let text = "enough pictures are being made; try again in a while";
        return Err(Failure(StatusCode::TOO_MANY_REQUESTS, text.into()));
    };
    let until = Until { hall: hall.clone(), is_gone: going.0.clone() };
    let picture = hall.work(move || {
        let _turn = turn;
        let mut settings = studio.given();
        merge(&mut settings, &keys);
        studio.picture(&settings, &until)
    });
    let png = picture.await??;
    hall.n_pictures.fetch_add(1, Ordering::Relaxed);
    Ok(([(header::CONTENT_TYPE, "image/png")], png).into_response())
}

struct Going(Arc<AtomicBool>);

impl Drop for Going {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

struct Until {
    hall: Arc<Hall>,
    is_gone: Arc<AtomicBool>,
}

impl Progress for Until {
    fn is_cancelled(&self) -> bool {
        self.is_gone.load(Ordering::Relaxed) || self.hall.is_stopped()
    }
}
