//! Long work on scenes: told, given up, and never in the way of others.

use crate::page::{Page, Picture, Told, camera};
use crate::studio::MoodyRenderer;
use crate::viewer::Viewer;
use serde_json::{Value, json};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use surfel_web::Error;

#[tokio::test]
async fn a_sketch_is_shown_before_everything_is_ready() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({ "sketched": true, "slow": 0.5 })).await;
    assert_eq!(page.told("scene").await["legend"], "sketch");
    assert_eq!(page.told("scene").await["legend"], Value::Null);
}

#[tokio::test]
async fn pictures_tell_which_scene_they_show() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    let first = page.told("scene").await["number"].clone();
    assert_eq!(json!(page.finished().await.stage_number), first);
    page.set(1, json!({ "tint": 4 })).await;
    let second = page.told("scene").await["number"].clone();
    assert_ne!(second, first);
    // None of the first scene comes any more once this one has.
    let of_second = |picture: &Picture| json!(picture.stage_number) == second;
    assert_eq!(page.picture_that(of_second).await.input, 1);
    let rest = page.picture_that(|picture| !of_second(picture) || picture.is_finished).await;
    assert!(of_second(&rest));
}

#[tokio::test]
async fn long_work_is_told_and_given_up_for_newer_wishes() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.told("scene").await;
    page.set(1, json!({ "slow": 100 })).await;
    assert_eq!(page.told_state(Some("slow")).await["done"], 0.0);
    let start = Instant::now();
    page.set(2, json!({ "slow": null, "tint": 4 })).await;
    let scene = page.told("scene").await;
    assert!(start.elapsed() < Duration::from_secs(10));
    assert_eq!((&scene["input"], &scene["scene"]["tint"]), (&json!(2), &json!(4)));
    assert_eq!(viewer.studio.n_cancelled.load(Ordering::Relaxed), 1);
    page.told_state(None).await;
}

#[tokio::test]
async fn a_scene_moves_the_camera_of_a_page_that_does_not_look_elsewhere_meanwhile() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({ "led": 1 })).await;
    assert_eq!(page.told("scene").await["camera"], camera(1.0));
    let first = page.finished().await;
    page.set(1, json!({ "led": 2 })).await;
    assert_eq!(page.told("scene").await["camera"], camera(2.0));
    let led = page.picture_that(|picture| picture.is_finished && picture.input == 1).await;
    assert_ne!(led.file, first.file);

    page.set(2, json!({ "led": 3, "slow": 0.5 })).await;
    page.turn(3, 1.0, false).await;
    assert_eq!(page.told("scene").await["input"], 2);
    let own = page.picture_that(|picture| picture.is_finished && picture.input == 3).await;
    assert_eq!(own.file, first.file);
    page.say(json!({ "type": "take", "id": 1, "width": 30, "height": 20 })).await;
    let taken: Value =
        serde_json::from_str(page.told("taken").await["json"].as_str().unwrap()).unwrap();
    assert_eq!(taken["camera"], camera(1.0));
}

#[tokio::test]
async fn long_work_ends_when_its_page_has_gone() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.told("scene").await;
    page.set(1, json!({ "slow": 60 })).await;
    page.told_state(Some("slow")).await;
    drop(page);
    while viewer.studio.n_cancelled.load(Ordering::Relaxed) == 0 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Other pages move, pick and set while the scenes of several are made.
#[tokio::test]
async fn long_work_for_some_does_not_hold_up_others() {
    let viewer = Viewer::start();
    let mut waiting = Vec::new();
    for _ in 0..6 {
        let mut page = Page::open(&viewer, json!({})).await;
        page.told("scene").await;
        page.set(1, json!({ "stubborn": 30 })).await;
        waiting.push(page);
    }
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    for input in 1..=5 {
        page.turn(input, f64::from(input), true).await;
        page.picture_that(|picture| picture.input == input).await;
    }
    page.say(json!({ "type": "pick", "id": 1, "x": 32, "y": 24 })).await;
    page.told("picked").await;
    page.set(9, json!({ "tint": 1 })).await;
    assert_eq!(page.told("scene").await["input"], 9);
}

/// A studio holds a lock while threads of its own work: the one who waits for them must not be given work
/// that waits for the lock.
#[tokio::test]
async fn scenes_that_wait_for_one_another_are_all_made() {
    let viewer = Viewer::start();
    let mut pages = Vec::new();
    for _ in 0..8 {
        pages.push(Page::open(&viewer, json!({ "shared": 0.1 })).await);
    }
    for page in &mut pages {
        assert_eq!(page.told("scene").await["scene"]["shared"], 0.1);
    }
}

#[tokio::test]
async fn pages_are_told_of_loading() {
    let viewer = Viewer::start_at("127.0.0.1", |progress| {
        progress.begin("points", 0);
        std::thread::sleep(Duration::from_secs(1));
        Ok(())
    });
    let mut page = Page::open(&viewer, json!({})).await;
    page.told_state(Some("points")).await;
    page.told("welcome").await;
    page.finished().await;
}

#[tokio::test]
async fn a_page_may_say_anything_while_files_are_loaded() {
    let viewer = Viewer::start_at("127.0.0.1", |_| {
        std::thread::sleep(Duration::from_secs(1));
        Ok(())
    });
    let mut page = Page::open(&viewer, json!({})).await;
    for message in [
        json!({ "type": "take", "id": 1, "width": 3, "height": 2 }),
        json!({ "type": "load", "id": 1, "name": "a.json", "text": "{}" }),
        json!({ "type": "save", "id": 1, "width": 3, "height": 2 }),
    ] {
        page.say(message).await;
        assert_eq!(page.told("error").await["id"], 1);
    }
    page.turn(1, 1.0, false).await;
    page.set(2, json!({ "tint": 5 })).await;
    page.say(json!({ "type": "pick", "id": 2, "x": 32, "y": 24 })).await;
    page.picture_that(|picture| picture.is_finished && picture.input == 2).await;
}

#[tokio::test]
async fn a_server_that_cannot_load_ends_with_the_reason() {
    let mut viewer =
        Viewer::start_at("127.0.0.1", |_| Err(Error::Refused("scan.laz: no points".into())));
    let error = viewer.ended().unwrap_err();
    assert_eq!(error.to_string(), "scan.laz: no points");
}

#[tokio::test]
async fn everything_under_way_ends_when_the_server_stops() {
    let mut viewer = Viewer::start();
    let mut pages = Vec::new();
    for scene in [
        json!({ "paint": MoodyRenderer::SLOW }),
        json!({ "slow": 100 }),
        json!({ "stubborn": 3 }),
        json!({}),
    ] {
        let mut page = Page::open(&viewer, scene).await;
        page.told("welcome").await;
        page.say(json!({ "type": "size", "width": 1400, "height": 1400 })).await;
        pages.push(page);
    }
    pages[0].picture().await;
    pages[0].say(json!({ "type": "save", "id": 1, "width": 8000, "height": 8000 })).await;
    let start = Instant::now();
    viewer.stop().unwrap();
    assert!(start.elapsed() < Duration::from_millis(1500), "{:?}", start.elapsed());
    for page in &mut pages {
        while let Some(Told::Message(_) | Told::Picture(_)) = page.next().await {}
    }
}
