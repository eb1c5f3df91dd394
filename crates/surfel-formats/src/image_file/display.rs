//! Writes JPEG, WebP and TIFF: pictures to be looked at, by the encoders of the crate `image`.

use std::borrow::Cow;
use std::io::{self, Cursor};
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::tiff::TiffEncoder;
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageResult};
use surfel_core::image::Image;

use super::options::{Alpha, BitDepth, ImageOptions};
use super::png::samples;
use crate::error::Result;
use crate::file::{write_error, write_file};

/// Quality of JPEG from 1 to 100: at 92, differences are seen only beside the original.
const JPEG_QUALITY: u8 = 92;

/// A format of pictures to be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DisplayFormat {
    /// 8 bits per channel, without alpha: transparent pictures are composited over white.
    Jpeg,
    /// 8 bits per channel, lossless.
    WebP,
    /// 8 or 16 bits per channel, uncompressed.
    Tiff,
}

impl DisplayFormat {
    /// Returns the format of files with this extension, in lower case.
    pub fn from_extension(extension: &str) -> Option<Self> {
        Some(match extension {
            "jpg" | "jpeg" => Self::Jpeg,
            "webp" => Self::WebP,
            "tif" | "tiff" => Self::Tiff,
            _ => return None,
        })
    }
}

/// Writes a picture.
pub(super) fn write(
    path: &Path,
    image: &Image,
    options: &ImageOptions,
    format: DisplayFormat,
) -> Result<()> {
    let encoded = encode(image, options, format).map_err(io::Error::other);
    let bytes = encoded.map_err(|source| write_error(path, source))?;
    write_file(path, |writer| {
        io::Write::write_all(writer, &bytes).map_err(|source| write_error(path, source))
    })
}

fn encode(image: &Image, options: &ImageOptions, format: DisplayFormat) -> ImageResult<Vec<u8>> {
    let depth = if format == DisplayFormat::Tiff { options.depth } else { BitDepth::Eight };
    let (image, alpha) = match (format, options.alpha) {
        (DisplayFormat::Jpeg, Alpha::Keep) => (Cow::Owned(over_white(image)), Alpha::Drop),
        (_, alpha) => (Cow::Borrowed(image), alpha),
    };
    let mut samples = samples(&image, &ImageOptions { depth, alpha, ..*options });
    let color = match (alpha, depth) {
        (Alpha::Drop, BitDepth::Eight) => ExtendedColorType::Rgb8,
        (Alpha::Keep, BitDepth::Eight) => ExtendedColorType::Rgba8,
        (Alpha::Drop, BitDepth::Sixteen) => ExtendedColorType::Rgb16,
        (Alpha::Keep, BitDepth::Sixteen) => ExtendedColorType::Rgba16,
    };
    if depth == BitDepth::Sixteen {
        // PNG has the most significant byte first, the encoder takes the machine's order.
        for sample in samples.as_chunks_mut().0 {
            *sample = u16::from_be_bytes(*sample).to_ne_bytes();
        }
    }
    let mut file = Cursor::new(Vec::new());
    let (width, height) = (image.width, image.height);
    match format {
        DisplayFormat::Jpeg => JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY)
            .write_image(&samples, width, height, color)?,
        DisplayFormat::WebP => {
            WebPEncoder::new_lossless(&mut file).write_image(&samples, width, height, color)?;
        }
        DisplayFormat::Tiff => {
            TiffEncoder::new(&mut file).write_image(&samples, width, height, color)?;
        }
    }
    Ok(file.into_inner())
}

/// Returns the picture composited over white.
fn over_white(image: &Image) -> Image {
    let mut opaque = image.clone();
    for pixel in &mut opaque.color {
        let behind = 1.0 - pixel[3].clamp(0.0, 1.0);
        pixel.iter_mut().for_each(|channel| *channel += behind);
    }
    opaque
}
