//! The points of a cloud that are kept when others are dropped.

use rayon::Scope;
use rayon::prelude::*;
use std::ops::Range;

/// Number of points of a word.
const WORD_BITS: usize = u64::BITS as usize;
/// Minimum number of words that a task packs.
const WORDS_PER_TASK: usize = 1024;

/// A bit for each point from a start on, set if it is kept.
pub struct KeptPoints {
    start: usize,
    n_points: usize,
    words: Vec<u64>,
}

impl KeptPoints {
    /// Packs flags of points from `start` on.
    pub fn new(start: usize, keep: &[bool]) -> Self {
        let word = |flags: &[bool]| {
            flags.iter().enumerate().fold(0, |word, (i, flag)| word | u64::from(*flag) << i)
        };
        let words = keep.par_chunks(WORD_BITS).with_min_len(WORDS_PER_TASK).map(word).collect();
        Self { start, n_points: keep.len(), words }
    }

    /// Returns the ranges of kept points, in ascending order. No two of them touch.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        let in_words = self.words.iter().enumerate().flat_map(|(i, word)| {
            let (mut at, mut bits) = (self.start + WORD_BITS * i, *word);
            std::iter::from_fn(move || {
                if bits == 0 {
                    return None;
                }
                let n_dropped = bits.trailing_zeros();
                bits >>= n_dropped;
                let n_kept = bits.trailing_ones();
                bits = bits.checked_shr(n_kept).unwrap_or(0);
                let first = at + n_dropped as usize;
                at = first + n_kept as usize;
                Some(first..at)
            })
        });
        let mut in_words = in_words.peekable();
        std::iter::from_fn(move || {
            let mut range = in_words.next()?;
            while let Some(next) = in_words.next_if(|next| next.start == range.end) {
                range.end = next.end;
            }
            Some(range)
        })
    }

    /// Drops the other points of a column, in place.
    fn retain<T: Copy>(&self, column: &mut Vec<T>) {
        debug_assert_eq!(column.len(), self.start + self.n_points);
        let end = self.ranges().fold(self.start, |end, range| moved(column, range, end));
        column.truncate(end);
    }

    /// Drops the other points of a column, if there is one, beside other work of the scope.
    pub(super) fn retain_in<'s, T: Copy + Send + 's>(
        &'s self,
        scope: &Scope<'s>,
        column: impl Into<Option<&'s mut Vec<T>>>,
    ) {
        if let Some(column) = column.into() {
            scope.spawn(|_| self.retain(column));
        }
    }
}

/// Moves a part of a column to `end`. Returns where it ends.
fn moved<T: Copy>(column: &mut [T], part: Range<usize>, end: usize) -> usize {
    let n = part.len();
    if part.start != end {
        column.copy_within(part, end);
    }
    end + n
}

#[cfg(test)]
mod tests {
    //! Columns keep what the flags say.

    use super::*;
    use crate::math::hash;

    #[test]
    fn columns_keep_the_points_of_set_flags() {
        for n in [0, 1, 63, 64, 65, 127, 128, 1000] {
            for one_of in [1, 2, 3, 100, u64::MAX] {
                let start = n % 7;
                let keep: Vec<bool> =
                    (0..n).map(|i| !hash(i as u64).is_multiple_of(one_of)).collect();
                for keep in [keep.clone(), keep.iter().map(|flag| !flag).collect()] {
                    let column: Vec<usize> = (0..start + n).collect();
                    let is_kept = |i: &usize| *i < start || keep[*i - start];
                    let expected: Vec<usize> = column.iter().copied().filter(is_kept).collect();
                    let mut found = column;
                    let kept = KeptPoints::new(start, &keep);
                    kept.retain(&mut found);
                    assert_eq!(found, expected, "{n} {one_of}");
                    let ranges: Vec<Range<usize>> = kept.ranges().collect();
                    assert!(ranges.windows(2).all(|pair| pair[0].end < pair[1].start));
                    let in_ranges = (0..start).chain(ranges.into_iter().flatten());
                    assert_eq!(in_ranges.collect::<Vec<_>>(), expected, "{n} {one_of}");
                }
            }
        }
    }
}
