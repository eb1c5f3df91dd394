//! How large a picture may be while things move: as large as there is time for.

/// Learns what pixels cost.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    secs_per_pixel: f64,
    /// Of the last picture, as a share of the full width.
    share: f64,
}

/// Pixels of the least picture, along its longer side.
const LEAST: f64 = 96.0;
/// Shares closer than this are taken for the same: a picture that changes its size at each frame flickers.
const HYSTERESIS: f64 = 0.2;
/// Weight of the last picture among those before.
const WEIGHT: f64 = 0.4;

impl Default for Pace {
    /// Begins with what slow machines manage.
    fn default() -> Self {
        Self { secs_per_pixel: 5e-7, share: 0.0 }
    }
}

impl Pace {
    /// Width and height of a picture that takes about `secs`, at most `full`.
    pub fn size(&mut self, full: (u32, u32), secs: f64) -> (u32, u32) {
        let (width, height) = (f64::from(full.0), f64::from(full.1));
        let affordable = (secs / self.secs_per_pixel / (width * height)).sqrt().min(1.0);
        let least = (LEAST / width.max(height)).min(1.0);
        let share = affordable.max(least);
        if HYSTERESIS * share < (share - self.share).abs() || self.share < least {
            self.share = share;
        }
        let scaled = |length: f64| (length * self.share).round().max(1.0) as u32;
        (scaled(width), scaled(height))
    }

    /// Whether no smaller picture follows one of this size, however long it takes.
    pub fn is_least((width, height): (u32, u32)) -> bool {
        f64::from(width.max(height)) < (1.0 + 2.0 * HYSTERESIS) * LEAST
    }

    /// Takes in what a picture took.
    pub fn learn(&mut self, n_pixels: u64, secs: f64) {
        let found = (secs / n_pixels.max(1) as f64).clamp(1e-10, 1e-3);
        self.secs_per_pixel += WEIGHT * (found - self.secs_per_pixel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_holds_the_time_once_the_cost_is_known() {
        let mut pace = Pace::default();
        let cost = 2e-7;
        for _ in 0..20 {
            let (width, height) = pace.size((1920, 1080), 0.025);
            let n_pixels = u64::from(width * height);
            pace.learn(n_pixels, cost * n_pixels as f64);
        }
        let (width, height) = pace.size((1920, 1080), 0.025);
        let secs = cost * f64::from(width * height);
        assert!((0.015..0.036).contains(&secs), "{width}x{height}: {secs}");
        assert!((f64::from(width) / f64::from(height) - 16.0 / 9.0).abs() < 0.02);
    }

    #[test]
    fn the_size_stays_between_something_and_everything() {
        let mut pace = Pace::default();
        (0..50).for_each(|_| pace.learn(1000, 1e-12));
        assert_eq!(pace.size((640, 360), 0.03), (640, 360));
        (0..50).for_each(|_| pace.learn(1, 10.0));
        assert_eq!(pace.size((640, 360), 0.03).0, 96);
        assert_eq!(pace.size((30, 20), 0.03), (30, 20));
    }
}
