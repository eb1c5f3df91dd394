//! The order of pixels on a device: neighbours in it are neighbours in the picture, so that their rays are alike.

use crate::numbers::BAND_HEIGHT;
use crate::threads::for_each;
use surfel_core::image::Image;
use surfel_core::render::RenderRegion;

/// Minimum number of pixels of a piece: for one, a thread is worth its start, which takes some ten microseconds.
const PIXELS_OF_PIECE: usize = 1 << 16;

/// The rows and columns of a picture that are rendered. Their pixels are numbered in bands of `BAND_HEIGHT` rows, column by
/// column, as `shader/render/key.wgsl` does.
#[derive(Clone, Copy, Debug)]
pub struct PixelOrder {
    /// The first row.
    pub first_row: u32,
    /// Number of rows.
    pub n_rows: u32,
    /// The first column.
    pub first_column: u32,
    /// Number of columns.
    pub n_columns: u32,
}

impl PixelOrder {
    /// Returns the order of the pixels of a region.
    pub fn new(region: &RenderRegion) -> Self {
        Self {
            first_row: region.rows.0,
            n_rows: region.n_rows(),
            first_column: region.columns.0,
            n_columns: region.n_columns(),
        }
    }

    /// Returns the number of pixels. Pictures have at most 2^28.
    pub fn n_pixels(&self) -> u32 {
        self.n_columns * self.n_rows
    }

    /// Returns the column and row in the picture of the pixel with this number.
    pub fn pixel_of(&self, pixel: u32) -> (u32, u32) {
        let band = pixel / (BAND_HEIGHT * self.n_columns);
        let row = BAND_HEIGHT * band;
        let in_band = pixel - row * self.n_columns;
        let height = BAND_HEIGHT.min(self.n_rows - row);
        (self.first_column + in_band / height, self.first_row + row + in_band % height)
    }

    /// Returns the index in the image of these rows and columns of the pixel with this number.
    pub fn image_idx(&self, pixel: u32) -> usize {
        let (column, row) = self.pixel_of(pixel);
        let (column, row) = (column - self.first_column, row - self.first_row);
        row as usize * self.n_columns as usize + column as usize
    }
}

/// Sets the pixels of an image from number `first` on to colours with coverage as their fourth component.
/// `background_alpha` is the alpha of the background.
pub fn set_pixels(image: &mut Image, colors: &[[f32; 4]], first: usize, background_alpha: f32) {
    let part = PixelSpan { colors, first, width: image.width as usize, background_alpha };
    let band_len = part.band_len();
    let end = first + colors.len();
    let bands = first / band_len..end.div_ceil(band_len);
    let (start, end) = (bands.start * band_len, image.color.len().min(bands.end * band_len));
    let len = band_len * PIXELS_OF_PIECE.div_ceil(band_len);
    let of_colors = image.color[start..end].chunks_mut(len);
    let of_coverage = image.coverage[start..end].chunks_mut(len);
    let pieces = (start..end).step_by(len).zip(of_colors.zip(of_coverage)).collect();
    for_each(pieces, |(start, (color, coverage))| part.set_bands(start, color, coverage));
}

/// The pixels of a part of a picture.
#[derive(Clone, Copy)]
struct PixelSpan<'a> {
    colors: &'a [[f32; 4]],
    /// Number of the first pixel.
    first: usize,
    /// Width of the picture.
    width: usize,
    background_alpha: f32,
}

impl PixelSpan<'_> {
    fn band_len(&self) -> usize {
        BAND_HEIGHT as usize * self.width
    }

    /// Sets the pixels in bands whose first pixel has the number `start`.
    fn set_bands(&self, start: usize, color: &mut [[f32; 4]], coverage: &mut [f32]) {
        let band_len = self.band_len();
        let bands = color.chunks_mut(band_len).zip(coverage.chunks_mut(band_len));
        for (band, (color, coverage)) in bands.enumerate() {
            self.set_band(start + band * band_len, color, coverage);
        }
    }

    fn set_band(&self, start: usize, color: &mut [[f32; 4]], coverage: &mut [f32]) {
        let Self { colors, first, width, background_alpha } = *self;
        let height = color.len() / width;
        let within = first.max(start)..(first + colors.len()).min(start + color.len());
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
    }
}

#[cfg(test)]
mod tests {
    //! Every pixel of a region has one number, and comes to its place in the image.

    use super::*;

    const SIZES: [(u32, u32); 8] =
        [(1, 1), (1, 9), (9, 1), (5, 4), (7, 8), (16, 6), (3, 11), (64, 7)];

    fn order(n_columns: u32, n_rows: u32) -> PixelOrder {
        PixelOrder { first_row: 3, n_rows, first_column: 5, n_columns }
    }

    #[test]
    fn every_pixel_has_one_number() {
        for (width, n_rows) in SIZES {
            let order = order(width, n_rows);
            let mut pixels: Vec<_> = (0..width * n_rows).map(|i| order.pixel_of(i)).collect();
            pixels.sort_by_key(|(column, row)| (*row, *column));
            let columns = 5..5 + width;
            let rows =
                (3..3 + n_rows).flat_map(|row| columns.clone().map(move |column| (column, row)));
            assert_eq!(pixels, rows.collect::<Vec<_>>(), "{width} x {n_rows}");
        }
    }

    #[test]
    fn bands_are_numbered_column_by_column() {
        let pixels = [0, 1, 4, 11, 12, 13, 14].map(|i| order(3, 6).pixel_of(i));
        assert_eq!(pixels, [(5, 3), (5, 4), (6, 3), (7, 6), (5, 7), (5, 8), (6, 7)]);
    }

    fn check_parts((width, n_rows): (u32, u32), part_len: usize) {
        let order = order(width, n_rows);
        let colors: Vec<[f32; 4]> =
            (0..order.n_pixels()).map(|i| [i as f32, 2.0, 3.0, 0.25]).collect();
        let mut image = Image::new(width, n_rows);
        for (i, part) in colors.chunks(part_len).enumerate() {
            set_pixels(&mut image, part, i * part_len, 1.0);
        }
        for pixel in 0..order.n_pixels() {
            let idx = order.image_idx(pixel);
            assert_eq!(image.color[idx], [pixel as f32, 2.0, 3.0, 1.0]);
            assert_eq!(image.coverage[idx], 0.25);
        }
    }

    #[test]
    fn pixels_come_to_their_places_part_by_part() {
        for size in SIZES {
            for part_len in [1, 5, 64, 1000] {
                check_parts(size, part_len);
            }
        }
    }

    #[test]
    fn pixels_come_to_their_places_in_several_threads() {
        for n_threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            let n = 5 * PIXELS_OF_PIECE;
            pool.install(|| check_parts((701, 701), n + 3));
        }
    }
}
