//! Round numbers: steps of 1, 2 or 5 times a power of ten.

/// Returns the largest of 1, 2 and 5 times a power of ten up to `limit`, which is positive.
pub(super) fn round_step(limit: f64) -> f64 {
    let power = 10f64.powf(limit.log10().floor());
    // The next power is tried too, as the logarithm of one may be rounded down.
    let steps = [10.0, 5.0, 2.0, 1.0].map(|factor| factor * power);
    steps.into_iter().find(|step| *step <= limit * (1.0 + 1e-9)).unwrap_or(power)
}

/// Returns the round numbers from `low` to `high`, at most about `n` of them, each with its text.
pub(super) fn ticks(low: f64, high: f64, n: usize) -> Vec<(f64, String)> {
    // Powers of ten below the least normal number round to zero.
    let is_range = f64::MIN_POSITIVE * 1e6 <= high - low && (high - low).is_finite();
    if !is_range {
        return if low.is_finite() { vec![(low, number(low, 6))] } else { Vec::new() };
    }
    let at_least = (high - low) / n.max(1) as f64;
    let mut step = round_step(at_least);
    if step < at_least * (1.0 - 1e-9) {
        // The next larger of 1, 2 and 5.
        step = [2.0, 2.5]
            .into_iter()
            .map(|factor| round_step(step * factor))
            .find(|next| at_least <= *next * (1.0 + 1e-9))
            .unwrap_or(step * 5.0);
    }
    let n_decimals = (-step.log10()).ceil().clamp(0.0, 12.0) as usize;
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    // Adding zero turns -0 into 0.
    (first..=last)
        .map(|i| (i as f64 * step + 0.0, number(i as f64 * step + 0.0, n_decimals)))
        .collect()
}

/// Returns a number with so many decimals, in scientific notation if it has very many digits.
fn number(value: f64, n_decimals: usize) -> String {
    match value.abs() {
        1e7.. => format!("{value:e}"),
        magnitude if 0.0 < magnitude && magnitude < 1e-4 => format!("{value:e}"),
        _ => {
            let text = format!("{value:.n_decimals$}");
            if n_decimals == 6 {
                text.trim_end_matches('0').trim_end_matches('.').into()
            } else {
                text
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Ticks of usual and degenerate ranges.

    use super::*;

    fn texts(low: f64, high: f64) -> Vec<String> {
        ticks(low, high, 5).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_and_within_the_range() {
        assert_eq!(texts(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(texts(3.7, 1250.0), ["500", "1000"]);
        assert_eq!(texts(-5.0, 5.0), ["-4", "-2", "0", "2", "4"]);
        assert_eq!(texts(1031.2, 1034.9), ["1032", "1033", "1034"]);
        assert_eq!(texts(2.0, 2.0), ["2"]);
        assert_eq!(texts(0.0, 5e-324), ["0"]);
        assert_eq!(texts(0.0, 1e-300).len(), 6);
        assert_eq!(texts(f64::NAN, 1.0), [] as [&str; 0]);
        assert_eq!(texts(0.0, f64::INFINITY), ["0"]);
    }

    #[test]
    fn steps_are_one_two_or_five() {
        let steps = [0.011, 0.999, 1.0, 1.9, 3.0, 7.0, 1000.0].map(round_step);
        let expected = [0.01, 0.5, 1.0, 1.0, 2.0, 5.0, 1000.0];
        assert!(steps.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{steps:?}");
    }
}
