//! The pixels that a round point covers.

/// Minimum and maximum diameter of a rasterised point in pixels.
pub const POINT_SIZE_RANGE: (f32, f32) = (1.0, 64.0);

/// A range of pixel rows, from `first` to before `end`, of a picture that is `width` pixels wide.
#[derive(Clone, Copy)]
pub(super) struct RowRange {
    pub width: usize,
    pub first: usize,
    pub end: usize,
    /// True if the right edge of the picture continues at the left one, as in a panorama.
    pub wraps: bool,
}

impl RowRange {
    /// Returns the number of pixels of the rows.
    pub fn n_pixels(self) -> usize {
        self.width * (self.end - self.first)
    }

    /// Returns the buffer index of a pixel of the picture, or `None` if it is outside of the rows.
    pub fn index(self, x: i64, y: i64) -> Option<usize> {
        let width = self.width as i64;
        let x = if self.wraps { x.rem_euclid(width) } else { x };
        let is_within =
            (0..width).contains(&x) && (self.first as i64..self.end as i64).contains(&y);
        is_within.then(|| (y as usize - self.first) * self.width + x as usize)
    }

    /// Calls `paint` with the buffer index of each pixel that a round point at `center` covers: the pixel that contains
    /// its centre, and those whose centres lie within `radius`.
    #[inline]
    pub fn for_each_covered(self, center: (f32, f32), radius: f32, mut paint: impl FnMut(usize)) {
        let (first, end) = (self.first as i64, self.end as i64);
        let (column, row) = (center.0.floor() as i64, center.1.floor() as i64);
        let (top, bottom) = covered(center.1, radius, row);
        for y in top.max(first)..=bottom.min(end - 1) {
            let across = y as f32 + 0.5 - center.1;
            let half_width = (radius * radius - across * across).max(0.0).sqrt();
            let (left, right) = if y == row {
                covered(center.0, half_width, column)
            } else {
                ends(center.0, half_width)
            };
            let start = (y - first) * self.width as i64;
            for (left, right) in self.spans(left, right) {
                (left..=right).for_each(|x| paint((start + x) as usize));
            }
        }
    }

    /// Returns the parts of the columns from `left` to `right` that lie in the picture. The second range is empty unless
    /// the picture wraps.
    fn spans(self, left: i64, right: i64) -> [(i64, i64); 2] {
        let width = self.width as i64;
        let inside = (left.max(0), right.min(width - 1));
        let beyond = match self.wraps {
            true if left < 0 => ((inside.1 + 1).max(left + width), width - 1),
            true if width <= right => (0, (inside.0 - 1).min(right - width)),
            _ => (0, -1),
        };
        [inside, beyond]
    }
}

/// Returns the first and the last pixel whose centres lie within `radius` of `center` along one axis.
fn ends(center: f32, radius: f32) -> (i64, i64) {
    ((center - radius - 0.5).ceil() as i64, (center + radius - 0.5).floor() as i64)
}

/// Returns the range of [`ends`], extended to `pixel`, which contains `center`.
fn covered(center: f32, radius: f32, pixel: i64) -> (i64, i64) {
    let (first, last) = ends(center, radius);
    (first.min(pixel), last.max(pixel))
}

#[cfg(test)]
mod tests {
    //! Round points cover the pixels of a plain loop, each once.

    use super::*;
    use crate::math::Random;

    const ROWS: RowRange = RowRange { width: 40, first: 3, end: 33, wraps: false };

    fn covered_by(rows: RowRange, center: (f32, f32), radius: f32) -> Vec<usize> {
        let mut pixels = Vec::new();
        rows.for_each_covered(center, radius, |pixel| pixels.push(pixel));
        pixels.sort_unstable();
        pixels
    }

    #[test]
    fn covered_pixels_are_those_of_a_plain_loop() {
        let mut random = Random::new(8, 0);
        for wraps in [false, true] {
            let rows = RowRange { wraps, ..ROWS };
            for _ in 0..2000 {
                // A panorama has no point beside the picture.
                let (low, size) = if wraps { (0.0, 40.0) } else { (-10.0, 60.0) };
                let center = (low + size * random.next_f32(), 60.0 * random.next_f32() - 10.0);
                let radius = 0.5 + 8.0 * random.next_f32() * random.next_f32();
                let mut expected = Vec::new();
                for y in -30..70i64 {
                    for x in -30..70i64 {
                        let offset = (x as f32 + 0.5 - center.0, y as f32 + 0.5 - center.1);
                        let is_own = (x, y) == (center.0.floor() as i64, center.1.floor() as i64);
                        let is_near = offset.0.hypot(offset.1) <= radius;
                        expected.extend(rows.index(x, y).filter(|_| is_own || is_near));
                    }
                }
                expected.sort_unstable();
                assert_eq!(covered_by(rows, center, radius), expected, "{center:?} {radius}");
            }
        }
    }

    #[test]
    fn a_point_of_one_pixel_covers_the_pixel_that_contains_it() {
        for center in [(5.0, 7.0), (5.99, 7.01), (5.5, 7.5), (5.04, 7.96)] {
            assert_eq!(covered_by(ROWS, center, 0.5), [4 * 40 + 5], "{center:?}");
        }
    }

    #[test]
    fn points_far_outside_of_the_picture_cover_nothing() {
        for far in [1e30, -1e30, f32::INFINITY, 1e9] {
            assert_eq!(covered_by(ROWS, (far, 10.0), 32.0), []);
            assert_eq!(covered_by(ROWS, (10.0, far), 32.0), []);
            assert_eq!(covered_by(RowRange { wraps: true, ..ROWS }, (10.0, far), 32.0), []);
        }
        let huge = covered_by(RowRange { wraps: true, ..ROWS }, (1.0, 10.0), 32.0);
        assert!(huge.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
