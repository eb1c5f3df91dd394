//! Which pictures a page gets, and when.

use crate::page::{JPEG, PNG, Page, Picture, Told};
use crate::studio::{MoodyRenderer, PICTURE, SAMPLES};
use crate::viewer::Viewer;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const WHILE: Duration = Duration::from_millis(800);

fn pictures(all: Vec<Told>) -> Vec<Picture> {
    let picture = |told| if let Told::Picture(picture) = told { Some(picture) } else { None };
    all.into_iter().filter_map(picture).collect()
}

#[tokio::test]
async fn pictures_get_better_until_they_are_the_renderers_own() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    let mut all: Vec<Picture> = Vec::new();
    while !all.last().is_some_and(|picture| picture.is_finished) {
        all.push(page.picture_that(|_| true).await);
    }
    let numbers: Vec<u32> = all.iter().map(|picture| picture.number).collect();
    assert_eq!(numbers, (1..=all.len() as u32).collect::<Vec<_>>());
    assert!(all.iter().all(|picture| picture.of_samples == SAMPLES as u16));
    assert!(all.is_sorted_by_key(|picture| picture.samples));
    let (finished, before) = all.split_last().unwrap();
    assert!(!before.is_empty() && before.iter().all(|picture| picture.kind == JPEG));
    assert_eq!((finished.kind, finished.samples), (PNG, SAMPLES as u16));
    let (found, own) = (finished.decoded().into_rgba8(), viewer.studio.finished(PICTURE));
    assert_eq!(found.dimensions(), own.dimensions());
    // Sums of samples are rounded in another order.
    let is_close = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
    assert!(found.iter().zip(own.iter()).all(is_close));
}

#[tokio::test]
async fn headers_say_what_the_file_is() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    for _ in 0..3 {
        let picture = page.picture_that(|_| true).await;
        let image = picture.decoded();
        let size = (u32::from(picture.size.0), u32::from(picture.size.1));
        assert_eq!((image.width(), image.height()), size);
        let format = image::guess_format(&picture.file).unwrap();
        let is_jpeg = format == image::ImageFormat::Jpeg;
        assert_eq!(picture.kind, if is_jpeg { JPEG } else { PNG });
    }
}

#[tokio::test]
async fn pictures_say_which_input_they_obey() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    page.turn(7, 0.5, true).await;
    let draft = page.picture_that(|picture| picture.input == 7).await;
    assert_eq!((draft.kind, draft.samples), (JPEG, 1));
    page.turn(8, 1.0, false).await;
    let finished = page.finished().await;
    assert!([7, 8].contains(&finished.input));
    page.say(json!({ "type": "size", "width": 32, "height": 20 })).await;
    let smaller = page.picture_that(|picture| picture.is_finished && picture.size.0 == 32).await;
    assert_eq!((smaller.size, smaller.input), ((32, 20), 8));
}

#[tokio::test]
async fn who_has_not_seen_gets_two_pictures_and_then_the_newest() {
    let viewer = Viewer::start();
    let mut page = Page::open(&viewer, json!({})).await;
    for input in 1..=20 {
        page.turn(input, f64::from(input), true).await;
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let unseen = pictures(page.all_within(WHILE).await);
    assert_eq!(unseen.len(), 2);
    page.has_seen(&unseen[1]).await;
    assert_eq!(page.picture().await.input, 20);
}

/// How long after a picture has come a page far away says that it has seen it.
const LATE: Duration = Duration::from_millis(200);

/// A page far away: each picture that has come, and when it is said to be seen.
struct Slow {
    page: Page,
    pictures: Vec<(Picture, Instant)>,
    /// For each picture said to be seen, the input that had been sent by then.
    seen: Vec<u32>,
}

impl Slow {
    /// Takes what comes within `time`, and says what is due; `input` is the last that was sent.
    async fn listen(&mut self, time: Duration, input: u32) {
        let came = pictures(self.page.all_within(time).await);
        let now = Instant::now();
        self.pictures.extend(came.into_iter().map(|picture| (picture, now + LATE)));
        while let Some((picture, due)) = self.pictures.get(self.seen.len())
            && *due <= now
        {
            self.page.has_seen(picture).await;
            self.seen.push(input);
        }
    }
}

#[tokio::test]
async fn a_slow_reader_gets_fewer_pictures_and_the_newest_while_another_gets_all() {
    let viewer = Viewer::start();
    let mut quick = Page::open(&viewer, json!({})).await;
    quick.finished().await;
    let mut page = Page::open(&viewer, json!({})).await;
    page.finished().await;
    let mut slow = Slow { page, pictures: Vec::new(), seen: Vec::new() };
    let n_inputs = 40;
    let start = Instant::now();
    for input in 1..=n_inputs {
        let (angle, is_moving) = (f64::from(input) / 10.0, input < n_inputs);
        slow.page.turn(input, angle, is_moving).await;
        quick.turn(input, angle, is_moving).await;
        quick.picture_that(|picture| picture.input == input).await;
        slow.listen(Duration::from_millis(20), input).await;
    }
    // Two at first, and one for each that is said to be seen.
    let n_drafts = slow.pictures.len();
    let most = 2.0 * (start.elapsed().as_secs_f64() / LATE.as_secs_f64() + 2.0);
    assert!(2 < n_drafts && (n_drafts as f64) < most, "{n_drafts} pictures, at most {most}");
    let is_last = |(picture, _): &(Picture, Instant)| picture.is_finished;
    let still = Instant::now();
    while !slow.pictures.last().is_some_and(is_last) {
        assert!(still.elapsed() < Duration::from_secs(60), "no finished picture");
        slow.listen(Duration::from_millis(20), n_inputs).await;
    }
    let inputs: Vec<u32> = slow.pictures.iter().map(|(picture, _)| picture.input).collect();
    assert!(inputs.is_sorted() && inputs.last() == Some(&n_inputs), "{inputs:?}");
    // Two may be on their way: each of the others was made room for by the one before the last.
    for (i, (later, seen)) in inputs[2..].iter().zip(&slow.seen).enumerate() {
        assert!(seen <= later, "picture {}: {inputs:?}, seen at {:?}", i + 2, slow.seen);
    }
}

#[tokio::test]
async fn pages_have_cameras_of_their_own() {
    let viewer = Viewer::start();
    let mut pages = Vec::new();
    for i in 0..4 {
        let mut page = Page::open(&viewer, json!({})).await;
        page.turn(1, f64::from(i), false).await;
        pages.push(page);
    }
    let mut files = Vec::new();
    for page in &mut pages {
        files.push(
            page.picture_that(|picture| picture.is_finished && picture.input == 1).await.file,
        );
    }
    files.sort();
    files.dedup();
    assert_eq!(files.len(), pages.len());
}

#[tokio::test]
async fn who_leaves_amid_a_picture_does_not_hold_up_others() {
    let viewer = Viewer::start();
    let mut other = Page::open(&viewer, json!({})).await;
    for _ in 0..3 {
        let mut page = Page::open(&viewer, json!({ "paint": MoodyRenderer::SLOW })).await;
        page.say(json!({ "type": "size", "width": 1000, "height": 1000 })).await;
        page.picture().await;
    }
    other.finished().await;
    other.turn(1, 2.0, false).await;
    other.picture_that(|picture| picture.is_finished && picture.input == 1).await;
}

/// Pictures of a moving page beside one whose pictures take a minute.
#[tokio::test]
async fn who_paints_slowly_leaves_time_to_who_moves() {
    let viewer = Viewer::start();
    let mut slow = Page::open(&viewer, json!({ "paint": MoodyRenderer::SLOW })).await;
    slow.say(json!({ "type": "size", "width": 1000, "height": 1000 })).await;
    slow.picture().await;
    let mut moving = Page::open(&viewer, json!({})).await;
    moving.picture_that(|_| true).await;
    let start = Instant::now();
    for input in 1..=10 {
        moving.turn(input, f64::from(input), true).await;
        moving.picture_that(|picture| picture.input == input).await;
    }
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}

/// Pages whose drafts take a second each and that never rest, beside one that moves.
#[tokio::test]
async fn whose_drafts_take_long_has_a_small_share_of_the_time() {
    let viewer = Viewer::start();
    let n_slow = Arc::new(AtomicU32::new(0));
    for _ in 0..3 {
        let mut page = Page::open(&viewer, json!({ "paint": MoodyRenderer::SLOWER })).await;
        page.picture_that(|_| true).await;
        let n_slow = n_slow.clone();
        tokio::spawn(async move {
            for input in 1.. {
                page.turn(input, f64::from(input), true).await;
                page.picture_that(|picture| picture.input == input).await;
                n_slow.fetch_add(1, Ordering::Relaxed);
            }
        });
    }
    let mut moving = Page::open(&viewer, json!({})).await;
    moving.picture_that(|_| true).await;
    for input in 1..=100 {
        moving.turn(input, f64::from(input), true).await;
        moving.picture_that(|picture| picture.input == input).await;
    }
    let n_slow = n_slow.load(Ordering::Relaxed);
    assert!(n_slow < 20, "{n_slow} slow pictures among 100");
}

#[tokio::test]
async fn a_renderer_that_panics_or_fails_does_so_for_one_page() {
    let viewer = Viewer::start();
    for (seed, text) in [
        (MoodyRenderer::PANIC, "internal error; please report it"),
        (MoodyRenderer::FAIL, "the cloud has no points"),
    ] {
        let mut page = Page::open(&viewer, json!({ "paint": seed })).await;
        assert_eq!(page.told("error").await["text"], text);
        viewer.still_works().await;
        page.set(1, json!({ "paint": null })).await;
        page.finished().await;
    }
}
