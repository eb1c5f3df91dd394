//! Questions of a page: each is answered by a task of its own.

use super::Session;
use crate::outgoing::{RequestRef, rejection, send_json};
use crate::pick;
use crate::profile;
use crate::progress_reporter::ProgressReporter;
use crate::scene_provider::{Error, PreparedScene, Result};
use crate::visibility::visibility;
use crate::volume;
use serde_json::{Value, json};
use std::sync::Arc;
use surfel_core::flat::{ProfileLine, VolumeQuery};
use surfel_core::progress::Progress;

impl Session {
    pub(super) async fn pick(&self, id: u32, pixel: (f64, f64)) {
        // The pixel is one of this view, whatever camera follows.
        let (view, renderer) = (self.client.view(), self.state.renderer.clone());
        let pick = move |progress: &dyn Progress| {
            let picked = pick::pick(&*renderer, &view, pixel, progress)?;
            let point = picked.map(|(scene, point)| (scene.describe)(&scene.flat, &point));
            Ok(json!({ "type": "pick", "id": id, "point": point }))
        };
        self.answer(id, pick).await;
    }

    pub(super) async fn visible(&self, id: u32, points: Vec<[f64; 3]>) {
        let view = self.client.view();
        let find = move |_: &dyn Progress| {
            let visible = visibility(&view, &points)?;
            Ok(json!({ "type": "visible", "id": id, "visible": visible }))
        };
        self.answer(id, find).await;
    }

    pub(super) async fn profile(&self, id: u32, line: Result<ProfileLine>) {
        let (line, scene) = match line.and_then(|line| Ok((line, self.scene()?))) {
            Ok(found) => found,
            Err(error) => return self.reject(RequestRef::Id(id), &error).await,
        };
        let find = move |progress: &dyn Progress| {
            let profile = profile::profile(&scene, &line, progress)?;
            Ok(json!({ "type": "profile", "id": id, "profile": profile }))
        };
        self.answer(id, find).await;
    }

    pub(super) async fn volume(&self, id: u32, query: Result<VolumeQuery>) {
        let (query, scene) = match query.and_then(|query| Ok((query, self.scene()?))) {
            Ok(found) => found,
            Err(error) => return self.reject(RequestRef::Id(id), &error).await,
        };
        let find = move |progress: &dyn Progress| {
            let volume = volume::volume(&scene, &query, progress)?;
            Ok(json!({ "type": "volume", "id": id, "volume": volume }))
        };
        self.answer(id, find).await;
    }

    pub(super) async fn histogram(&self, id: u32, column: String) {
        let Some(provider) = self.state.provider.borrow().clone() else {
            let error = Error::invalid_request("the files are still being loaded");
            return self.reject(RequestRef::Id(id), &error).await;
        };
        let find = move |_: &dyn Progress| {
            let histogram = provider.histogram(&column)?;
            Ok(json!({ "type": "histogram", "id": id, "histogram": histogram }))
        };
        self.answer(id, find).await;
    }

    /// The scene that the page shows.
    fn scene(&self) -> Result<Arc<PreparedScene>> {
        let scene = self.client.view().scene;
        scene.ok_or_else(|| Error::invalid_request("there is nothing to show yet"))
    }

    /// Sends what `find` returns, unless too many answers are being found already.
    pub(super) async fn answer(
        &self,
        id: u32,
        find: impl FnOnce(&dyn Progress) -> Result<Value> + Send + 'static,
    ) {
        let Ok(permit) = self.queries.clone().try_acquire_owned() else {
            let text = "too many questions at once; wait for an answer";
            return self.reject(RequestRef::Id(id), &Error::invalid_request(text)).await;
        };
        let (state, out) = (self.state.clone(), self.out.clone());
        tokio::spawn(async move {
            let _permit = permit;
            let (for_cancel, page) = (state.clone(), out.clone());
            let is_cancelled = move || page.is_closed() || for_cancel.is_stopped();
            let progress = ProgressReporter::new(|_| {}, is_cancelled);
            let found = state.run_blocking(move || find(&progress)).await.flatten();
            let message = found.unwrap_or_else(|error| rejection(RequestRef::Id(id), &error));
            send_json(&out, &message).await;
        });
    }
}
