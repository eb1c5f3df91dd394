//! Frames a second, as a fraction.

/// `frames` in `seconds`, both at least 1, in the 16 bits that PNG has for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rate {
    pub frames: u16,
    pub seconds: u16,
}

impl Rate {
    /// The simplest fraction that is `fps`, else the nearest of its continued fraction that fits.
    ///
    /// None outside of 0.01 to 1000 frames a second, where the parts would not fit.
    pub fn new(fps: f64) -> Option<Self> {
        if !(0.01..=1000.0).contains(&fps) {
            return None;
        }
        let (mut before, mut best) = ((0_u64, 1_u64), (1_u64, 0_u64));
        let mut rest = fps;
        loop {
            let whole = rest.floor();
            let next = (whole as u64 * best.0 + before.0, whole as u64 * best.1 + before.1);
            if u64::from(u16::MAX) < next.0.max(next.1) {
                break;
            }
            (before, best) = (best, next);
            let error = best.0 as f64 / best.1 as f64 - fps;
            // The division below stays small: what is left over is no less than this error.
            if error.abs() < 1e-9 * fps {
                break;
            }
            rest = 1.0 / (rest - whole);
        }
        Some(Self { frames: best.0 as u16, seconds: best.1 as u16 })
    }

    /// Hundredths of a second, rounded, from the film's start to that of a frame.
    pub fn start_cs(self, frame: u32) -> u64 {
        let (frames, seconds) = (u64::from(self.frames), u64::from(self.seconds));
        (u64::from(frame) * 100 * seconds + frames / 2) / frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_simple_fractions() {
        let fraction = |fps| Rate::new(fps).map(|rate| (rate.frames, rate.seconds));
        assert_eq!(fraction(25.0), Some((25, 1)));
        assert_eq!(fraction(29.97), Some((2997, 100)));
        assert_eq!(fraction(30_000.0 / 1001.0), Some((30_000, 1001)));
        assert_eq!(fraction(23.976), Some((2997, 125)));
        assert_eq!(fraction(0.5), Some((1, 2)));
        assert_eq!(fraction(0.01), Some((1, 100)));
        assert_eq!(fraction(1000.0), Some((1000, 1)));
        for wrong in [0.0, -1.0, 0.001, 1001.0, f64::NAN, f64::INFINITY] {
            assert_eq!(fraction(wrong), None);
        }
    }

    #[test]
    fn any_rate_is_met_within_a_second_in_an_hour() {
        for step in 0..10_000 {
            let fps = 0.01 * 1e5_f64.powf(f64::from(step) / 1e4);
            let rate = Rate::new(fps).unwrap();
            let found = f64::from(rate.frames) / f64::from(rate.seconds);
            assert!((found / fps - 1.0).abs() < 1.0 / 3600.0, "{fps}: {rate:?}");
        }
    }
}
