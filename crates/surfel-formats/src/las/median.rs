//! The streaming median that predicts the steps between points of LAZ files.

/// An estimate of the median of a stream from five values, of which each new one replaces the largest or the smallest.
#[derive(Clone, Copy)]
pub(super) struct StreamingMedian5 {
    /// Values in ascending order.
    values: [i32; 5],
    /// True if the next value replaces the largest, false if the smallest.
    drops_largest: bool,
}

impl Default for StreamingMedian5 {
    fn default() -> Self {
        Self { values: [0; 5], drops_largest: true }
    }
}

impl StreamingMedian5 {
    /// Returns the estimate.
    pub fn get(&self) -> i32 {
        self.values[2]
    }

    /// Adds a value of the stream.
    pub fn add(&mut self, value: i32) {
        let values = &mut self.values;
        let middle = values[2];
        if self.drops_largest {
            // The search from below puts a new value after equal ones.
            let at = values[..4].iter().position(|v| value < *v).unwrap_or(4);
            values[at..].rotate_right(1);
            values[at] = value;
            self.drops_largest = value < middle;
        } else {
            let at = values[1..].iter().rposition(|v| *v < value).map_or(0, |at| at + 1);
            values[..=at].rotate_left(1);
            values[at] = value;
            self.drops_largest = value <= middle;
        }
    }
}

#[cfg(test)]
mod tests {
    //! The streaming median: its five values stay sorted, and its estimate converges.

    use super::*;

    #[test]
    fn values_stay_sorted_and_the_estimate_converges() {
        let mut median = StreamingMedian5::default();
        for value in [5, 5, 7, 5, -100, 5, 900, 5, 6, 5] {
            median.add(value);
            assert!(median.values.is_sorted());
        }
        assert_eq!(median.get(), 5);
    }
}
