//! The messages between page and server.

use crate::hill_provider::FaultyRenderer;
use crate::http_client::get;
use crate::test_page::{Picture, Received, SAVED, TestPage};
use crate::test_server::{TestServer, wait_until};
use serde_json::{Value, json};
use std::sync::atomic::Ordering;
use std::time::Duration;
use surfel_web::Limits;

#[tokio::test]
async fn a_page_gets_welcome_scene_and_statistics() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "tint": 3 })).await;
    let welcome = page.message("welcome").await;
    assert_eq!((&welcome["info"]["name"], &welcome["scene"]["tint"]), (&json!("hill"), &json!(0)));
    let scene = page.message("scene").await;
    assert_eq!((&scene["seq"], &scene["scene"]["tint"]), (&json!(0), &json!(3)));
    let stats = page.message("stats").await;
    assert_eq!(stats["frame"], 1);
}

#[tokio::test]
async fn pings_are_answered() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "gated": true })).await;
    page.send_json(json!({ "type": "ping" })).await;
    page.message("pong").await;
}

#[tokio::test]
async fn settings_of_other_data_are_ignored() {
    let server = TestServer::start();
    for (name, tint) in [("hill", 3), ("valley", 0)] {
        let mut page = TestPage::connect(&server).await.unwrap();
        let hello = json!({ "type": "hello", "width": 64, "height": 48, "scene": { "tint": 3 }, "name": name });
        page.send_json(hello).await;
        assert_eq!(page.message("scene").await["scene"]["tint"], tint, "{name}");
    }
}

#[tokio::test]
async fn settings_arrive_before_their_first_picture() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    for seq in 1..=20 {
        page.change_settings(seq, json!({ "tint": seq })).await;
        let mut confirmed_seq = 0;
        loop {
            match page.next().await.expect("the server closed the connection") {
                Received::Message(message) if message["type"] == "scene" => {
                    confirmed_seq = message["seq"].as_u64().unwrap();
                }
                Received::Message(_) => {}
                Received::Picture(picture) => {
                    page.acknowledge(&picture).await;
                    if picture.seq == seq {
                        assert_eq!(confirmed_seq, u64::from(seq));
                        break;
                    }
                }
            }
        }
    }
}

#[tokio::test]
async fn settings_are_patched_and_removed() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    for (seq, tint, expected) in [(1, json!(9), 9), (2, Value::Null, 0)] {
        page.change_settings(seq, json!({ "tint": tint })).await;
        let scene = page.message("scene").await;
        assert_eq!((&scene["seq"], &scene["scene"]["tint"]), (&json!(seq), &json!(expected)));
    }
}

#[tokio::test]
async fn rejections_name_the_key_and_keep_the_old_settings() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    page.change_settings(3, json!({ "invalid": 1, "tint": 8 })).await;
    let error = page.message("error").await;
    assert_eq!((&error["seq"], &error["key"]), (&json!(3), &json!("invalid")));
    assert_eq!(error["text"], "unknown key");
    let mut camera = crate::test_page::camera(1.0);
    camera["view_angle"] = json!(180);
    page.send_json(json!({ "type": "camera", "seq": 4, "camera": camera })).await;
    let error = page.message("error").await;
    assert_eq!((&error["seq"], &error["key"]), (&json!(4), &json!("camera.view_angle")));
    page.change_settings(5, json!({ "slow": 0 })).await;
    let scene = page.message("scene").await;
    assert_eq!((&scene["seq"], &scene["scene"]["tint"]), (&json!(5), &json!(0)));
}

#[tokio::test]
async fn a_page_with_invalid_settings_shows_the_initial_scene() {
    let server = TestServer::start();
    for invalid in ["invalid", "panic"] {
        let mut page = TestPage::open(&server, json!({ invalid: 1 })).await;
        page.message("error").await;
        assert_eq!(page.message("scene").await["scene"]["tint"], 0);
        page.finished_picture().await;
    }
}

#[tokio::test]
async fn picks_return_points_or_null() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    for (id, x, is_found) in
        [(1, 32.5, true), (2, -1.0, false), (3, 1e300, false), (4, 64.0, false)]
    {
        page.send_json(json!({ "type": "pick", "id": id, "x": x, "y": 24.5 })).await;
        let picked = page.message("pick").await;
        assert_eq!((&picked["id"], picked["point"].is_object()), (&json!(id), is_found));
    }
}

#[tokio::test]
async fn profiles_have_the_points_beside_their_line() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    let request = |id: u32, points: Value| json!({ "type": "profile", "id": id, "points": points, "width": 0.05, "up": [0, 0, 1] });
    page.send_json(request(1, json!([[-1.001, 0, 7], [1, 0, 9]]))).await;
    let profiled = page.message("profile").await;
    let profile = &profiled["profile"];
    assert_eq!((&profiled["id"], &profile["n_found"]), (&json!(1), &json!(50)));
    let numbers = |name: &str, i: usize| profile[name][i].as_f64().unwrap();
    for i in 0..50 {
        let x = numbers("distances", i) - 1.001;
        let height = 0.5 * (-2.0 * x * x).exp();
        assert!((numbers("heights", i) - height).abs() < 1e-5, "{i}");
        assert!(numbers("offsets", i).abs() < 1e-5 && profile["colors"][i].is_array());
        let position = &profile["positions"][i];
        assert!((position[0].as_f64().unwrap() - x).abs() < 1e-5, "{position}");
        assert_eq!(position[2], profile["heights"][i]);
    }
    for invalid in [json!([]), json!([[0, 0, 0]])] {
        page.send_json(request(2, invalid)).await;
        let error = page.message("error").await;
        assert_eq!(
            (&error["id"], error["text"].as_str().unwrap().contains("corner")),
            (&json!(2), true)
        );
    }
}

#[tokio::test]
async fn pages_learn_which_points_are_hidden() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    let request = |id: u32, points: Value| json!({ "type": "visible", "id": id, "points": points });
    // On the hill, below it, beside it, and behind the camera.
    let points = json!([[0, 0, 0.5], [0, 0, -0.5], [3, 0, 0], [0, -20, 12]]);
    page.send_json(request(1, points)).await;
    let seen = page.message("visible").await;
    assert_eq!((&seen["id"], &seen["visible"]), (&json!(1), &json!([true, false, true, true])));
    for invalid in [json!(vec![[0; 3]; 2001]), json!([["x", 0, 0]])] {
        page.send_json(request(2, invalid)).await;
        assert!(page.message("error").await["text"].is_string());
    }
}

#[tokio::test]
async fn a_saved_picture_has_the_camera_of_the_page() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    page.send_json(json!({ "type": "save", "id": 5, "width": 30, "height": 20 })).await;
    let saved = page.wait_for_picture(|picture| picture.kind == SAVED).await;
    assert_eq!((saved.number, saved.size), (5, (30, 20)));
    assert_eq!(saved.decode().into_rgba8(), server.provider.finished_picture((30, 20)));
}

#[tokio::test]
async fn saves_report_progress_and_can_be_cancelled() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "slow_render": 1000 })).await;
    page.finished_picture().await;
    let save = |id: u32| json!({ "type": "save", "id": id, "width": 30, "height": 20 });
    for id in [1, 2, 2, 3] {
        page.send_json(save(id)).await;
    }
    for rejected in [2, 3] {
        assert_eq!(page.message("error").await["id"], rejected);
    }
    assert!(page.message("progress").await["done"].is_number());
    for id in [1, 2] {
        page.send_json(json!({ "type": "cancel", "id": id })).await;
    }
    for _ in 0..2 {
        assert_eq!(page.message("error").await["text"], "cancelled");
    }
    page.change_settings(1, json!({ "slow_render": null })).await;
    page.message("scene").await;
    page.send_json(save(4)).await;
    page.wait_for_picture(|picture| picture.kind == SAVED && picture.number == 4).await;
}

#[tokio::test]
async fn a_page_saves_one_picture_after_the_other_and_leaves_room_for_other_pages() {
    let server = TestServer::start();
    let mut busy = TestPage::open(&server, json!({ "slow_render": 100 })).await;
    busy.finished_picture().await;
    let save = |id: u32| json!({ "type": "save", "id": id, "width": 30, "height": 20 });
    busy.send_json(save(1)).await;
    wait_until(|| server.provider.n_started.load(Ordering::Relaxed) == 1).await;
    busy.send_json(save(2)).await;
    let mut other = TestPage::open(&server, json!({})).await;
    other.finished_picture().await;
    other.send_json(save(7)).await;
    other.wait_for_picture(|picture| picture.kind == SAVED && picture.number == 7).await;
    // A save that waits for another is cancelled at once, and another one may wait.
    for waiting in [2, 3] {
        busy.send_json(json!({ "type": "cancel", "id": waiting })).await;
        let error = busy.message("error").await;
        assert_eq!((&error["id"], &error["text"]), (&json!(waiting), &json!("cancelled")));
        busy.sync().await;
        busy.send_json(save(waiting + 1)).await;
    }
    assert_eq!(server.provider.n_started.load(Ordering::Relaxed), 1);
}

#[tokio::test]
async fn saves_beyond_the_size_limits_are_rejected() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    for (id, width, height) in [(1, 0, 5), (2, u32::MAX, u32::MAX), (3, 32_769, 1), (4, 9000, 9000)]
    {
        page.send_json(json!({ "type": "save", "id": id, "width": width, "height": height })).await;
        assert_eq!(page.message("error").await["id"], id);
    }
}

#[tokio::test]
async fn settings_are_exported_and_loaded() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    page.send_json(json!({ "type": "export", "id": 1, "width": 30, "height": 20 })).await;
    let exported = page.message("export").await;
    assert_eq!((&exported["id"], &exported["command"]), (&json!(1), &json!("surfel render hill")));
    assert!(exported["json"].as_str().unwrap().contains(r#""resolution":"30x20""#));
    let load = |id: u32, text: &str| json!({ "type": "loadScene", "id": id, "name": "a.json", "text": text });
    page.send_json(load(2, "{")).await;
    assert_eq!(page.message("error").await["id"], 2);
    page.set_camera(5, 1.0, false).await;
    page.send_json(load(3, r#"{"slow":0}"#)).await;
    let answer = page.message("scene").await;
    assert_eq!((&answer["id"], &answer["seq"]), (&json!(3), &json!(5)));
    assert_eq!((&answer["scene"]["slow"], &answer["scene"]["tint"]), (&json!(0), &json!(7)));
    page.send_json(load(4, r#"{"invalid":0}"#)).await;
    let error = page.message("error").await;
    assert_eq!((&error["id"], &error["seq"]), (&json!(4), &json!(5)));
    // Settings that the page changes itself answer no request.
    page.change_settings(6, json!({ "tint": 2 })).await;
    assert_eq!(page.message("scene").await["id"], Value::Null);
}

#[tokio::test]
async fn a_scene_file_brings_its_camera_unless_the_user_moves_it_later() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    let first = page.finished_picture().await;
    page.set_camera(1, 1.0, false).await;
    let load = |id: u32, text: &str| json!({ "type": "loadScene", "id": id, "name": "a.json", "text": text });
    page.send_json(load(1, r#"{"tint":0}"#)).await;
    let number = page.message("scene").await["number"].clone();
    let condition =
        |picture: &Picture| picture.is_finished && json!(picture.scene_number) == number;
    assert_eq!(page.wait_for_picture(condition).await.files, first.files);
    page.send_json(load(2, r#"{"tint":0,"gated":true}"#)).await;
    page.set_camera(2, 1.0, false).await;
    for picture in page.sync().await {
        page.acknowledge(&picture).await;
    }
    server.provider.gate.open();
    let number = page.message("scene").await["number"].clone();
    let condition =
        |picture: &Picture| picture.is_finished && json!(picture.scene_number) == number;
    assert_ne!(page.wait_for_picture(condition).await.files, first.files);
}

#[tokio::test]
async fn histograms_and_volumes_are_answered() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    page.send_json(json!({ "type": "histogram", "id": 4, "column": "z" })).await;
    let counted = page.message("histogram").await;
    assert_eq!((&counted["id"], &counted["histogram"]["counts"]), (&json!(4), &json!([3, 0, 1])));
    page.send_json(json!({ "type": "histogram", "id": 5, "column": "wind" })).await;
    assert_eq!(page.message("error").await["id"], 5);
    let corners = json!([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]);
    let volume = |id: u32, points: &Value, base: Value| json!({ "type": "volume", "id": id, "points": points, "up": [0, 0, 1], "base": base });
    page.send_json(volume(6, &corners, json!(-2))).await;
    let measured = page.message("volume").await;
    assert_eq!((&measured["id"], &measured["volume"]["base"]), (&json!(6), &json!(-2.0)));
    assert!(0.0 < measured["volume"]["cut"].as_f64().unwrap(), "{measured}");
    let on_a_line = json!([[0, 0, 0], [1, 1, 0], [2, 2, 5]]);
    for (id, points, base) in [(7, &on_a_line, json!("mean")), (8, &corners, json!("top"))] {
        page.send_json(volume(id, points, base)).await;
        assert_eq!(page.message("error").await["id"], id);
    }
}

#[tokio::test]
async fn points_are_fetched_until_their_page_goes() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.message("scene").await;
    page.send_json(json!({ "type": "points", "id": 1, "format": "exe" })).await;
    assert_eq!(page.message("error").await["id"], 1);
    let mut addresses = Vec::new();
    for id in [2, 3] {
        page.send_json(json!({ "type": "points", "id": id, "format": "laz" })).await;
        let written = page.message("points").await;
        assert_eq!((&written["id"], &written["n_points"]), (&json!(id), &json!(7)));
        addresses.push(format!("/{}", written["address"].as_str().unwrap()));
    }
    page.send_json(
        json!({ "type": "movie", "id": 4, "format": "gif", "width": 3, "height": 2, "fps": 5 }),
    )
    .await;
    let movie = page.message_of(4).await;
    assert_eq!((&movie["type"], &movie["n_frames"]), (&json!("movie"), &json!(7)), "{movie}");
    // A movie replaces no file of points.
    let file = get(&server, &addresses[1]).await;
    assert_eq!((file.status, file.header("content-length")), (200, Some("1000000")));
    assert_eq!(file.header("content-disposition"), Some("attachment"));
    assert!(file.body.iter().all(|byte| *byte == b'x') && file.body.len() == 1_000_000);
    // A newer file replaces the older one.
    assert_eq!(get(&server, &addresses[0]).await.status, 404);
    assert_eq!(get(&server, "/downloads/x").await.status, 404);
    drop(page);
    while get(&server, &addresses[1]).await.status != 404 {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test]
async fn writing_points_can_be_cancelled() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "slow_render": 60 })).await;
    page.message("scene").await;
    page.send_json(json!({ "type": "points", "id": 9, "format": "laz" })).await;
    page.send_json(json!({ "type": "cancel", "id": 9 })).await;
    let error = page.message("error").await;
    assert_eq!((&error["id"], &error["text"]), (&json!(9), &json!("cancelled")));
}

#[tokio::test]
async fn a_pick_that_fails_is_an_error() {
    let server = TestServer::start();
    let scene = json!({ "fault": FaultyRenderer::WHOLE, "points": true });
    let mut page = TestPage::open(&server, scene).await;
    page.finished_picture().await;
    page.send_json(json!({ "type": "pick", "id": 1, "x": 32, "y": 24 })).await;
    assert_eq!(page.message_of(1).await["type"], "error");
}

#[tokio::test]
async fn a_pixel_is_one_of_the_view_before_the_next_camera() {
    let server = TestServer::start_with_limits(Limits { max_tasks: 1, ..Limits::default() });
    let mut page = TestPage::open(&server, json!({})).await;
    page.set_camera(1, 1.0, false).await;
    page.wait_for_picture(|picture| picture.is_finished && picture.seq == 1).await;
    let pick = |id: u32| json!({ "type": "pick", "id": id, "x": 32, "y": 24 });
    page.send_json(pick(1)).await;
    let expected = page.message_of(1).await["point"].clone();
    assert!(expected["index"].is_u64());
    page.change_settings(2, json!({ "gated": true })).await;
    // The preparation holds the only place for tasks before the pick asks for one.
    wait_until(|| server.provider.gate.n_arrived.load(Ordering::Relaxed) == 1).await;
    page.send_json(pick(2)).await;
    page.set_camera(3, 3.0, false).await;
    page.wait_for_picture(|picture| picture.seq == 3).await;
    server.provider.gate.open();
    assert_eq!(page.message_of(2).await["point"], expected);
    page.send_json(pick(3)).await;
    assert_ne!(page.message_of(3).await["point"], expected);
}

#[tokio::test]
async fn an_export_does_not_block_its_page() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "slow_export": 100 })).await;
    page.finished_picture().await;
    page.send_json(json!({ "type": "export", "id": 1, "width": 3, "height": 2 })).await;
    wait_until(|| server.provider.n_started.load(Ordering::Relaxed) == 1).await;
    page.set_camera(1, 1.0, false).await;
    page.wait_for_picture(|picture| picture.is_finished && picture.seq == 1).await;
    drop(page);
    wait_until(|| server.provider.n_cancelled.load(Ordering::Relaxed) == 1).await;
}
