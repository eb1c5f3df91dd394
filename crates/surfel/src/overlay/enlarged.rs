//! A small picture of a view, enlarged where something is drawn onto it.

use super::canvas::{Area, coverage};
use surfel_core::image::Image;

/// A part of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Column of the left edge in the picture.
    pub x: u32,
    /// Row of the upper edge in the picture.
    pub y: u32,
    /// The part.
    pub image: Image,
}

/// A picture as if it were enlarged to a size in pixels.
pub(super) struct Enlarged<'a> {
    pub draft: &'a Image,
    pub size: (u32, u32),
}

impl Enlarged<'_> {
    /// Returns the fraction of an area that a surface covers.
    pub fn coverage(&self, area: Area) -> f32 {
        let [x, y] = self.scale();
        let Area { x: left, y: top, width, height } = area;
        let small = Area { x: x * left, y: y * top, width: x * width, height: y * height };
        coverage(self.draft, small)
    }

    /// Returns the pixels of an area, interpolated.
    pub fn patch(&self, area: Area) -> Patch {
        let (columns, rows) = area.pixels(self.size);
        let (x, y) = (columns.start, rows.start);
        let mut image = Image::new(columns.len() as u32, rows.len() as u32);
        let pixels = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
        for (i, (x, y)) in pixels.enumerate() {
            (image.color[i], image.coverage[i]) = self.pixel(x, y);
        }
        Patch { x, y, image }
    }

    /// Pixels of the draft for one pixel of the enlarged picture.
    fn scale(&self) -> [f32; 2] {
        [
            self.draft.width as f32 / self.size.0 as f32,
            self.draft.height as f32 / self.size.1 as f32,
        ]
    }

    /// Returns colour and coverage between the four nearest pixels of the draft.
    fn pixel(&self, x: u32, y: u32) -> ([f32; 4], f32) {
        let [scale_x, scale_y] = self.scale();
        let (left, right, weight_x) = neighbors(x, scale_x, self.draft.width);
        let (top, bottom, weight_y) = neighbors(y, scale_y, self.draft.height);
        let mut color = [0.0; 4];
        let mut coverage = 0.0;
        for (row, weight_y) in [(top, 1.0 - weight_y), (bottom, weight_y)] {
            for (column, weight_x) in [(left, 1.0 - weight_x), (right, weight_x)] {
                let (i, weight) = (row * self.draft.width as usize + column, weight_x * weight_y);
                coverage += weight * self.draft.coverage[i];
                for (sum, channel) in color.iter_mut().zip(self.draft.color[i]) {
                    *sum += weight * channel;
                }
            }
        }
        (color, coverage)
    }
}

/// Returns the two of `n` pixels nearest to the centre of an enlarged pixel, and the weight of the second.
fn neighbors(pixel: u32, scale: f32, n: u32) -> (usize, usize, f32) {
    let at = ((pixel as f32 + 0.5) * scale - 0.5).clamp(0.0, (n - 1) as f32);
    let first = at as usize;
    (first, (first + 1).min(n as usize - 1), at.fract())
}
