//! Preparation of scenes: its progress is reported, stale work is cancelled, and no page delays another.

use crate::hill_provider::{FaultyRenderer, Gate, HillProvider};
use crate::test_page::{Picture, TestPage, camera};
use crate::test_server::{TestServer, wait_until};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use surfel_web::{Error, Limits, Timeouts};

/// Limits under which work for older settings is cancelled at once.
fn impatient() -> Limits {
    let timeouts = Timeouts { stale_update: Duration::ZERO, ..Timeouts::default() };
    Limits { timeouts, ..Limits::default() }
}

#[tokio::test]
async fn a_preview_is_shown_before_the_whole_scene() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "preview": true, "gated": true })).await;
    assert_eq!(page.message("scene").await["legend"], "preview");
    server.provider.gate.open();
    assert_eq!(page.message("scene").await["legend"], Value::Null);
}

#[tokio::test]
async fn a_preview_of_rejected_settings_is_taken_back() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "tint": 3 })).await;
    page.message("scene").await;
    page.set_camera(1, 2.0, false).await;
    page.change_settings(2, json!({ "preview": true, "invalid": 1 })).await;
    let preview = page.message("scene").await;
    assert_eq!(preview["legend"], "preview");
    let kept = page.message("scene").await;
    assert_eq!((&kept["seq"], &kept["scene"]["tint"]), (&json!(2), &json!(3)));
    assert_eq!(kept["camera"], camera(2.0), "pictures show the page's camera");
    assert_eq!(page.message("error").await["key"], "invalid");
}

/// The rules of scene files decide which cameras there are, and no others.
#[tokio::test]
async fn a_narrow_camera_of_the_provider_is_shown() {
    let server = TestServer::start();
    let mut narrow = camera(1.0);
    narrow["view_angle"] = json!(0.05);
    let mut page = TestPage::open(&server, json!({ "camera": narrow })).await;
    assert_eq!(page.message("scene").await["camera"], narrow);
    page.finished_picture().await;
    narrow["view_angle"] = json!(179.5);
    page.send_json(json!({ "type": "camera", "seq": 1, "camera": narrow })).await;
    page.wait_for_picture(|picture| picture.is_finished && picture.seq == 1).await;
}

#[tokio::test]
async fn pictures_carry_the_number_of_their_scene() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    let first = page.message("scene").await["number"].clone();
    assert_eq!(json!(page.finished_picture().await.scene_number), first);
    page.change_settings(1, json!({ "tint": 4 })).await;
    let second = page.message("scene").await["number"].clone();
    assert_ne!(second, first);
    // No picture of the first scene follows one of the second.
    let shows_second = |picture: &Picture| json!(picture.scene_number) == second;
    assert_eq!(page.wait_for_picture(shows_second).await.seq, 1);
    let condition = |picture: &Picture| !shows_second(picture) || picture.is_finished;
    assert!(shows_second(&page.wait_for_picture(condition).await));
}

#[tokio::test]
async fn work_for_older_settings_is_cancelled() {
    let server = TestServer::start_with_limits(impatient());
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    page.change_settings(1, json!({ "slow": 1000 })).await;
    assert_eq!(page.progress_state(Some("slow")).await["done"], 0.0);
    page.change_settings(2, json!({ "slow": null, "tint": 4 })).await;
    let scene = page.message("scene").await;
    assert_eq!((&scene["seq"], &scene["scene"]["tint"]), (&json!(2), &json!(4)));
    assert_eq!(server.provider.n_cancelled.load(Ordering::Relaxed), 1);
    page.progress_state(None).await;
}

#[tokio::test]
async fn scenes_are_shown_while_slow_settings_keep_coming() {
    let timeouts = Timeouts { stale_update: Duration::from_millis(50), ..Timeouts::default() };
    let server = TestServer::start_with_limits(Limits { timeouts, ..Limits::default() });
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    let mut n_scenes = 0;
    let mut seq = 0;
    while n_scenes < 3 {
        seq += 1;
        assert!(seq < 1000, "{n_scenes} scenes were shown");
        page.change_settings(seq, json!({ "slow": 1, "tint": seq })).await;
        let messages = page.messages_within(Duration::from_millis(20)).await;
        n_scenes += messages.iter().filter(|message| message["type"] == "scene").count();
    }
    assert!(1 <= server.provider.n_cancelled.load(Ordering::Relaxed));
}

#[tokio::test]
async fn the_initial_scene_confirms_what_came_after_invalid_settings() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "gated": true, "invalid": 1 })).await;
    page.message("welcome").await;
    page.change_settings(8, json!({ "gated": null, "invalid": null, "tint": 4 })).await;
    page.sync().await;
    server.provider.gate.open();
    let scene = page.message("scene").await;
    assert_eq!((&scene["seq"], &scene["scene"]["tint"]), (&json!(8), &json!(4)));
}

#[tokio::test]
async fn a_page_learns_that_there_is_no_initial_scene() {
    let server = TestServer::start();
    let mut page = TestPage::connect(&server).await.unwrap();
    let width = HillProvider::FAULTY_WIDTH;
    page.send_json(json!({ "type": "hello", "width": width, "height": 9, "scene": {} })).await;
    let error = page.message("error").await;
    assert_eq!(error["text"], "internal error; please report it");
}

#[tokio::test]
async fn an_animated_camera_moves_unless_the_user_has_moved_it_meanwhile() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "camera_angle": 1 })).await;
    assert_eq!(page.message("scene").await["camera"], camera(1.0));
    let first = page.finished_picture().await;
    page.change_settings(1, json!({ "camera_angle": 2 })).await;
    assert_eq!(page.message("scene").await["camera"], camera(2.0));
    let condition = |picture: &Picture| picture.is_finished && picture.seq == 1;
    assert_ne!(page.wait_for_picture(condition).await.files, first.files);

    page.change_settings(2, json!({ "camera_angle": 3, "gated": true })).await;
    page.set_camera(3, 1.0, false).await;
    for picture in page.sync().await {
        page.acknowledge(&picture).await;
    }
    server.provider.gate.open();
    assert_eq!(page.message("scene").await["seq"], 2);
    page.set_camera(4, 1.0, false).await;
    let condition = |picture: &Picture| picture.is_finished && picture.seq == 4;
    assert_eq!(page.wait_for_picture(condition).await.files, first.files);
    page.send_json(json!({ "type": "export", "id": 1, "width": 30, "height": 20 })).await;
    let exported = page.message("export").await;
    let exported: Value = serde_json::from_str(exported["json"].as_str().unwrap()).unwrap();
    assert_eq!(exported["camera"], camera(1.0));
}

#[tokio::test]
async fn work_is_cancelled_when_its_page_disconnects() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    page.change_settings(1, json!({ "slow": 1000 })).await;
    page.progress_state(Some("slow")).await;
    drop(page);
    wait_until(|| server.provider.n_cancelled.load(Ordering::Relaxed) == 1).await;
}

#[tokio::test]
async fn memory_is_freed_once_the_last_page_has_gone() {
    let timeouts = Timeouts { release: Duration::from_millis(300), ..Timeouts::default() };
    let server = TestServer::start_with_limits(Limits { timeouts, ..Limits::default() });
    let n_released = || server.provider.n_released.load(Ordering::Relaxed);
    let mut first = TestPage::open(&server, json!({})).await;
    let mut second = TestPage::open(&server, json!({})).await;
    first.message("welcome").await;
    second.message("welcome").await;
    drop(first);
    second.drain(2 * timeouts.release).await;
    assert_eq!(n_released(), 0, "a page is left");
    drop(second);
    wait_until(|| n_released() == 1).await;
}

#[tokio::test]
async fn a_page_that_is_loaded_again_keeps_its_memory() {
    let timeouts = Timeouts { release: Duration::from_secs(4), ..Timeouts::default() };
    let server = TestServer::start_with_limits(Limits { timeouts, ..Limits::default() });
    let mut first = TestPage::open(&server, json!({})).await;
    first.message("welcome").await;
    drop(first);
    let mut again = TestPage::open(&server, json!({})).await;
    again.finished_picture().await;
    again.drain(timeouts.release + Duration::from_secs(1)).await;
    assert_eq!(server.provider.n_released.load(Ordering::Relaxed), 0);
}

#[tokio::test]
async fn blocked_preparation_does_not_block_other_pages() {
    let server = TestServer::start();
    let mut blocked = Vec::new();
    for _ in 0..6 {
        let mut page = TestPage::open(&server, json!({})).await;
        page.message("scene").await;
        page.change_settings(1, json!({ "gated": true })).await;
        blocked.push(page);
    }
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    for seq in 1..=5 {
        page.set_camera(seq, f64::from(seq), true).await;
        page.wait_for_picture(|picture| picture.seq == seq).await;
    }
    page.send_json(json!({ "type": "pick", "id": 1, "x": 32, "y": 24 })).await;
    page.message("pick").await;
    page.change_settings(9, json!({ "tint": 1 })).await;
    assert_eq!(page.message("scene").await["seq"], 9);
}

/// A provider holds a lock while threads of its pool work: a thread that waits for them must not be given work that
/// waits for the lock.
#[tokio::test]
async fn preparation_that_waits_for_another_does_not_deadlock() {
    let server = TestServer::start();
    let mut pages = Vec::new();
    for _ in 0..8 {
        pages.push(TestPage::open(&server, json!({ "locked": 0.02 })).await);
    }
    for page in &mut pages {
        assert_eq!(page.message("scene").await["scene"]["locked"], 0.02);
    }
}

/// A server whose files are loaded once the gate opens.
fn start_loading() -> (TestServer, Arc<Gate>) {
    let gate: Arc<Gate> = Arc::default();
    let loading = gate.clone();
    let server = TestServer::start_loading(move |progress| {
        progress.begin("points", 0);
        loading.wait();
        Ok(())
    });
    (server, gate)
}

#[tokio::test]
async fn pages_get_the_progress_of_loading() {
    let (server, gate) = start_loading();
    let mut page = TestPage::open(&server, json!({})).await;
    page.progress_state(Some("points")).await;
    gate.open();
    page.message("welcome").await;
    page.finished_picture().await;
}

#[tokio::test]
async fn pages_may_send_any_message_while_files_are_loaded() {
    let (server, gate) = start_loading();
    let mut page = TestPage::open(&server, json!({})).await;
    for message in [
        json!({ "type": "export", "id": 1, "width": 3, "height": 2 }),
        json!({ "type": "loadScene", "id": 1, "name": "a.json", "text": "{}" }),
        json!({ "type": "save", "id": 1, "width": 3, "height": 2 }),
    ] {
        page.send_json(message).await;
        assert_eq!(page.message("error").await["id"], 1);
    }
    page.set_camera(1, 1.0, false).await;
    page.change_settings(2, json!({ "tint": 5 })).await;
    page.send_json(json!({ "type": "pick", "id": 2, "x": 32, "y": 24 })).await;
    gate.open();
    page.wait_for_picture(|picture| picture.is_finished && picture.seq == 2).await;
}

#[tokio::test]
async fn a_server_that_cannot_load_ends_with_the_reason() {
    let load = |_: &dyn surfel_core::progress::Progress| {
        Err(Error::invalid_request("scan.laz: no points"))
    };
    let mut server = TestServer::start_loading(load);
    let error = server.join().unwrap_err();
    assert_eq!(error.to_string(), "scan.laz: no points");
}

/// Each of these tasks takes minutes or never ends unless it is cancelled.
#[tokio::test]
async fn a_stopping_server_ends_all_tasks() {
    let mut server = TestServer::start();
    let mut pages = Vec::new();
    for scene in [
        json!({ "fault": FaultyRenderer::SLOW }),
        json!({ "slow": 1000 }),
        json!({ "gated": true }),
        json!({}),
    ] {
        let mut page = TestPage::open(&server, scene).await;
        page.message("welcome").await;
        page.send_json(json!({ "type": "size", "width": 1400, "height": 1400 })).await;
        pages.push(page);
    }
    pages[0].picture().await;
    pages[0].send_json(json!({ "type": "save", "id": 1, "width": 8000, "height": 8000 })).await;
    server.stop().unwrap();
    for page in &mut pages {
        page.wait_until_closed().await;
    }
}
