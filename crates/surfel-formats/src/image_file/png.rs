//! PNG writer with 8 or 16 bits per channel, sRGB-encoded, and a reader for files it wrote.

use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;

use png::EncodingError;
use surfel_core::image::{Image, encode_srgb, encode_srgb8, encode_srgba8, unpremultiply};

use super::limits::encoder_error;
use super::options::{Alpha, BitDepth, ImageOptions};
use crate::error::{Error, Result};
use crate::file::{write_error, write_file};

/// Writes a PNG.
pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    write_file(path, |writer| {
        encode(writer, image, options).map_err(|error| png_error(path, error))
    })
}

/// Returns the bytes of the PNG file that [`save_image`](crate::save_image) writes.
///
/// # Errors
///
/// Fails if PNG cannot represent the size of the image.
pub fn encode_png(image: &Image, options: &ImageOptions) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    encode(&mut bytes, image, options)
        .map_err(|error| png_error(Path::new("an image in memory"), error))?;
    Ok(bytes)
}

/// Writes a PNG to standard output.
pub(super) fn write_to_stdout(image: &Image, options: &ImageOptions) -> Result<()> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    encode(&mut out, image, options)
        .and_then(|()| Ok(out.flush()?))
        .map_err(|error| png_error(Path::new("-"), error))
}

/// Returns the error of a picture that could not be written to `path`.
pub(crate) fn png_error(path: &Path, error: EncodingError) -> Error {
    match error {
        EncodingError::IoError(cause) => write_error(path, cause),
        refusal => encoder_error(path, refusal),
    }
}

/// Reads the samples of an image of this size that was written with the same options.
///
/// # Errors
///
/// Returns a description of the file if it cannot be read or has another size or encoding.
pub(crate) fn read(
    path: &Path,
    (width, height): (u32, u32),
    options: &ImageOptions,
) -> Result<Vec<u8>, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let decoder = png::Decoder::new(BufReader::new(file));
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let info = reader.info();
    let found = (info.width, info.height, info.color_type, info.bit_depth);
    let (color, depth) = sample_type(options);
    // The size is compared before memory is allocated for it.
    if found != (width, height, color, depth) {
        return Err(format!("{}x{} pixels of {:?} {:?}", found.0, found.1, found.2, found.3));
    }
    let mut samples = vec![0; reader.output_buffer_size().ok_or("too many pixels")?];
    reader.next_frame(&mut samples).map_err(|error| error.to_string())?;
    Ok(samples)
}

/// Returns an encoder for images with these options, before its header is written.
pub(crate) fn encoder<W: Write>(
    writer: W,
    (width, height): (u32, u32),
    options: &ImageOptions,
) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(writer, width, height);
    let (color, depth) = sample_type(options);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_pixel_dims(options.dpi.map(|dpi| {
        let pixels_per_metre = (dpi / 0.0254).round() as u32;
        png::PixelDimensions {
            xppu: pixels_per_metre,
            yppu: pixels_per_metre,
            unit: png::Unit::Meter,
        }
    }));
    encoder
}

fn sample_type(options: &ImageOptions) -> (png::ColorType, png::BitDepth) {
    let color = match options.alpha {
        Alpha::Keep => png::ColorType::Rgba,
        Alpha::Drop => png::ColorType::Rgb,
    };
    let depth = match options.depth {
        BitDepth::Eight => png::BitDepth::Eight,
        BitDepth::Sixteen => png::BitDepth::Sixteen,
    };
    (color, depth)
}

fn encode(writer: impl Write, image: &Image, options: &ImageOptions) -> Result<(), EncodingError> {
    let mut writer = encoder(writer, (image.width, image.height), options).write_header()?;
    writer.write_image_data(&samples(image, options))?;
    writer.finish()?;
    Ok(())
}

/// Returns the sRGB-encoded samples, those of 16 bits with their most significant byte first, with premultiplied alpha undone if the file has an alpha channel.
pub(super) fn samples(image: &Image, options: &ImageOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    let quantize16 = |encoded: f32| ((encoded * 65535.0 + 0.5) as u16).to_be_bytes();
    for pixel in &image.color {
        if (options.alpha, options.depth) == (Alpha::Keep, BitDepth::Eight) {
            bytes.extend(encode_srgba8(*pixel));
            continue;
        }
        let [r, g, b, a] = match options.alpha {
            Alpha::Keep => unpremultiply(*pixel),
            Alpha::Drop => *pixel,
        };
        match options.depth {
            BitDepth::Eight => bytes.extend([r, g, b].map(encode_srgb8)),
            BitDepth::Sixteen => {
                // The cast maps NaN to 0.
                let encode = |linear: f32| quantize16(encode_srgb(linear.clamp(0.0, 1.0)));
                bytes.extend([r, g, b].map(encode).as_flattened());
                if options.alpha == Alpha::Keep {
                    bytes.extend(quantize16(a));
                }
            }
        }
    }
    bytes
}
