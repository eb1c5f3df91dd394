//! Dynamic resolution: the size of drafts, chosen so that a draft takes a given time.

/// Measures the cost of pixels, and chooses the size of the next draft from it.
#[derive(Clone, Copy, Debug)]
pub struct ResolutionController {
    secs_per_pixel: f64,
    /// Width of the last draft as a fraction of the full width.
    scale: f64,
}

/// Time for the drafts of one round, in seconds: a frame at 30 Hz without its encoding.
const DRAFT_SECS: f64 = 0.8 / 30.0;
/// Minimum time for one draft, in seconds; a shorter one is all overhead.
const MIN_DRAFT_SECS: f64 = 0.008;

/// Returns the time for one draft in seconds, if this many clients need one in a round.
pub fn draft_secs(n_clients: usize) -> f64 {
    (DRAFT_SECS / n_clients.max(1) as f64).max(MIN_DRAFT_SECS)
}

/// Length of the longer side of the smallest draft, in pixels.
const MIN_LENGTH: f64 = 96.0;
/// Relative change of scale below which the last scale is kept: a draft that changes its size with each frame
/// flickers.
const HYSTERESIS: f64 = 0.2;
/// Weight of the newest measurement in the moving average of the cost.
const UPDATE_RATE: f64 = 0.4;

impl Default for ResolutionController {
    /// Starts with the cost on a slow machine.
    fn default() -> Self {
        Self { secs_per_pixel: 5e-7, scale: 0.0 }
    }
}

impl ResolutionController {
    /// Width and height of a draft that takes about `secs`, at most `full`.
    pub fn size(&mut self, full: (u32, u32), secs: f64) -> (u32, u32) {
        let (width, height) = (f64::from(full.0), f64::from(full.1));
        let affordable = (secs / self.secs_per_pixel / (width * height)).sqrt().min(1.0);
        let min_scale = (MIN_LENGTH / width.max(height)).min(1.0);
        let scale = affordable.max(min_scale);
        if HYSTERESIS * scale < (scale - self.scale).abs() || self.scale < min_scale {
            self.scale = scale;
        }
        let scaled = |length: f64| (length * self.scale).round().max(1.0) as u32;
        (scaled(width), scaled(height))
    }

    /// Returns whether `size` returns no smaller draft than this one, however long it takes.
    pub fn is_min_size((width, height): (u32, u32)) -> bool {
        f64::from(width.max(height)) < (1.0 + 2.0 * HYSTERESIS) * MIN_LENGTH
    }

    /// Records that a draft of this many pixels took `secs`.
    pub fn record(&mut self, n_pixels: u64, secs: f64) {
        let measured = (secs / n_pixels.max(1) as f64).clamp(1e-10, 1e-3);
        self.secs_per_pixel += UPDATE_RATE * (measured - self.secs_per_pixel);
    }
}

#[cfg(test)]
mod tests {
    //! Sizes of drafts for a given cost of a pixel.

    use super::*;

    #[test]
    fn drafts_take_the_given_time_once_the_cost_is_known() {
        let mut controller = ResolutionController::default();
        let cost = 2e-7;
        for _ in 0..20 {
            let (width, height) = controller.size((1920, 1080), 0.025);
            let n_pixels = u64::from(width * height);
            controller.record(n_pixels, cost * n_pixels as f64);
        }
        let (width, height) = controller.size((1920, 1080), 0.025);
        let secs = cost * f64::from(width * height);
        assert!((0.015..0.036).contains(&secs), "{width}x{height}: {secs}");
        assert!((f64::from(width) / f64::from(height) - 16.0 / 9.0).abs() < 0.02);
    }

    #[test]
    fn draft_sizes_stay_between_the_minimum_and_the_full_size() {
        let mut controller = ResolutionController::default();
        (0..50).for_each(|_| controller.record(1000, 1e-12));
        assert_eq!(controller.size((640, 360), 0.03), (640, 360));
        (0..50).for_each(|_| controller.record(1, 10.0));
        assert_eq!(controller.size((640, 360), 0.03).0, 96);
        assert_eq!(controller.size((30, 20), 0.03), (30, 20));
    }
}
