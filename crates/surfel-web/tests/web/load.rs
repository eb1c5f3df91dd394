//! The pages of the load test, on a small scene.

use crate::load_clients::orbit_pages;
use crate::test_server::{TIMEOUT, TestServer};
use std::time::Duration;

/// A busy machine may need longer than the shortest run for two pictures of each page.
#[tokio::test]
async fn pages_that_orbit_get_pictures() {
    let server = TestServer::start();
    let mut duration = Duration::from_secs(1);
    loop {
        let pages = orbit_pages(&server.link, 3, duration).await.unwrap();
        assert_eq!(pages.len(), 3);
        assert!(pages.iter().all(|page| page.latencies.len() == page.n_pictures as usize));
        if pages.iter().all(|page| 1 < page.n_pictures) {
            return;
        }
        duration *= 2;
        assert!(duration < TIMEOUT, "a page got fewer than two pictures");
    }
}
