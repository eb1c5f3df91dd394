//! The pages of the load test, on a small scene.

use crate::load_clients::orbit_pages;
use crate::test_server::TestServer;
use std::time::Duration;

#[tokio::test]
async fn pages_that_orbit_get_pictures() {
    let server = TestServer::start();
    let pages = orbit_pages(&server.link, 3, Duration::from_secs(1)).await.unwrap();
    assert_eq!(pages.len(), 3);
    for page in pages {
        assert!(1 < page.n_pictures && page.latencies.len() == page.n_pictures as usize);
    }
}
