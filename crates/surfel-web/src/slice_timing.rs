//! How many rows of a picture are rendered at once, by the time that the last ones took.

use crate::deadline::SLICE_TIMEOUT;

/// Intended duration of a slice of the finished picture, in seconds.
pub const SLICE_SECS: f64 = 0.015;
/// Minimum number of rows of a slice, unless rows take long: each slice has a fixed cost.
const MIN_SLICE_ROWS: u32 = 8;
/// Maximum ratio of the rows of a slice to those of the one before.
const MAX_SLICE_GROWTH: f64 = 2.0;

/// Sizes and durations of the last draft and the last slice.
#[derive(Default)]
pub struct SliceTiming {
    /// Number of rows of the last slice.
    n_rows: u32,
    secs_per_row: f64,
    /// Duration of the last draft or slice in seconds; a lower bound if it was cancelled.
    secs: f64,
}

impl SliceTiming {
    /// Returns whether even the smallest slice takes long.
    pub fn is_slow(&self) -> bool {
        2.0 * SLICE_TIMEOUT.as_secs_f64() < self.secs
    }

    /// Returns the duration of the last draft or slice in seconds; a lower bound if it was cancelled.
    pub fn secs(&self) -> f64 {
        self.secs
    }

    /// Returns the duration of a row of the last slice in seconds.
    pub fn secs_per_row(&self) -> f64 {
        self.secs_per_row
    }

    /// Records the duration of a draft. One that was cancelled would have taken longer, so it does not make a slow client
    /// a quick one.
    pub fn record(&mut self, secs: f64, is_done: bool) {
        self.secs = if is_done { secs } else { secs.max(self.secs) };
    }

    /// Records the duration of a slice.
    pub fn record_slice(&mut self, n_rows: u32, secs: f64, is_done: bool) {
        self.record(secs, is_done);
        self.n_rows = n_rows;
        self.secs_per_row = self.secs / f64::from(n_rows);
    }

    /// Returns the number of rows of the next slice.
    pub fn n_affordable_rows(&self) -> u32 {
        // Below a cheap sky, rows may take long.
        let affordable = (SLICE_SECS / self.secs_per_row.max(1e-6))
            .min(MAX_SLICE_GROWTH * f64::from(self.n_rows.max(MIN_SLICE_ROWS)));
        let is_slow = SLICE_TIMEOUT.as_secs_f64() <= f64::from(MIN_SLICE_ROWS) * self.secs_per_row;
        (affordable as u32).max(if is_slow { 1 } else { MIN_SLICE_ROWS })
    }
}

#[cfg(test)]
mod tests {
    //! Slices grow and shrink with the time that rows take.

    use super::*;

    #[test]
    fn slices_grow_to_twice_their_rows_and_shrink_at_once() {
        let mut timing = SliceTiming::default();
        let first = timing.n_affordable_rows();
        timing.record_slice(first, 1e-4, true);
        assert_eq!(timing.n_affordable_rows(), 2 * first);
        timing.record_slice(2 * first, 2.0 * SLICE_SECS, true);
        assert_eq!(timing.n_affordable_rows(), first);
        timing.record_slice(8, 2.0 * SLICE_TIMEOUT.as_secs_f64(), false);
        assert_eq!(timing.n_affordable_rows(), 1);
        assert!(!timing.is_slow());
        timing.record_slice(1, 3.0 * SLICE_TIMEOUT.as_secs_f64(), true);
        assert!(timing.is_slow());
        // A cancelled one was no quicker.
        timing.record(0.01, false);
        assert!(timing.is_slow());
    }
}
