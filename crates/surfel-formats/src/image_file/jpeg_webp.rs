//! Writes JPEG and WebP: pictures to be looked at, by the encoders of the crate `image`.

use std::borrow::Cow;
use std::io::{Cursor, Write};
use std::path::Path;

use image::codecs::jpeg::{JpegEncoder, PixelDensity};
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageResult};
use surfel_core::image::Image;

use super::limits::encoder_error;
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
}

impl DisplayFormat {
    /// Returns the format of files with this extension, in lower case.
    pub fn from_extension(extension: &str) -> Option<Self> {
        Some(match extension {
            "jpg" | "jpeg" => Self::Jpeg,
            "webp" => Self::WebP,
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
    let encoded = encode(image, options, format);
    let bytes = encoded.map_err(|refusal| encoder_error(path, refusal))?;
    write_file(path, |writer| writer.write_all(&bytes).map_err(|cause| write_error(path, cause)))
}

/// Returns the bytes of the file. No disk is used, so that each error is the encoder's.
fn encode(image: &Image, options: &ImageOptions, format: DisplayFormat) -> ImageResult<Vec<u8>> {
    let (image, alpha) = match (format, options.alpha) {
        (DisplayFormat::Jpeg, Alpha::Keep) => (Cow::Owned(over_white(image)), Alpha::Drop),
        (_, alpha) => (Cow::Borrowed(image), alpha),
    };
    let samples = samples(&image, &ImageOptions { depth: BitDepth::Eight, alpha, ..*options });
    let color = match alpha {
        Alpha::Drop => ExtendedColorType::Rgb8,
        Alpha::Keep => ExtendedColorType::Rgba8,
    };
    let mut file = Cursor::new(Vec::new());
    let (width, height) = (image.width, image.height);
    match format {
        DisplayFormat::Jpeg => {
            let mut encoder = JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY);
            if let Some(dpi) = options.dpi {
                encoder.set_pixel_density(PixelDensity::dpi(dpi.round() as u16));
            }
            encoder.write_image(&samples, width, height, color)?;
        }
        DisplayFormat::WebP => {
            WebPEncoder::new_lossless(&mut file).write_image(&samples, width, height, color)?;
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
