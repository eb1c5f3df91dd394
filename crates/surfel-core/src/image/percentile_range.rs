//! The range of values that a colour map spans.

use crate::math::Random;

/// The values that have the first and the last colour of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PercentileRange {
    /// Value of the first colour.
    pub low: f64,
    /// Value of the last colour.
    pub high: f64,
}

/// Returns true for a number that a column states; false for NaN and from `f32::MAX` on, which programs write where a
/// value is missing.
pub fn is_data(value: f64) -> bool {
    value.abs() < f64::from(f32::MAX)
}

impl PercentileRange {
    /// The percentiles that survey programs use: the middle 96 % of the values.
    pub const DEFAULT_PERCENTILES: (f64, f64) = (2.0, 98.0);

    /// Returns the range between two percentiles of the values that are data ([`is_data`]), or none if there are none.
    ///
    /// The result is exact up to 100,000 values. Of more values, it uses a reproducible random one of each of 100,000
    /// equal runs.
    pub fn from_values(
        n_values: usize,
        value_at: impl Fn(usize) -> f64,
        (low, high): (f64, f64),
    ) -> Option<Self> {
        let mut sample: Vec<f64> =
            sample_indices(n_values).map(value_at).filter(|value| is_data(*value)).collect();
        sample.sort_unstable_by(f64::total_cmp);
        Some(Self { low: percentile(&sample, low)?, high: percentile(&sample, high)? })
    }

    /// Maps a value from `low` to `high` to [0, 1] and clamps it. NaN stays NaN.
    pub fn normalize(&self, value: f64) -> f32 {
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
    // Random, as equal steps could be in phase with the scan lines.
    let mut random = Random::new(0, 0);
    (0..n_sample).map(move |run| {
        let length = start(run + 1) - start(run);
        start(run) + random.below(length as u64) as usize
    })
}

/// Interpolates linearly between the ranks, as numpy does.
fn percentile(sorted: &[f64], percent: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let rank = (percent / 100.0).clamp(0.0, 1.0) * last as f64;
    let (below, fraction) = (rank.floor() as usize, rank.fract());
    let above = (below + 1).min(last);
    Some(sorted[below] + fraction * (sorted[above] - sorted[below]))
}

#[cfg(test)]
mod tests {
    //! Percentiles of known values.

    use super::*;

    fn range(values: &[f64]) -> Option<PercentileRange> {
        PercentileRange::from_values(
            values.len(),
            |i| values[i],
            PercentileRange::DEFAULT_PERCENTILES,
        )
    }

    #[test]
    fn known_values_have_known_percentiles() {
        let values: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        assert_eq!(range(&values), Some(PercentileRange { low: 2.0, high: 98.0 }));
        assert_eq!(range(&[10.0, 20.0]), Some(PercentileRange { low: 10.2, high: 19.8 }));
    }

    #[test]
    fn values_that_are_no_data_are_ignored() {
        let values = [f64::NAN, 5.0, f64::INFINITY, 5.0, f64::MAX, f64::from(f32::MIN)];
        assert_eq!(range(&values), Some(PercentileRange { low: 5.0, high: 5.0 }));
        assert_eq!(range(&[f64::NAN]), None);
        assert_eq!(range(&[]), None);
    }

    #[test]
    fn a_sample_approximates_the_percentiles_of_many_values() {
        let n = 1_234_567;
        let range = PercentileRange::from_values(
            n,
            |i| i as f64 / n as f64,
            PercentileRange::DEFAULT_PERCENTILES,
        )
        .unwrap();
        assert!((range.low - 0.02).abs() < 1e-3 && (range.high - 0.98).abs() < 1e-3);
        assert!(sample_indices(n).all(|i| i < n));
    }

    #[test]
    fn values_are_normalized_and_clamped() {
        let range = PercentileRange { low: 10.0, high: 20.0 };
        assert_eq!([0.0, 10.0, 15.0, 99.0].map(|v| range.normalize(v)), [0.0, 0.0, 0.5, 1.0]);
        assert!(range.normalize(f64::NAN).is_nan());
        let single = PercentileRange { low: 5.0, high: 5.0 };
        assert_eq!([4.0, 5.0, 6.0].map(|v| single.normalize(v)), [0.0, 0.5, 1.0]);
    }
}
