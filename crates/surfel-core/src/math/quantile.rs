//! Quantiles: the value that a fraction of a list does not exceed, as the median.

use std::cmp::Ordering;

/// A number with a total order.
pub trait TotalOrder: Copy {
    /// Compares two numbers; NaN has a place in the order.
    fn compare(&self, other: &Self) -> Ordering;
}

impl TotalOrder for f32 {
    fn compare(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
}

impl TotalOrder for f64 {
    fn compare(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
}

impl TotalOrder for u32 {
    fn compare(&self, other: &Self) -> Ordering {
        self.cmp(other)
    }
}

/// Returns the median of values, of an even number the upper of the two in the middle; `None` if there are none.
pub fn median<T: TotalOrder>(values: impl IntoIterator<Item = T>) -> Option<T> {
    quantile(values, 0.5)
}

/// Returns the value at the rank `fraction * n_values` of the ascending order, rounded down and at most the last; `None`
/// if there are no values.
pub fn quantile<T: TotalOrder>(values: impl IntoIterator<Item = T>, fraction: f64) -> Option<T> {
    let mut values: Vec<T> = values.into_iter().collect();
    let last = values.len().checked_sub(1)?;
    let rank = ((fraction * values.len() as f64) as usize).min(last);
    Some(*values.select_nth_unstable_by(rank, T::compare).1)
}

/// Returns a quantile of some ten thousand of the values, or zero if there are none.
pub fn sampled_quantile(values: &[f32], fraction: f64) -> f32 {
    let sample = values.iter().step_by(values.len() / 10_000 + 1).copied();
    quantile(sample, fraction).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    //! Quantiles of few values, and of as many as sorting gives.

    use super::*;
    use crate::math::Random;

    #[test]
    fn few_values_have_known_quantiles() {
        assert_eq!(median::<f32>([]), None);
        assert_eq!(median([7u32]), Some(7));
        assert_eq!(median([3.0f32, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0f64, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(quantile([3.0f32, 1.0, 2.0], 0.0), Some(1.0));
        assert_eq!(quantile([3.0f32, 1.0, 2.0], 1.0), Some(3.0));
        assert_eq!(quantile([f32::NAN, 1.0, f32::NEG_INFINITY], 0.5), Some(1.0));
    }

    #[test]
    fn ranks_of_usual_fractions_are_those_of_integers() {
        let mut random = Random::new(1, 0);
        for n_values in 1..300 {
            let values: Vec<f32> = (0..n_values).map(|_| random.next_f32()).collect();
            let mut sorted = values.clone();
            sorted.sort_unstable_by(f32::total_cmp);
            for percent in [0, 1, 5, 10, 25, 50, 75, 90, 95, 99] {
                let expected = sorted[n_values * percent / 100];
                let found = quantile(values.iter().copied(), percent as f64 / 100.0);
                assert_eq!(found, Some(expected), "{percent} % of {n_values}");
            }
        }
    }
}
