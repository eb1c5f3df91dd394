//! Frame rates as fractions.

/// A rate of `frames` per `seconds`, both at least 1. They have 16 bits, as in animated PNG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameRate {
    /// Numerator: a number of frames.
    pub frames: u16,
    /// Denominator: the seconds that these frames take.
    pub seconds: u16,
}

impl FrameRate {
    /// Returns the first convergent of the continued fraction of `fps` that equals it within 1e-9, or else the
    /// last one that fits in 16 bits.
    ///
    /// Returns `None` outside of 0.01 to 1000 frames per second, where the terms would not fit.
    pub fn new(fps: f64) -> Option<Self> {
        if !(0.01..=1000.0).contains(&fps) {
            return None;
        }
        let (mut previous, mut best) = ((0_u64, 1_u64), (1_u64, 0_u64));
        let mut remainder = fps;
        loop {
            let whole = remainder.floor();
            let next = (whole as u64 * best.0 + previous.0, whole as u64 * best.1 + previous.1);
            if u64::from(u16::MAX) < next.0.max(next.1) {
                break;
            }
            (previous, best) = (best, next);
            let error = best.0 as f64 / best.1 as f64 - fps;
            // The quotient below stays small: the remainder is at least as large as this error.
            if error.abs() < 1e-9 * fps {
                break;
            }
            remainder = 1.0 / (remainder - whole);
        }
        Some(Self { frames: best.0 as u16, seconds: best.1 as u16 })
    }

    /// Returns the start time of a frame in hundredths of a second, rounded.
    pub fn start_cs(self, frame: u32) -> u64 {
        let (frames, seconds) = (u64::from(self.frames), u64::from(self.seconds));
        (u64::from(frame) * 100 * seconds + frames / 2) / frames
    }
}

#[cfg(test)]
mod tests {
    //! Tests of the conversion of frame rates to fractions.

    use super::*;

    #[test]
    fn common_rates_become_simple_fractions() {
        let fraction = |fps| FrameRate::new(fps).map(|rate| (rate.frames, rate.seconds));
        assert_eq!(fraction(25.0), Some((25, 1)));
        assert_eq!(fraction(29.97), Some((2997, 100)));
        assert_eq!(fraction(30_000.0 / 1001.0), Some((30_000, 1001)));
        assert_eq!(fraction(23.976), Some((2997, 125)));
        assert_eq!(fraction(0.5), Some((1, 2)));
        assert_eq!(fraction(0.01), Some((1, 100)));
        assert_eq!(fraction(1000.0), Some((1000, 1)));
        for invalid in [0.0, -1.0, 0.001, 1001.0, f64::NAN, f64::INFINITY] {
            assert_eq!(fraction(invalid), None);
        }
    }

    #[test]
    fn rates_are_accurate_to_one_second_per_hour() {
        for step in 0..10_000 {
            let fps = 0.01 * 1e5_f64.powf(f64::from(step) / 1e4);
            let rate = FrameRate::new(fps).unwrap();
            let found = f64::from(rate.frames) / f64::from(rate.seconds);
            assert!((found / fps - 1.0).abs() < 1.0 / 3600.0, "{fps}: {rate:?}");
        }
    }
}
