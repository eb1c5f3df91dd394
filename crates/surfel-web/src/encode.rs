//! Encodes linear pictures for a browser: JPEG while the view changes or is refined, PNG for finished pictures.

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use rayon::prelude::*;
use surfel_core::image::{decode_srgb8, encode_srgb8, encode_srgba8};

/// Background of the page behind a transparent picture, as sRGB codes.
const PAGE_BACKGROUND: [u8; 3] = [48, 50, 54];
/// Number of pixels that a thread converts at a time.
const CHUNK_SIZE: usize = 16_384;

/// Linear pixels, premultiplied by alpha, each the sum of `weight` samples.
#[derive(Clone, Copy)]
pub struct Pixels<'p> {
    /// Width in pixels.
    pub width: u16,
    /// Height in pixels.
    pub height: u16,
    /// The sums of the samples, row by row from the top.
    pub sum: &'p [[f32; 4]],
    /// Number of samples in each sum.
    pub weight: f32,
}

/// Encodes a JPEG file of the picture over the page's background; `quality` is from 1 to 100.
pub fn jpeg(pixels: Pixels, quality: u8) -> Vec<u8> {
    let background = PAGE_BACKGROUND.map(decode_srgb8);
    let opaque = |[r, g, b, a]: [f32; 4]| {
        let over = |channel: f32, background: f32| encode_srgb8(channel + (1.0 - a) * background);
        [over(r, background[0]), over(g, background[1]), over(b, background[2])]
    };
    let bytes = bytes(pixels, opaque);
    let mut out = Vec::with_capacity(bytes.len() / 8);
    let mut encoder = Encoder::new(&mut out, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    // Encoding fails only for pictures without pixels, and there are none.
    let encoded = encoder.encode(&bytes, pixels.width, pixels.height, ColorType::Rgb);
    debug_assert!(encoded.is_ok(), "{encoded:?}");
    out
}

/// Encodes a PNG file with 8 bits a channel, and with alpha only if some pixel is not opaque.
pub fn png(pixels: Pixels) -> Vec<u8> {
    let is_opaque = pixels.sum.iter().all(|[.., a]| pixels.weight <= *a + 1e-3);
    let (color, bytes) = if is_opaque {
        (png::ColorType::Rgb, bytes(pixels, |[r, g, b, _]| [r, g, b].map(encode_srgb8)))
    } else {
        (png::ColorType::Rgba, bytes(pixels, encode_srgba8))
    };
    let mut out = Vec::with_capacity(bytes.len() / 2);
    let mut encoder =
        png::Encoder::new(&mut out, u32::from(pixels.width), u32::from(pixels.height));
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes));
    // Writing to memory does not fail.
    debug_assert!(written.is_ok(), "{written:?}");
    out
}

fn bytes<const N: usize>(pixels: Pixels, encode: impl Fn([f32; 4]) -> [u8; N] + Sync) -> Vec<u8> {
    let scale = 1.0 / pixels.weight;
    let mut bytes = vec![0; N * pixels.sum.len()];
    let chunks = bytes.par_chunks_mut(N * CHUNK_SIZE).zip(pixels.sum.par_chunks(CHUNK_SIZE));
    chunks.for_each(|(bytes, sums)| {
        for (bytes, sum) in bytes.chunks_exact_mut(N).zip(sums) {
            bytes.copy_from_slice(&encode(sum.map(|channel| scale * channel)));
        }
    });
    bytes
}

#[cfg(test)]
mod tests {
    //! Pixels that are encoded as PNG and JPEG and decoded again.

    use super::*;

    fn pixels(sum: &[[f32; 4]]) -> Pixels<'_> {
        Pixels { width: sum.len() as u16, height: 1, sum, weight: 2.0 }
    }

    #[test]
    fn a_png_keeps_every_code_and_alpha() {
        let half = [decode_srgb8(200), decode_srgb8(100), 0.0, 1.0];
        let opaque = [2.0 * decode_srgb8(17), 2.0, 0.0, 2.0];
        let image = image::load_from_memory(&png(pixels(&[half, opaque]))).unwrap().into_rgba8();
        assert_eq!(image.get_pixel(0, 0).0, [200, 100, 0, 128]);
        assert_eq!(image.get_pixel(1, 0).0, [17, 255, 0, 255]);
        let image = image::load_from_memory(&png(pixels(&[opaque]))).unwrap();
        assert_eq!(image.color(), image::ColorType::Rgb8);
    }

    #[test]
    fn a_transparent_jpeg_shows_the_background_of_the_page() {
        let sum = vec![[0.0; 4]; 64];
        let image = image::load_from_memory(&jpeg(pixels(&sum), 90)).unwrap().into_rgb8();
        let [r, g, b] = image.get_pixel(30, 0).0;
        assert!(r.abs_diff(48) < 4 && g.abs_diff(50) < 4 && b.abs_diff(54) < 4);
    }
}
