//! The server's HTTP routes: the page, its WebSocket, and pictures and facts for programs.

use crate::access::{AccessDenied, TokenExchange};
use crate::added_files::UploadError;
use crate::connections::ConnectionEntry;
use crate::downloads;
use crate::merge_patch::apply_merge_patch;
use crate::page;
use crate::scene_provider::{Error, SceneProvider, SettingsMap};
use crate::server_state::ServerState;
use crate::session;
use axum::body::{Body, to_bytes};
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Extension, Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state, map_response};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get, post};
use axum::{Json, Router};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use surfel_core::progress::Progress;

/// All routes. Each checks host and origin; all but the page's files and `/healthz` need the token, too. Requests have
/// the entry of their connection as an extension.
pub fn router(state: Arc<ServerState>) -> Router {
    let guarded = Router::new()
        .route("/ws", any(socket))
        .route("/scene", get(scene))
        .route("/stats", get(stats))
        .route("/downloads/{name}", get(download))
        .route("/files/{name}", post(added_file))
        .route("/render", get(render_query).post(render_body))
        .route_layer(from_fn_with_state(state.clone(), check_token));
    Router::new()
        .route("/", get(page))
        .route("/{file}", get(page_file))
        .route("/healthz", get(health))
        .merge(guarded)
        .fallback(no_page)
        .method_not_allowed_fallback(wrong_method)
        .layer(from_fn_with_state(state.clone(), check_origin))
        .layer(map_response(with_common_headers))
        .with_state(state)
}

/// A response that gives the reason of a failure as JSON.
struct Failure(StatusCode, String);

impl IntoResponse for Failure {
    fn into_response(self) -> Response {
        (self.0, Json(json!({ "error": self.1 }))).into_response()
    }
}

impl From<AccessDenied> for Failure {
    fn from(denied: AccessDenied) -> Self {
        let status = match denied {
            AccessDenied::Token => StatusCode::UNAUTHORIZED,
            AccessDenied::Host | AccessDenied::Origin => StatusCode::FORBIDDEN,
        };
        Self(status, denied.message().into())
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::InvalidRequest { .. } => StatusCode::BAD_REQUEST,
            Error::Cancelled => StatusCode::SERVICE_UNAVAILABLE,
            Error::Failed(_) | Error::Panicked | Error::Io { .. } => {
                StatusCode::INTERNAL_SERVER_ERROR
            }
        };
        Self(status, error.to_string())
    }
}

impl From<PathRejection> for Failure {
    fn from(rejection: PathRejection) -> Self {
        Self(rejection.status(), rejection.body_text())
    }
}

impl From<QueryRejection> for Failure {
    fn from(rejection: QueryRejection) -> Self {
        Self(rejection.status(), rejection.body_text())
    }
}

type RouteResult = Result<Response, Failure>;

async fn with_common_headers(mut response: Response) -> Response {
    response.headers_mut().extend(page::COMMON_HEADERS);
    response
}

/// Checks the origin of a request, and keeps the connection of one that has the token.
async fn check_origin(
    State(state): State<Arc<ServerState>>,
    Extension(connection): Extension<Arc<ConnectionEntry>>,
    request: Request,
    next: Next,
) -> RouteResult {
    state.guard.check_origin(&request)?;
    if state.guard.check_token(&request).is_ok() && !connection.authorize() {
        let text = "too many connections; close another one or try again later";
        return Err(Failure(StatusCode::SERVICE_UNAVAILABLE, text.into()));
    }
    Ok(next.run(request).await)
}

async fn check_token(
    State(state): State<Arc<ServerState>>,
    request: Request,
    next: Next,
) -> RouteResult {
    state.guard.check_token(&request)?;
    Ok(next.run(request).await)
}

/// The page. A link with the token leads to it by a cookie, and leaves the rest of the address as it is.
async fn page(State(state): State<Arc<ServerState>>, request: Request) -> RouteResult {
    Ok(match state.guard.exchange_token(&request)? {
        Some(TokenExchange { location, cookie }) => {
            let headers = [
                (header::LOCATION, location),
                (header::SET_COOKIE, cookie),
                (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
            ];
            (StatusCode::SEE_OTHER, headers).into_response()
        }
        None => page_response(&state, "", request.headers())?,
    })
}

async fn page_file(
    State(state): State<Arc<ServerState>>,
    name: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
) -> RouteResult {
    let Path(name) = name?;
    page_response(&state, &name, &headers)
}

fn page_response(state: &ServerState, name: &str, headers: &HeaderMap) -> RouteResult {
    page::file(name, headers, &state.guard.frame_ancestors).ok_or_else(missing_page)
}

async fn no_page() -> Failure {
    missing_page()
}

fn missing_page() -> Failure {
    Failure(StatusCode::NOT_FOUND, "no such page; the viewer is at /".into())
}

async fn wrong_method(method: Method) -> Failure {
    Failure(StatusCode::METHOD_NOT_ALLOWED, format!("{method} is not answered at this address"))
}

/// The connection of a page. A request without an upgrade learns whether a page could connect, since browsers do not
/// show pages the answer to one with an upgrade.
async fn socket(
    State(state): State<Arc<ServerState>>,
    Extension(connection): Extension<Arc<ConnectionEntry>>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> RouteResult {
    let Ok(permit) = state.page_permits.clone().try_acquire_owned() else {
        let text = "too many pages are open; close another one or try again later";
        return Err(Failure(StatusCode::SERVICE_UNAVAILABLE, text.into()));
    };
    let Ok(upgrade) = upgrade else { return Ok(StatusCode::NO_CONTENT.into_response()) };
    let max_bytes = state.limits.max_message_bytes;
    let upgrade = upgrade.max_message_size(max_bytes).max_frame_size(max_bytes);
    Ok(upgrade.on_upgrade(async move |socket| {
        session::run(socket, state).await;
        drop((permit, connection));
    }))
}

async fn health(State(state): State<Arc<ServerState>>) -> Response {
    let is_ready = state.provider.borrow().is_some();
    Json(json!({ "status": if is_ready { "ready" } else { "loading" } })).into_response()
}

fn loaded_provider(state: &ServerState) -> Result<Arc<dyn SceneProvider>, Failure> {
    state.provider.borrow().clone().ok_or_else(|| {
        Failure(StatusCode::SERVICE_UNAVAILABLE, "the files are still being loaded".into())
    })
}

/// The picture size for which `/scene` makes automatic choices.
const DEFAULT_SIZE: (u32, u32) = (1920, 1080);

async fn scene(State(state): State<Arc<ServerState>>) -> RouteResult {
    let (width, height) = DEFAULT_SIZE;
    let provider = loaded_provider(&state)?;
    let settings = state.run_blocking(move || provider.initial_settings(width, height)).await?;
    Ok(Json(settings).into_response())
}

async fn stats(State(state): State<Arc<ServerState>>) -> RouteResult {
    let info = state.provider.borrow().as_ref().map(|provider| state.info(&**provider));
    Ok(Json(json!({
        "clients": state.render_loop.n_clients(),
        "uptime_secs": state.start.elapsed().as_secs_f64(),
        "pictures": state.n_pictures.load(Ordering::Relaxed),
        "info": info,
    }))
    .into_response())
}

/// A file of points or a movie that a page has requested.
async fn download(
    State(state): State<Arc<ServerState>>,
    name: Result<Path<String>, PathRejection>,
) -> RouteResult {
    let Path(name) = name?;
    let missing = || Failure(StatusCode::NOT_FOUND, "there is no such file any more".into());
    let file = state.downloads.get(&name).ok_or_else(missing)?;
    let body = downloads::body(&file).map_err(|_| missing())?;
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static("application/octet-stream")),
        (header::CONTENT_DISPOSITION, HeaderValue::from_static("attachment")),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
        (header::CONTENT_LENGTH, HeaderValue::from(file.n_bytes())),
    ];
    Ok((headers, body).into_response())
}

/// The bytes of a file that a page has announced.
async fn added_file(
    State(state): State<Arc<ServerState>>,
    name: Result<Path<String>, PathRejection>,
    body: Body,
) -> RouteResult {
    let Path(name) = name?;
    let patience = state.limits.timeouts.request;
    let taken = state.uploads.take(&name, body, patience).await;
    let (status, text) = match taken {
        Ok(()) => return Ok(StatusCode::NO_CONTENT.into_response()),
        Err(UploadError::Unexpected) => (StatusCode::NOT_FOUND, "this file is not expected"),
        Err(UploadError::TooLarge) => {
            (StatusCode::PAYLOAD_TOO_LARGE, "body: is larger than announced")
        }
        Err(UploadError::TooSmall) => (StatusCode::BAD_REQUEST, "body: is smaller than announced"),
        Err(UploadError::TooSlow) => (StatusCode::REQUEST_TIMEOUT, "body: did not arrive in time"),
    };
    Err(Failure(status, text.into()))
}

/// Renders with settings from the query, as on a command line: `?resolution=640x480&camera-azimuth-angle=30`.
async fn render_query(
    State(state): State<Arc<ServerState>>,
    pairs: Result<Query<Vec<(String, String)>>, QueryRejection>,
) -> RouteResult {
    let Query(pairs) = pairs?;
    let pairs = pairs.into_iter().filter(|(key, _)| key != "token");
    render(state, pairs.map(|(key, value)| (key, Value::String(value))).collect()).await
}

/// Renders with settings from a JSON body, as in a scene file.
async fn render_body(State(state): State<Arc<ServerState>>, body: Body) -> RouteResult {
    let max_bytes = state.limits.max_message_bytes;
    let bytes = tokio::time::timeout(state.limits.timeouts.request, to_bytes(body, max_bytes));
    let bytes = match bytes.await {
        Ok(Ok(bytes)) => bytes,
        Ok(Err(_)) => {
            let text = format!("body: expected at most {max_bytes} bytes");
            return Err(Failure(StatusCode::PAYLOAD_TOO_LARGE, text));
        }
        Err(_) => {
            let text = "body: did not arrive in time".into();
            return Err(Failure(StatusCode::REQUEST_TIMEOUT, text));
        }
    };
    let patch = serde_json::from_slice(&bytes)
        .map_err(|error| Failure(StatusCode::BAD_REQUEST, format!("body: {error}")))?;
    render(state, patch).await
}

async fn render(state: Arc<ServerState>, patch: SettingsMap) -> RouteResult {
    let provider = loaded_provider(&state)?;
    // Dropped, with this future, when the client disconnects.
    let cancel_on_drop = CancelOnDrop(Arc::default());
    let Ok(permit) = state.render_permits.clone().try_acquire_owned() else {
        let text = "too many pictures are being rendered; try again later";
        return Err(Failure(StatusCode::TOO_MANY_REQUESTS, text.into()));
    };
    let progress = RequestProgress { state: state.clone(), is_gone: cancel_on_drop.0.clone() };
    let png = state.run_blocking(move || {
        let _permit = permit;
        let mut settings = provider.startup_settings();
        apply_merge_patch(&mut settings, &patch);
        provider.render_png(&settings, &progress)
    });
    let png = png.await??;
    state.n_pictures.fetch_add(1, Ordering::Relaxed);
    Ok(([(header::CONTENT_TYPE, "image/png")], png).into_response())
}

/// Sets a flag when dropped.
struct CancelOnDrop(Arc<AtomicBool>);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Cancels a request's work when its client disconnects or the server stops.
struct RequestProgress {
    state: Arc<ServerState>,
    is_gone: Arc<AtomicBool>,
}

impl Progress for RequestProgress {
    fn is_cancelled(&self) -> bool {
        self.is_gone.load(Ordering::Relaxed) || self.state.is_stopped()
    }
}
