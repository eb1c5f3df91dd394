//! From a page's wishes to the scene it looks at: all of them at once, one scene after the other.

use crate::camera;
use crate::client::{Client, Outgoing};
use crate::hall::Hall;
use crate::session::{answer, refusal};
use crate::studio::{Error, Keys, Stage, Studio, merge};
use crate::telling::{Telling, Told};
use crate::wishes::{Wish, Wishes};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};
use surfel::progress::Progress;
use tokio::sync::mpsc;

/// Work for older wishes is given up for newer ones after so long: sooner, nothing would be seen of a
/// slider that is being dragged.
const PATIENCE: Duration = Duration::from_secs(1);

pub async fn run(
    hall: Arc<Hall>,
    client: Arc<Client>,
    wishes: Arc<Wishes>,
    out: mpsc::Sender<Outgoing>,
) {
    let Some(studio) = loaded(&hall, &out).await else { return };
    let (width, height) = client.sight().size;
    let settings = studio.opening(width, height);
    answer(&out, &json!({ "type": "welcome", "scene": settings, "info": studio.info() })).await;
    let mut staging = Staging { hall, client, wishes, out, studio, settings };
    let first = staging.wishes.take().await;
    staging.sketch(&first).await;
    staging.grant(first).await;
    loop {
        let wish = staging.wishes.take().await;
        staging.grant(wish).await;
    }
}

/// Waits for the files, and tells meanwhile how they come.
async fn loaded(hall: &Hall, out: &mpsc::Sender<Outgoing>) -> Option<Arc<dyn Studio>> {
    let mut loading = hall.loading.subscribe();
    loading.mark_changed();
    loop {
        tokio::select! {
            studio = hall.studio() => return studio,
            changed = loading.changed() => {
                changed.ok()?;
                let told = loading.borrow_and_update().clone();
                answer(out, &state(told.as_ref())).await;
            }
        }
    }
}

fn state(told: Option<&Told>) -> Value {
    json!({
        "type": "state",
        "text": told.map(|told| &told.stage),
        "done": told.and_then(|told| told.done),
        "left_secs": told.and_then(|told| told.left_secs),
    })
}

struct Staging {
    hall: Arc<Hall>,
    client: Arc<Client>,
    wishes: Arc<Wishes>,
    out: mpsc::Sender<Outgoing>,
    studio: Arc<dyn Studio>,
    /// Of what is seen.
    settings: Keys,
}

impl Staging {
    /// Shows something before everything is prepared.
    async fn sketch(&mut self, wish: &Wish) {
        let (studio, settings) = (self.studio.clone(), self.settings_with(wish));
        let telling = self.telling();
        let made = self.hall.work(move || studio.sketch(&settings, &telling)).await;
        if let Ok(Some(Ok(stage))) = made {
            self.show(stage, wish).await;
        }
    }

    /// Makes the scene that is wished for, or says why not.
    async fn grant(&mut self, wish: Wish) {
        let (studio, settings) = (self.studio.clone(), self.settings_with(&wish));
        let telling = self.telling();
        let made = self.hall.work(move || studio.stage(&settings, &telling)).await;
        match made.and_then(|made| made) {
            Ok(stage) => self.show(stage, &wish).await,
            Err(Error::Cancelled) => self.wishes.put_back(wish),
            Err(error) => {
                answer(&self.out, &refusal(None, Some(wish.input), &error.to_string())).await;
                self.client.rest(wish.is_moving);
                // A page whose own settings are wrong still sees what it was opened for.
                if self.client.sight().stage.is_none() && !wish.patch.is_empty() {
                    let _ = self.wishes.add(Wish::default());
                }
            }
        }
        answer(&self.out, &state(None)).await;
    }

    fn settings_with(&self, wish: &Wish) -> Keys {
        let mut settings = if wish.is_anew { self.studio.given() } else { self.settings.clone() };
        if !wish.is_anew && !self.client.sight().camera_keys.is_null() {
            settings.insert("camera".into(), self.client.sight().camera_keys);
        }
        merge(&mut settings, &wish.patch);
        settings
    }

    async fn show(&mut self, stage: Stage, wish: &Wish) {
        self.settings = stage.settings.clone();
        let keys = stage.settings.get("camera").cloned().unwrap_or_default();
        let place = stage.moved_camera.as_ref().unwrap_or(&keys);
        // Pictures of what was seen before may still be on their way.
        let stage_number = self.client.sight().stage_number.wrapping_add(1);
        let message = json!({
            "type": "scene",
            "number": stage_number,
            "input": wish.input,
            "scene": stage.settings,
            "camera": place,
            "legend": stage.legend,
        });
        // Before its first picture, whose settings the page then knows.
        answer(&self.out, &message).await;
        let is_led = stage.moved_camera.is_some() || wish.patch.contains_key("camera");
        let camera = camera::parse(place).ok();
        let stage = Arc::new(stage);
        self.client.look(|sight| {
            // A page may have looked elsewhere while its scene was made.
            let is_newest = is_led && sight.input <= wish.input;
            if sight.camera.is_none() || wish.is_anew || is_newest {
                (sight.camera, sight.camera_keys) = (camera, keys);
            }
            (sight.stage, sight.stage_number) = (Some(stage), stage_number);
            sight.input = sight.input.max(wish.input);
            sight.is_moving = wish.is_moving;
        });
        self.hall.easel.call();
    }

    /// Tells the page of long work, which ends for newer wishes or when nobody waits for it any more.
    fn telling(&self) -> impl Progress + Send + 'static {
        let (out, hall, wishes) = (self.out.clone(), self.hall.clone(), self.wishes.clone());
        let (gone, start) = (self.out.clone(), Instant::now());
        // What finds no room is not missed.
        let tell = move |told: Told| {
            let _ = out.try_send(Outgoing::Text(state(Some(&told)).to_string()));
        };
        let is_cancelled = move || {
            let is_old = PATIENCE < start.elapsed() && !wishes.is_empty();
            is_old || hall.is_stopped() || gone.is_closed()
        };
        Telling::new(tell, is_cancelled)
    }
}
