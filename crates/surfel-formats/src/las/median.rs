//! The running median that predicts the steps between points of LAZ files.

/// A running guess at the median: of five values, the farthest out makes room for each new one.
#[derive(Clone, Copy)]
pub(super) struct Median {
    /// In ascending order.
    values: [i32; 5],
    /// True if the largest value goes next, false if the smallest.
    drops_largest: bool,
}

impl Default for Median {
    fn default() -> Self {
        Self { values: [0; 5], drops_largest: true }
    }
}

impl Median {
    pub fn get(&self) -> i32 {
        self.values[2]
    }

    pub fn add(&mut self, value: i32) {
        let values = &mut self.values;
        let middle = values[2];
        if self.drops_largest {
            // The place is found from below, so that equal values come behind.
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
    use super::*;

    #[test]
    fn it_settles_on_the_middle_and_stays_in_order() {
        let mut median = Median::default();
        for value in [5, 5, 7, 5, -100, 5, 900, 5, 6, 5] {
            median.add(value);
            assert!(median.values.is_sorted());
        }
        assert_eq!(median.get(), 5);
    }
}
