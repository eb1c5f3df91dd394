//! The range of values that a colour map spans.

use crate::math::Random;

/// The values shown in the first and the last colour of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    pub low: f64,
    pub high: f64,
}

impl Stretch {
    /// What surveyors' programs show: the middle 96 % of the values.
    pub const PERCENTILES: (f64, f64) = (2.0, 98.0);

    /// The percentiles of the finite among `n_values` values; `None` if there is none.
    ///
    /// Exact up to 100,000 values; of more, one is drawn from each of 100,000 equal runs, always the same.
    pub fn of(
        n_values: usize,
        value_at: impl Fn(usize) -> f64,
        (low, high): (f64, f64),
    ) -> Option<Self> {
        let mut sample: Vec<f64> =
            sample_indices(n_values).map(value_at).filter(|value| value.is_finite()).collect();
        sample.sort_unstable_by(f64::total_cmp);
        Some(Self { low: percentile(&sample, low)?, high: percentile(&sample, high)? })
    }

    /// Where `value` lies between `low` (0) and `high` (1), clamped; NaN stays NaN.
    pub fn unit(&self, value: f64) -> f32 {
        if self.low == self.high && value == self.low {
            return 0.5;
        }
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0) as f32
    }
}

const MAX_SAMPLE: usize = 100_000;

fn sample_indices(n_values: usize) -> impl Iterator<Item = usize> {
    let n_sample = n_values.min(MAX_SAMPLE);
    let start = move |run: usize| (run as u128 * n_values as u128 / n_sample as u128) as usize;
    // Drawn at random, for scans have a rhythm of their own that equal steps could fall in with.
    let mut random = Random::new(0, 0);
    (0..n_sample).map(move |run| {
        let length = start(run + 1) - start(run);
        start(run) + random.below(length as u64) as usize
    })
}

/// Linear between the ranks, as numpy does it.
fn percentile(sorted: &[f64], percent: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let rank = (percent / 100.0).clamp(0.0, 1.0) * last as f64;
    let (below, share) = (rank.floor() as usize, rank.fract());
    let above = (below + 1).min(last);
    Some(sorted[below] + share * (sorted[above] - sorted[below]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Option<Stretch> {
        Stretch::of(values.len(), |i| values[i], Stretch::PERCENTILES)
    }

    #[test]
    fn known_values_have_known_percentiles() {
        let values: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        assert_eq!(of(&values), Some(Stretch { low: 2.0, high: 98.0 }));
        assert_eq!(of(&[10.0, 20.0]), Some(Stretch { low: 10.2, high: 19.8 }));
    }

    #[test]
    fn what_is_not_finite_does_not_count() {
        let values = [f64::NAN, 5.0, f64::INFINITY, 5.0];
        assert_eq!(of(&values), Some(Stretch { low: 5.0, high: 5.0 }));
        assert_eq!(of(&[f64::NAN]), None);
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn a_sample_of_many_values_is_close_to_all() {
        let n = 1_234_567;
        let stretch = Stretch::of(n, |i| i as f64 / n as f64, Stretch::PERCENTILES).unwrap();
        assert!((stretch.low - 0.02).abs() < 1e-3 && (stretch.high - 0.98).abs() < 1e-3);
        assert!(sample_indices(n).all(|i| i < n));
    }

    #[test]
    fn values_are_placed_in_the_range() {
        let stretch = Stretch { low: 10.0, high: 20.0 };
        assert_eq!([0.0, 10.0, 15.0, 99.0].map(|v| stretch.unit(v)), [0.0, 0.0, 0.5, 1.0]);
        assert!(stretch.unit(f64::NAN).is_nan());
        let single = Stretch { low: 5.0, high: 5.0 };
        assert_eq!([4.0, 5.0, 6.0].map(|v| single.unit(v)), [0.0, 0.5, 1.0]);
    }
}
