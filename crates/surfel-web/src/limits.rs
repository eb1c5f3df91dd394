//! The limits of a server: how much it does at once, how large requests may be, how long it waits.

use crate::scene_provider::{Error, Result};
use std::time::{Duration, Instant};

/// Limits on sizes, rates and numbers of simultaneous operations.
///
/// A request beyond a limit is answered with an error that names the limit.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Maximum number of pages that are connected at once.
    pub max_pages: usize,
    /// Maximum number of connections at once on which a request was authorised, pages included.
    pub max_connections: usize,
    /// Maximum number of other connections at once; one more closes an older one.
    pub max_pending_connections: usize,
    /// Maximum number of pixels of a page's interactive picture, whose accumulation buffer takes 16 bytes a pixel.
    pub max_view_pixels: u64,
    /// Maximum number of pixels of a saved picture.
    pub max_save_pixels: u64,
    /// Maximum number of camera rays and light samples of a saved picture together.
    pub max_rays: u64,
    /// Maximum number of pixels of all frames of a movie.
    pub max_movie_pixels: u64,
    /// Maximum number of camera rays and light samples of a movie together.
    pub max_movie_rays: u64,
    /// Maximum number of camera rays a pixel, and of light samples.
    pub max_samples: u32,
    /// Maximum width and height of any picture, in pixels.
    pub max_side_length: u32,
    /// Maximum size of a page's message or a request's body, in bytes.
    pub max_message_bytes: usize,
    /// Maximum number of saved pictures, movies and files of points that are made at once, for all clients.
    pub max_renders: usize,
    /// Maximum number of blocking tasks at once, for all clients; further tasks wait.
    pub max_tasks: usize,
    /// Maximum number of one page's saved pictures, movies, files of points and added files that are made or on their way.
    pub max_page_saves: usize,
    /// Maximum number of one page's questions at once: picks, profiles, volumes, histograms and exports.
    pub max_page_queries: usize,
    /// Maximum number of files that one page adds to its view.
    pub max_page_files: usize,
    /// Maximum size of a file that a page adds, as it is sent and as it is read, in bytes.
    pub max_added_file_bytes: u64,
    /// Maximum size of the files that all pages add, in bytes.
    pub max_added_bytes: u64,
    /// Maximum size of one page's settings changes that have not taken effect, in bytes.
    pub max_pending_bytes: usize,
    /// Maximum number of messages a second, acknowledgements aside, that a page may send in the long run.
    pub max_message_rate: f64,
    /// Maximum number of messages, acknowledgements aside, that a page may send at once.
    pub max_message_burst: f64,
    /// Durations after which the server stops waiting.
    pub timeouts: Timeouts,
}

/// Durations after which the server stops waiting for a client.
#[derive(Clone, Copy, Debug)]
pub struct Timeouts {
    /// Maximum duration until a request's head, its body, or a page's first message has arrived.
    pub request: Duration,
    /// Maximum duration for which a client may not read what is sent to it.
    pub write: Duration,
    /// Interval between two pings of a page.
    pub ping_interval: Duration,
    /// Maximum duration without any message or pong from a page.
    pub idle: Duration,
    /// Least duration for which a scene is prepared on although newer settings wait. It grows to what a preparation takes:
    /// else nothing would be shown while a slider is dragged.
    pub stale_update: Duration,
    /// Duration after the last page has gone until what was made for pages is freed. A page that is loaded again comes
    /// back sooner.
    pub release: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_pages: 32,
            max_connections: 192,
            max_pending_connections: 64,
            max_view_pixels: 1 << 23,
            max_save_pixels: 1 << 26,
            max_rays: 1 << 34,
            max_movie_pixels: 1 << 32,
            max_movie_rays: 1 << 38,
            max_samples: 1024,
            max_side_length: 1 << 15,
            max_message_bytes: 1 << 18,
            max_renders: 2,
            max_tasks: 64,
            max_page_saves: 2,
            max_page_queries: 4,
            max_page_files: 32,
            max_added_file_bytes: 1 << 29,
            max_added_bytes: 1 << 31,
            max_pending_bytes: 1 << 19,
            max_message_rate: 400.0,
            max_message_burst: 800.0,
            timeouts: Timeouts::default(),
        }
    }
}

impl Default for Timeouts {
    fn default() -> Self {
        Self {
            request: Duration::from_secs(20),
            write: Duration::from_secs(20),
            ping_interval: Duration::from_secs(10),
            idle: Duration::from_secs(30),
            stale_update: Duration::from_secs(1),
            release: Duration::from_secs(30),
        }
    }
}

impl Limits {
    /// Checks the size of a page's interactive picture.
    ///
    /// # Errors
    ///
    /// Fails if the picture has no pixels, too many, or too long a side.
    pub fn check_view_size(&self, width: u32, height: u32) -> Result<()> {
        self.check_size(width, height, self.max_view_pixels)
    }

    /// Checks the size of a saved picture.
    ///
    /// # Errors
    ///
    /// Fails if the picture has no pixels, too many, or too long a side.
    pub fn check_save_size(&self, width: u32, height: u32) -> Result<()> {
        self.check_size(width, height, self.max_save_pixels)
    }

    /// Checks the numbers of camera rays and light samples a pixel.
    ///
    /// # Errors
    ///
    /// Fails with the key of the number that is too large.
    pub fn check_samples(&self, spp: u32, light_samples: u32) -> Result<()> {
        let max_samples = self.max_samples;
        for (key, found) in [("spp", spp), ("light_samples", light_samples)] {
            if max_samples < found {
                let text = format!("found {found}, expected at most {max_samples}");
                return Err(Error::invalid_value(key, text));
            }
        }
        Ok(())
    }

    /// Checks the size of a saved picture, and the work that it takes with a number of rays a pixel.
    ///
    /// # Errors
    ///
    /// Fails for pictures that would fill the memory or take days.
    pub fn check_save(&self, (width, height): (u32, u32), rays_per_pixel: u64) -> Result<()> {
        self.check_save_size(width, height)?;
        let (n_rays, max_rays) =
            (u64::from(width) * u64::from(height) * rays_per_pixel, self.max_rays);
        if max_rays < n_rays {
            let text = format!("{n_rays} rays, expected at most {max_rays}; choose fewer samples");
            return Err(Error::invalid_value("resolution", text));
        }
        Ok(())
    }

    /// Checks the size of a movie, and the work that it takes with a number of rays a pixel.
    ///
    /// # Errors
    ///
    /// Fails for movies that would fill the disk or take days.
    pub fn check_movie(
        &self,
        (width, height): (u32, u32),
        rays_per_pixel: u64,
        n_frames: u32,
    ) -> Result<()> {
        self.check_save_size(width, height)?;
        let n_pixels = u64::from(width) * u64::from(height) * u64::from(n_frames);
        let counts = [
            (n_pixels, self.max_movie_pixels, "pixels", "a smaller or shorter movie"),
            (n_pixels.saturating_mul(rays_per_pixel), self.max_movie_rays, "rays", "fewer samples"),
        ];
        for (found, limit, what, advice) in counts {
            if limit < found {
                let text =
                    format!("a movie of {found} {what}, expected at most {limit}; choose {advice}");
                return Err(Error::invalid_request(text));
            }
        }
        Ok(())
    }

    fn check_size(&self, width: u32, height: u32, max_pixels: u64) -> Result<()> {
        let n_pixels = u64::from(width) * u64::from(height);
        let max_side = self.max_side_length;
        if n_pixels == 0 || max_side < width.max(height) || max_pixels < n_pixels {
            return Err(Error::invalid_request(format!(
                "picture of {width}x{height}: expected 1 to {max_pixels} pixels, \
                 at most {max_side} along a side"
            )));
        }
        Ok(())
    }
}

/// A token bucket that limits the rate of a client's messages.
pub struct RateLimiter {
    max_rate: f64,
    max_burst: f64,
    n_tokens: f64,
    last_refill: Instant,
}

impl RateLimiter {
    /// A full bucket at the time `now`.
    pub fn new(limits: &Limits, now: Instant) -> Self {
        let (max_rate, max_burst) = (limits.max_message_rate, limits.max_message_burst);
        Self { max_rate, max_burst, n_tokens: max_burst, last_refill: now }
    }

    /// Counts a message at the time `now`; returns false if it exceeds the rate.
    pub fn allows(&mut self, now: Instant) -> bool {
        let secs = now.saturating_duration_since(self.last_refill).as_secs_f64();
        self.last_refill = now;
        self.n_tokens = (self.n_tokens + secs * self.max_rate).min(self.max_burst);
        let is_allowed = 1.0 <= self.n_tokens;
        if is_allowed {
            self.n_tokens -= 1.0;
        }
        is_allowed
    }
}

#[cfg(test)]
mod tests {
    //! Limits on the rate of messages, on the sizes of pictures and on samples.

    use super::*;

    #[test]
    fn a_flood_is_cut_and_a_steady_stream_is_not() {
        let (limits, start) = (Limits::default(), Instant::now());
        let mut limiter = RateLimiter::new(&limits, start);
        let n_allowed = (0..10_000).filter(|_| limiter.allows(start)).count();
        assert_eq!(n_allowed, limits.max_message_burst as usize);
        let later = |ms: u64| start + Duration::from_millis(ms);
        assert!((100..3000).step_by(8).all(|ms| limiter.allows(later(ms))));
    }

    #[test]
    fn picture_sizes_are_checked() {
        let limits = Limits::default();
        assert!(limits.check_view_size(1920, 1080).is_ok());
        for (width, height) in [(0, 5), (5, 0), (4096, 4096), (u32::MAX, u32::MAX), (40_000, 1)] {
            assert!(limits.check_view_size(width, height).is_err(), "{width}x{height}");
        }
        assert!(limits.check_save_size(4096, 4096).is_ok());
        assert!(limits.check_save_size(9000, 9000).is_err());
        assert!(limits.check_save((4096, 4096), 1024).is_ok());
        assert!(limits.check_save((4096, 4096), 1025).is_err());
        assert!(limits.check_movie((1920, 1080), 20, 1800).is_ok());
        assert!(limits.check_movie((1920, 1080), 20, 3600).is_err());
        assert!(limits.check_movie((1920, 1080), 200, 1800).is_err());
        assert!(limits.check_movie((1, 0), 1, 1).is_err());
    }

    #[test]
    fn too_many_samples_are_named_by_their_key() {
        let limits = Limits::default();
        assert!(limits.check_samples(1024, 1024).is_ok());
        assert_eq!(limits.check_samples(1025, 1).unwrap_err().key(), Some("spp"));
        assert_eq!(limits.check_samples(1, 1025).unwrap_err().key(), Some("light_samples"));
    }
}
