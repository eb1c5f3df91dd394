//! The order of pixels on a device: neighbours in it are neighbours in the picture, so that their rays are alike.

use crate::numbers::BAND_HEIGHT;
use rayon::iter::{IndexedParallelIterator, ParallelIterator};
use rayon::slice::ParallelSliceMut;
use surfel_core::image::Image;

/// The rows of a picture that are rendered. Their pixels are numbered in bands of `BAND_HEIGHT` rows, column by column, as
/// `shader/render/key.wgsl` does.
#[derive(Clone, Copy, Debug)]
pub struct PixelOrder {
    /// Width of the picture.
    pub width: u32,
    /// The first row.
    pub first_row: u32,
    /// Number of rows.
    pub n_rows: u32,
}

impl PixelOrder {
    /// Returns the number of pixels. Pictures have at most 2^28.
    pub fn n_pixels(&self) -> u32 {
        self.width * self.n_rows
    }

    /// Returns the column and row in the picture of the pixel with this number.
    pub fn pixel_of(&self, pixel: u32) -> (u32, u32) {
        let band = pixel / (BAND_HEIGHT * self.width);
        let row = BAND_HEIGHT * band;
        let in_band = pixel - row * self.width;
        let height = BAND_HEIGHT.min(self.n_rows - row);
        (in_band / height, self.first_row + row + in_band % height)
    }

    /// Returns the index in the image of these rows of the pixel with this number.
    pub fn image_idx(&self, pixel: u32) -> usize {
        let (column, row) = self.pixel_of(pixel);
        (row - self.first_row) as usize * self.width as usize + column as usize
    }
}

/// Sets the pixels of an image from number `first` on to colours that have their coverage in the place of alpha.
/// `background_alpha` is the alpha of the background.
pub fn set_pixels(image: &mut Image, colors: &[[f32; 4]], first: usize, background_alpha: f32) {
    let width = image.width as usize;
    let band_len = BAND_HEIGHT as usize * width;
    let end = first + colors.len();
    let bands = first / band_len..end.div_ceil(band_len);
    let of_colors = image.color.par_chunks_mut(band_len);
    let of_coverage = image.coverage.par_chunks_mut(band_len);
    let both = of_colors.zip(of_coverage).enumerate().skip(bands.start).take(bands.len());
    both.for_each(|(band, (color, coverage))| {
        let (height, start) = (color.len() / width, band * band_len);
        let within = first.max(start)..end.min(start + color.len());
        let columns = (within.start - start) / height..(within.end - start).div_ceil(height);
        for column in columns {
            for row in 0..height {
                let pixel = start + column * height + row;
                if within.contains(&pixel) {
                    let [red, green, blue, covered] = colors[pixel - first];
                    let alpha = covered + (1.0 - covered) * background_alpha;
                    color[row * width + column] = [red, green, blue, alpha];
                    coverage[row * width + column] = covered;
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    //! Every pixel of a region has one number, and comes to its place in the image.

    use super::*;

    const SIZES: [(u32, u32); 8] =
        [(1, 1), (1, 9), (9, 1), (5, 4), (7, 8), (16, 6), (3, 11), (64, 7)];

    #[test]
    fn every_pixel_has_one_number() {
        for (width, n_rows) in SIZES {
            let order = PixelOrder { width, first_row: 3, n_rows };
            let mut pixels: Vec<_> = (0..width * n_rows).map(|i| order.pixel_of(i)).collect();
            pixels.sort_by_key(|(column, row)| (*row, *column));
            let rows = (3..3 + n_rows).flat_map(|row| (0..width).map(move |column| (column, row)));
            assert_eq!(pixels, rows.collect::<Vec<_>>(), "{width} x {n_rows}");
        }
    }

    #[test]
    fn bands_are_numbered_column_by_column() {
        let order = PixelOrder { width: 3, first_row: 10, n_rows: 6 };
        let pixels = [0, 1, 4, 11, 12, 13, 14].map(|i| order.pixel_of(i));
        assert_eq!(pixels, [(0, 10), (0, 11), (1, 10), (2, 13), (0, 14), (0, 15), (1, 14)]);
    }

    #[test]
    fn pixels_come_to_their_places_part_by_part() {
        for (width, n_rows) in SIZES {
            let order = PixelOrder { width, first_row: 3, n_rows };
            let n = width * n_rows;
            let colors: Vec<[f32; 4]> = (0..n).map(|i| [i as f32, 2.0, 3.0, 0.25]).collect();
            for part_len in [1, 5, 64, 1000] {
                let mut image = Image::new(width, n_rows);
                for (i, part) in colors.chunks(part_len).enumerate() {
                    set_pixels(&mut image, part, i * part_len, 1.0);
                }
                for pixel in 0..n {
                    let idx = order.image_idx(pixel);
                    assert_eq!(image.color[idx], [pixel as f32, 2.0, 3.0, 1.0]);
                    assert_eq!(image.coverage[idx], 0.25);
                }
            }
        }
    }
}
