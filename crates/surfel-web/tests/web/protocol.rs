//! What page and server say to each other.

use crate::page::{Page, SAVED, Told};
use crate::viewer::Viewer;
use serde_json::{Value, json};

#[tokio::test]
async fn a_page_is_welcomed_and_told_the_scene() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({ "tint": 3 })).await;
    let welcome = page.told("welcome").await;
    assert_eq!((&welcome["info"]["name"], &welcome["scene"]["tint"]), (&json!("hill"), &json!(0)));
    let scene = page.told("scene").await;
    assert_eq!((&scene["input"], &scene["scene"]["tint"]), (&json!(0), &json!(3)));
    let stats = page.told("stats").await;
    assert_eq!(stats["frame"], 1);
}

#[tokio::test]
async fn settings_are_told_before_their_first_picture() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    for input in 1..=20 {
        page.set(input, json!({ "tint": input })).await;
        let mut told = 0;
        loop {
            match page.next().await.expect("the server has gone") {
                Told::Message(message) if message["type"] == "scene" => {
                    told = message["input"].as_u64().unwrap()
                }
                Told::Message(_) => {}
                Told::Picture(picture) => {
                    page.has_seen(&picture).await;
                    if picture.input == input {
                        assert_eq!(told, u64::from(input));
                        break;
                    }
                }
            }
        }
    }
}

#[tokio::test]
async fn settings_are_patched_and_given_back() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.told("scene").await;
    for (input, tint, expected) in [(1, json!(9), 9), (2, Value::Null, 0)] {
        page.set(input, json!({ "tint": tint })).await;
        let scene = page.told("scene").await;
        assert_eq!((&scene["input"], &scene["scene"]["tint"]), (&json!(input), &json!(expected)));
    }
}

#[tokio::test]
async fn refused_settings_leave_the_old_ones() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.told("scene").await;
    page.set(3, json!({ "wrong": 1, "tint": 8 })).await;
    let error = page.told("error").await;
    assert_eq!((&error["input"], &error["text"]), (&json!(3), &json!("wrong: not known")));
    page.say(json!({ "type": "camera", "input": 4, "camera": { "position": 1 } })).await;
    assert_eq!(page.told("error").await["input"], 4);
    page.set(5, json!({ "sketched": false })).await;
    let scene = page.told("scene").await;
    assert_eq!((&scene["input"], &scene["scene"]["tint"]), (&json!(5), &json!(0)));
}

#[tokio::test]
async fn a_page_with_wrong_settings_sees_what_it_was_opened_for() {
    let viewer = Viewer::start();
    for wrong in ["wrong", "panics"] {
        let mut page = Page::open(&viewer, json!({ wrong: 1 })).await;
        page.told("error").await;
        assert_eq!(page.told("scene").await["scene"]["tint"], 0);
        page.finished().await;
    }
}

#[tokio::test]
async fn places_are_told() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    for (id, x, is_found) in
        [(1, 32.5, true), (2, -1.0, false), (3, 1e300, false), (4, 64.0, false)]
    {
        page.say(json!({ "type": "pick", "id": id, "x": x, "y": 24.5 })).await;
        let picked = page.told("picked").await;
        assert_eq!((&picked["id"], picked["point"].is_object()), (&json!(id), is_found));
    }
}

#[tokio::test]
async fn a_picture_is_saved_with_the_camera_of_the_page() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    page.say(json!({ "type": "save", "id": 5, "width": 30, "height": 20 })).await;
    let saved = page.picture_that(|picture| picture.kind == SAVED).await;
    assert_eq!((saved.number, saved.size), (5, (30, 20)));
    assert_eq!(saved.decoded().into_rgba8(), viewer.studio.finished((30, 20)));
}

#[tokio::test]
async fn saves_tell_progress_and_are_cancelled() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({ "slow": 1 })).await;
    page.finished().await;
    let save = |id: u32| json!({ "type": "save", "id": id, "width": 30, "height": 20 });
    for id in [1, 2, 2, 3] {
        page.say(save(id)).await;
    }
    for refused in [2, 3] {
        assert_eq!(page.told("error").await["id"], refused);
    }
    assert!(page.told("progress").await["done"].is_number());
    for id in [1, 2] {
        page.say(json!({ "type": "cancel", "id": id })).await;
    }
    for _ in 0..2 {
        assert_eq!(page.told("error").await["text"], "cancelled");
    }
    page.say(save(4)).await;
    page.picture_that(|picture| picture.kind == SAVED && picture.number == 4).await;
}

#[tokio::test]
async fn nothing_is_saved_that_is_too_large() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    for (id, width, height) in [(1, 0, 5), (2, u32::MAX, u32::MAX), (3, 32_769, 1), (4, 9000, 9000)]
    {
        page.say(json!({ "type": "save", "id": id, "width": width, "height": height })).await;
        assert_eq!(page.told("error").await["id"], id);
    }
}

#[tokio::test]
async fn settings_are_taken_and_loaded() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    page.say(json!({ "type": "take", "id": 1, "width": 30, "height": 20 })).await;
    let taken = page.told("taken").await;
    assert_eq!((&taken["id"], &taken["command"]), (&json!(1), &json!("surfel render hill")));
    assert!(taken["json"].as_str().unwrap().contains(r#""resolution":"30x20""#));
    page.say(json!({ "type": "load", "id": 2, "name": "a.json", "text": "{" })).await;
    assert_eq!(page.told("error").await["id"], 2);
    page.say(json!({ "type": "load", "id": 3, "name": "a.json", "text": r#"{"sketched":0}"# }))
        .await;
    let scene = page.told("scene").await["scene"].clone();
    assert_eq!((&scene["sketched"], &scene["tint"]), (&json!(0), &json!(7)));
}
