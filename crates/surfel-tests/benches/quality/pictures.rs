//! Pictures side by side.

use crate::selection::Selection;
use surfel_core::image::Image;
use surfel_formats::{Alpha, ImageOptions, save_image};

/// Pixels that are kept around what the first picture shows.
const MARGIN: u32 = 12;

/// Writes pictures side by side as `NAME.jpg` if the command line asks for it, cropped to what the first one shows.
pub fn write_strip(selection: &Selection, name: &str, images: &[&Image]) {
    let Some(folder) = &selection.pictures else { return };
    let (x, y) = covered(images[0]);
    let (width, height) = (x.end - x.start, y.end - y.start);
    let mut strip = Image::new(width * images.len() as u32, height);
    for (image_idx, image) in images.iter().enumerate() {
        for row in 0..height {
            let from = ((y.start + row) * image.width + x.start) as usize;
            let to = (row * strip.width + image_idx as u32 * width) as usize;
            let pixels = &image.color[from..from + width as usize];
            strip.color[to..to + width as usize].copy_from_slice(pixels);
        }
    }
    let options = ImageOptions { alpha: Alpha::Drop, ..ImageOptions::default() };
    save_image(&folder.join(format!("{name}.jpg")), &strip, &options).unwrap();
}

/// Returns the columns and rows that an image covers, with a margin.
fn covered(image: &Image) -> (std::ops::Range<u32>, std::ops::Range<u32>) {
    let pixels = (0..).zip(&image.coverage).filter(|(_, coverage)| 0.0 < **coverage);
    let pixels = pixels.map(|(i, _): (u32, _)| (i % image.width, i / image.width));
    let (mut low, mut high) = ((image.width, image.height), (0, 0));
    for (x, y) in pixels {
        low = (low.0.min(x), low.1.min(y));
        high = (high.0.max(x + 1), high.1.max(y + 1));
    }
    let range = |low: u32, high: u32, size: u32| {
        let end = (high + MARGIN).min(size);
        low.saturating_sub(MARGIN).min(end)..end
    };
    (range(low.0, high.0, image.width), range(low.1, high.1, image.height))
}
