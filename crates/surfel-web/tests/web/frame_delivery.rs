//! Delivery of pictures: their order, quality and number, and fairness between pages.

use crate::hill_provider::{FaultyRenderer, N_SAMPLES, PICTURE_SIZE, STAMP};
use crate::test_page::{JPEG, PNG, Picture, TestPage};
use crate::test_server::{TestServer, wait_until};
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

#[tokio::test]
async fn pictures_are_refined_to_the_finished_picture() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    let mut all: Vec<Picture> = Vec::new();
    while !all.last().is_some_and(|picture| picture.is_finished) {
        all.push(page.wait_for_picture(|_| true).await);
    }
    let numbers: Vec<u32> = all.iter().map(|picture| picture.number).collect();
    assert_eq!(numbers, (1..=all.len() as u32).collect::<Vec<_>>());
    assert!(all.iter().all(|picture| picture.of_samples == N_SAMPLES as u16));
    assert!(all.is_sorted_by_key(|picture| picture.samples));
    let (finished, before) = all.split_last().unwrap();
    assert!(!before.is_empty() && before.iter().all(|picture| picture.kind == JPEG));
    assert_eq!((finished.kind, finished.samples), (PNG, N_SAMPLES as u16));
    let found = finished.decode().into_rgba8();
    let expected = server.provider.finished_picture(PICTURE_SIZE);
    assert_eq!(found.dimensions(), expected.dimensions());
    // The samples are summed in another order, so their rounding differs.
    let is_close = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
    assert!(found.iter().zip(expected.iter()).all(is_close));
}

#[tokio::test]
async fn finished_pictures_go_on_at_rest() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "goes_on": true })).await;
    let finished = page.finished_picture().await;
    assert_eq!((finished.kind, finished.samples), (PNG, N_SAMPLES as u16));
    for samples in [16, 64] {
        let better = page.wait_for_picture(|_| true).await;
        assert_eq!((better.kind, better.samples, better.is_finished), (PNG, samples, true));
        assert_eq!((better.of_samples, better.seq), (N_SAMPLES as u16, finished.seq));
        let found = better.decode().into_rgba8();
        let expected = server.provider.picture(PICTURE_SIZE, samples.into());
        let is_close = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
        assert!(found.iter().zip(expected.iter()).all(is_close), "{samples}");
    }
    assert!(page.sync().await.is_empty());
    // Another view begins with its first sample.
    page.set_camera(1, 0.5, false).await;
    assert_eq!(page.finished_picture().await.samples, N_SAMPLES as u16);
}

#[tokio::test]
async fn pictures_at_rest_wait_for_the_tasks_of_others() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    let mut other = TestPage::open(&server, json!({})).await;
    other.finished_picture().await;
    other.change_settings(1, json!({ "slow": 600 })).await;
    wait_until(|| server.provider.n_started.load(Ordering::Relaxed) == 1).await;
    page.change_settings(1, json!({ "goes_on": true })).await;
    let finished = page.wait_for_picture(|picture| picture.is_finished && picture.seq == 1).await;
    assert_eq!(finished.samples, N_SAMPLES as u16);
    assert!(page.sync().await.is_empty());
    drop(other);
    assert_eq!(page.picture().await.samples, 16);
}

#[tokio::test]
async fn rasterised_points_are_drawn_once_and_whole() {
    let server = TestServer::start();
    let settings = json!({ "points": true, "fault": FaultyRenderer::WHOLE });
    let mut page = TestPage::open(&server, settings).await;
    for seq in 1..4 {
        let finished = page.finished_picture().await;
        assert_eq!((finished.samples, finished.of_samples), (1, 1));
        page.set_camera(seq, 0.1 * f64::from(seq), false).await;
    }
}

#[tokio::test]
async fn headers_describe_the_file() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    for _ in 0..3 {
        let picture = page.wait_for_picture(|_| true).await;
        let image = picture.decode();
        let size = (u32::from(picture.size.0), u32::from(picture.size.1));
        assert_eq!((image.width(), image.height()), size);
        let format = image::guess_format(picture.file()).unwrap();
        let is_jpeg = format == image::ImageFormat::Jpeg;
        assert_eq!(picture.kind, if is_jpeg { JPEG } else { PNG });
    }
}

#[tokio::test]
async fn drafts_have_the_overlay_in_full_size_and_finished_pictures_contain_it() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "stamp": true })).await;
    let draft = page.wait_for_picture(|picture| picture.samples == 1).await;
    let (whole, stamp) = (&draft.files[0], &draft.files[1]);
    assert_eq!(whole.0, [0, 0, PICTURE_SIZE.0 as u16, PICTURE_SIZE.1 as u16]);
    let [x, y, width, height] = STAMP;
    assert_eq!(stamp.0, STAMP.map(|length| length as u16));
    let stamp = image::load_from_memory(&stamp.1).unwrap().into_rgb8();
    assert_eq!(stamp.dimensions(), (width, height));
    assert!(stamp.pixels().all(|pixel| 250 < pixel.0[0] && pixel.0[1] < 5));
    let finished = page.finished_picture().await;
    assert_eq!(finished.files.len(), 1);
    let pixel_at = |x, y| finished.decode().into_rgba8().get_pixel(x, y).0;
    assert_eq!(pixel_at(x, y), [255, 0, 0, 255]);
    assert_eq!(pixel_at(x + width - 1, y + height - 1), [255, 0, 0, 255]);
    assert_ne!(pixel_at(x + width, y), [255, 0, 0, 255]);
}

#[tokio::test]
async fn pictures_carry_the_sequence_number_of_the_last_message() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    page.set_camera(7, 0.5, true).await;
    let draft = page.wait_for_picture(|picture| picture.seq == 7).await;
    assert_eq!((draft.kind, draft.samples), (JPEG, 1));
    page.set_camera(8, 1.0, false).await;
    let finished = page.finished_picture().await;
    assert!([7, 8].contains(&finished.seq));
    page.send_json(json!({ "type": "size", "width": 32, "height": 20 })).await;
    let condition = |picture: &Picture| picture.is_finished && picture.size.0 == 32;
    let smaller = page.wait_for_picture(condition).await;
    assert_eq!((smaller.size, smaller.seq), ((32, 20), 8));
}

/// Waits until the render loop has visited all clients several times.
async fn wait_for_rounds(page: &mut TestPage, first_seq: u32) {
    for seq in first_seq..first_seq + 3 {
        page.set_camera(seq, f64::from(seq), true).await;
        page.wait_for_picture(|picture| picture.seq == seq).await;
    }
}

#[tokio::test]
async fn a_page_without_acks_gets_two_pictures_and_then_the_newest() {
    let server = TestServer::start();
    let mut other = TestPage::open(&server, json!({})).await;
    let mut page = TestPage::open(&server, json!({})).await;
    let mut unacked = vec![page.picture().await, page.picture().await];
    for seq in 1..=20 {
        page.set_camera(seq, f64::from(seq), true).await;
        wait_for_rounds(&mut other, 3 * seq).await;
    }
    unacked.extend(page.sync().await);
    assert_eq!(unacked.len(), 2);
    page.acknowledge(&unacked[1]).await;
    assert_eq!(page.picture().await.seq, 20);
}

/// Number of cameras that a page sends between a picture and its acknowledgement.
const ACK_DELAY: u32 = 5;

/// A page that acknowledges pictures late.
struct SlowPage {
    page: TestPage,
    /// The pictures received, each with the sequence number at which it is acknowledged.
    pictures: Vec<(Picture, u32)>,
    /// The sequence number that had been sent at the acknowledgement of each picture.
    acked_at: Vec<u32>,
}

impl SlowPage {
    /// Receives pictures, and sends the acknowledgements that are due.
    async fn update(&mut self, seq: u32) {
        let received = self.page.sync().await;
        self.pictures.extend(received.into_iter().map(|picture| (picture, seq + ACK_DELAY)));
        while let Some((picture, due)) = self.pictures.get(self.acked_at.len())
            && *due <= seq
        {
            self.page.acknowledge(picture).await;
            self.acked_at.push(seq);
        }
    }
}

#[tokio::test]
async fn a_slow_page_gets_fewer_and_the_newest_pictures_while_another_gets_all() {
    let server = TestServer::start();
    let mut quick = TestPage::open(&server, json!({})).await;
    quick.finished_picture().await;
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    let mut slow = SlowPage { page, pictures: Vec::new(), acked_at: Vec::new() };
    let n_cameras = 40;
    for seq in 1..=n_cameras {
        let (angle, is_moving) = (f64::from(seq) / 10.0, seq < n_cameras);
        slow.page.set_camera(seq, angle, is_moving).await;
        quick.set_camera(seq, angle, is_moving).await;
        quick.wait_for_picture(|picture| picture.seq == seq).await;
        slow.update(seq).await;
    }
    // Two pictures at first, then one for each acknowledgement.
    let (n_drafts, max) = (slow.pictures.len(), 2 + slow.acked_at.len());
    assert!(2 < n_drafts && n_drafts <= max, "{n_drafts} pictures, at most {max}");
    assert!(n_drafts < n_cameras as usize / 2, "{n_drafts} pictures");
    // The camera is at rest; the remaining acknowledgements are sent as soon as possible.
    slow.pictures.iter_mut().for_each(|(_, due)| *due = 0);
    while !slow.pictures.last().is_some_and(|(picture, _)| picture.is_finished) {
        slow.update(n_cameras).await;
        slow.pictures.iter_mut().for_each(|(_, due)| *due = 0);
    }
    let seqs: Vec<u32> = slow.pictures.iter().map(|(picture, _)| picture.seq).collect();
    assert!(seqs.is_sorted() && seqs.last() == Some(&n_cameras), "{seqs:?}");
    // Two pictures may be on their way, so each further picture is newer than the ack of the last but one.
    for (i, (seq, acked_at)) in seqs[2..].iter().zip(&slow.acked_at).enumerate() {
        assert!(acked_at <= seq, "picture {}: {seqs:?}, acked at {:?}", i + 2, slow.acked_at);
    }
}

#[tokio::test]
async fn each_page_has_its_own_camera() {
    let server = TestServer::start();
    let mut pages = Vec::new();
    for i in 0..4 {
        let mut page = TestPage::open(&server, json!({})).await;
        page.set_camera(1, f64::from(i), false).await;
        pages.push(page);
    }
    let mut files = Vec::new();
    for page in &mut pages {
        let condition = |picture: &Picture| picture.is_finished && picture.seq == 1;
        files.push(page.wait_for_picture(condition).await.files);
    }
    files.sort();
    files.dedup();
    assert_eq!(files.len(), pages.len());
}

#[tokio::test]
async fn disconnecting_during_a_picture_does_not_block_others() {
    let server = TestServer::start();
    let mut other = TestPage::open(&server, json!({})).await;
    for _ in 0..3 {
        let mut page = TestPage::open(&server, json!({ "fault": FaultyRenderer::SLOW })).await;
        page.send_json(json!({ "type": "size", "width": 1000, "height": 1000 })).await;
        page.picture().await;
    }
    other.finished_picture().await;
    other.set_camera(1, 2.0, false).await;
    other.wait_for_picture(|picture| picture.is_finished && picture.seq == 1).await;
}

#[tokio::test]
async fn drafts_show_the_last_picture_at_rest_whatever_its_samples() {
    for samples in [1, 2] {
        let server = TestServer::start();
        let settings = json!({ "fault": FaultyRenderer::SLOW, "samples": samples });
        let mut page = TestPage::open(&server, settings).await;
        page.send_json(json!({ "type": "size", "width": 400, "height": 300 })).await;
        let mut is_shown = false;
        // The keyframe of a picture of one sample is made after the picture.
        for seq in 1..10 {
            page.wait_for_picture(|picture| picture.is_finished && picture.size.0 == 400).await;
            page.drain(Duration::from_millis(500 * u64::from(seq))).await;
            page.set_camera(seq, 0.0, true).await;
            let draft = page.wait_for_picture(|picture| picture.seq == seq).await;
            is_shown = draft.size == (200, 150);
            if is_shown {
                break;
            }
            page.set_camera(seq, 0.0, false).await;
        }
        assert!(is_shown, "{samples}");
    }
}

#[tokio::test]
async fn a_dragged_view_is_refined_once_it_has_stayed() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({})).await;
    page.finished_picture().await;
    let start = Instant::now();
    page.set_camera(1, 0.5, true).await;
    page.wait_for_picture(|picture| picture.seq == 1 && picture.is_finished).await;
    assert!(Duration::from_millis(100) <= start.elapsed());
}

#[tokio::test]
async fn a_picture_is_finished_although_its_layers_take_long() {
    let server = TestServer::start();
    let mut page = TestPage::open(&server, json!({ "fault": FaultyRenderer::SLOW_LAYERS })).await;
    page.wait_for_picture(|picture| picture.is_finished).await;
}

/// A finished picture of the slow page takes more than a minute.
#[tokio::test]
async fn a_slow_picture_leaves_time_to_a_moving_page() {
    let server = TestServer::start();
    let mut slow = TestPage::open(&server, json!({ "fault": FaultyRenderer::SLOW })).await;
    slow.send_json(json!({ "type": "size", "width": 1000, "height": 1000 })).await;
    slow.wait_for_picture(|_| true).await;
    let mut moving = TestPage::open(&server, json!({})).await;
    for seq in 1..=10 {
        moving.set_camera(seq, f64::from(seq), true).await;
        moving.wait_for_picture(|picture| picture.seq == seq).await;
    }
    assert!(slow.sync().await.iter().all(|picture| !picture.is_finished));
}

/// Pages that move all the time and whose drafts take a second each, beside one that moves.
#[tokio::test]
async fn slow_drafts_get_a_small_fraction_of_the_time() {
    let server = TestServer::start();
    let n_slow = Arc::new(AtomicU32::new(0));
    for _ in 0..3 {
        let mut page = TestPage::open(&server, json!({ "fault": FaultyRenderer::VERY_SLOW })).await;
        page.wait_for_picture(|_| true).await;
        let n_slow = n_slow.clone();
        tokio::spawn(async move {
            for seq in 1.. {
                page.set_camera(seq, f64::from(seq), true).await;
                page.wait_for_picture(|picture| picture.seq == seq).await;
                n_slow.fetch_add(1, Ordering::Relaxed);
            }
        });
    }
    let mut moving = TestPage::open(&server, json!({})).await;
    moving.wait_for_picture(|_| true).await;
    for seq in 1..=100 {
        moving.set_camera(seq, f64::from(seq), true).await;
        moving.wait_for_picture(|picture| picture.seq == seq).await;
    }
    let n_slow = n_slow.load(Ordering::Relaxed);
    assert!(n_slow < 20, "{n_slow} slow pictures among 100");
}

#[tokio::test]
async fn a_failing_renderer_affects_one_page() {
    let server = TestServer::start();
    for (fault, text) in [
        (FaultyRenderer::PANIC, "internal error; please report it"),
        (FaultyRenderer::FAIL, "the cloud has no points"),
    ] {
        let mut page = TestPage::open(&server, json!({ "fault": fault })).await;
        assert_eq!(page.message("error").await["text"], text);
        server.assert_serves_pictures().await;
        page.change_settings(1, json!({ "fault": null })).await;
        page.finished_picture().await;
    }
}
