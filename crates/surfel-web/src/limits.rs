//! What one server bears: each limit answers with an error that names it.

use std::time::{Duration, Instant};

/// Pages at once.
pub const MOST_CLIENTS: usize = 32;
/// Connections at once, pages among them.
pub const MOST_CONNECTIONS: usize = 256;
/// Pixels of the picture that a page looks at: its sums take 16 bytes each.
pub const MOST_PIXELS: u64 = 1 << 21;
/// Pixels of a picture to keep.
pub const MOST_SAVED_PIXELS: u64 = 1 << 26;
/// Camera rays of all of a picture to keep, and rays toward lights.
pub const MOST_RAYS: u64 = 1 << 34;
/// Camera rays a pixel, and rays toward lights.
pub const MOST_SAMPLES: u32 = 1024;
/// Along a side.
pub const MOST_LENGTH: u32 = 1 << 15;
/// Bytes of a message or of the body of a request.
pub const MOST_BYTES: usize = 1 << 18;
/// Pictures to keep that are made at once; others wait their turn.
pub const MOST_SAVES: usize = 2;
/// Pieces of long work at once, for all pages; others wait their turn.
pub const MOST_WORK: usize = 64;
/// Questions of one page about places in its picture at once.
pub const MOST_PICKS: usize = 4;
/// Bytes of the changes of settings that a page has asked for and does not see yet.
pub const MOST_WISHED_BYTES: usize = 1 << 19;
/// Within which a connection has to ask something, and a page to answer.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// Whether a picture of this size is made, else why not.
pub fn check_size(width: u32, height: u32, most_pixels: u64) -> Result<(), String> {
    let n_pixels = u64::from(width) * u64::from(height);
    let is_long = MOST_LENGTH < width.max(height);
    if n_pixels == 0 || is_long || most_pixels < n_pixels {
        return Err(format!(
            "picture of {width}x{height}: expected 1 to {most_pixels} pixels, \
             at most {MOST_LENGTH} along a side"
        ));
    }
    Ok(())
}

/// How many messages a client may send: so many a second in the long run, a few more at once.
pub struct Rate {
    left: f64,
    last: Instant,
}

const MESSAGES_PER_S: f64 = 400.0;
const MESSAGES_AT_ONCE: f64 = 800.0;

impl Rate {
    pub fn new(now: Instant) -> Self {
        Self { left: MESSAGES_AT_ONCE, last: now }
    }

    /// Counts a message; false if it is one too many.
    pub fn allows(&mut self, now: Instant) -> bool {
        let secs = now.saturating_duration_since(self.last).as_secs_f64();
        self.last = now;
        self.left = (self.left + secs * MESSAGES_PER_S).min(MESSAGES_AT_ONCE);
        let is_allowed = 1.0 <= self.left;
        if is_allowed {
            self.left -= 1.0;
        }
        is_allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_cut_and_a_stream_is_not() {
        let start = Instant::now();
        let mut rate = Rate::new(start);
        let n_allowed = (0..10_000).filter(|_| rate.allows(start)).count();
        assert_eq!(n_allowed, MESSAGES_AT_ONCE as usize);
        let later = |ms: u64| start + Duration::from_millis(ms);
        assert!((100..3000).step_by(8).all(|ms| rate.allows(later(ms))));
    }

    #[test]
    fn sizes_have_bounds() {
        assert!(check_size(1920, 1080, MOST_PIXELS).is_ok());
        for (width, height) in [(0, 5), (5, 0), (4096, 4096), (u32::MAX, u32::MAX), (40_000, 1)] {
            assert!(check_size(width, height, MOST_PIXELS).is_err(), "{width}x{height}");
        }
    }
}
