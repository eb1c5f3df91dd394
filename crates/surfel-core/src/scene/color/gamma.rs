//! Gamma: brightens colours that are dark as a whole, as photographs of dim rooms and intensities of lasers are.

use crate::image::PercentileRange;

/// Median of the encoded values below which they are brightened.
const MIN_MEDIAN: f64 = 0.3;

/// Greatest gamma that is chosen: noise in the shade is brightened too.
const MAX_GAMMA: f64 = 2.2;

/// An exponent of encoded values in [0, 1]: `value^(1 / gamma)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gamma(f64);

impl Gamma {
    /// Changes nothing.
    pub const NONE: Self = Self(1.0);

    /// Returns the given gamma, or the least one of at least 1 that lifts the median of the values to 0.3. Values of 0
    /// are ignored, as programs write them where nothing was measured.
    pub fn new(given: Option<f64>, n_values: usize, value_at: impl Fn(usize) -> f32) -> Self {
        let measured =
            |i| Some(value_at(i)).filter(|value| 0.0 < *value).map_or(f64::NAN, f64::from);
        let lifting = || {
            let median = PercentileRange::from_values(n_values, measured, (50.0, 50.0))?.low;
            Some((median.ln() / MIN_MEDIAN.ln()).clamp(1.0, MAX_GAMMA))
        };
        Self(given.or_else(lifting).unwrap_or(1.0))
    }

    /// Returns the brightened value.
    pub fn apply(self, value: f32) -> f32 {
        if self == Self::NONE { value } else { value.powf(self.0.recip() as f32) }
    }

    /// Returns the number to print, unless nothing is changed.
    pub fn described(self) -> Option<String> {
        (self != Self::NONE).then(|| format!("gamma {:.2}", self.0))
    }
}

#[cfg(test)]
mod tests {
    //! The gamma of known values.

    use super::*;

    #[test]
    fn dark_values_are_brightened_until_their_median_is_not_dark() {
        let gamma = Gamma::new(None, 101, |i| 0.002 * i as f32);
        assert!((gamma.apply(0.101) - 0.3).abs() < 0.01, "{gamma:?}");
        assert_eq!((gamma.apply(0.0), gamma.apply(1.0)), (0.0, 1.0));
        assert_eq!(Gamma::new(None, 9, |_| 1e-6), Gamma(MAX_GAMMA));
    }

    #[test]
    fn values_that_are_bright_enough_stay() {
        assert_eq!(Gamma::new(None, 101, |i| 0.01 * i as f32), Gamma::NONE);
        assert_eq!(Gamma::new(None, 0, |_| 0.0), Gamma::NONE);
        assert_eq!(Gamma::NONE.apply(0.2), 0.2);
    }

    #[test]
    fn points_without_a_measurement_do_not_count() {
        assert_eq!(Gamma::new(None, 100, |i| if i < 90 { 0.0 } else { 0.5 }), Gamma::NONE);
    }

    #[test]
    fn a_given_gamma_is_taken() {
        assert_eq!(Gamma::new(Some(0.5), 10, |_| 0.01).apply(0.5), 0.25);
    }
}
