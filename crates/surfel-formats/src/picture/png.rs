//! PNG: eight or sixteen bits a channel, sRGB-encoded.

use std::io::{self, Write};
use std::path::Path;

use surfel::image::{Image, encode_srgb};

use super::{Alpha, BitDepth, ImageOptions};
use crate::atomic::{write_failed, write_file};
use crate::error::Result;

pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    write_file(path, |writer| {
        encode(writer, image, options).map_err(|source| write_failed(path, source))
    })
}

pub(super) fn write_to_stdout(image: &Image, options: &ImageOptions) -> Result<()> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    encode(&mut out, image, options)
        .and_then(|()| out.flush())
        .map_err(|source| write_failed(Path::new("-"), source))
}

fn encode(writer: impl Write, image: &Image, options: &ImageOptions) -> io::Result<()> {
    let mut encoder = png::Encoder::new(writer, image.width, image.height);
    encoder.set_color(match options.alpha {
        Alpha::Keep => png::ColorType::Rgba,
        Alpha::Drop => png::ColorType::Rgb,
    });
    encoder.set_depth(match options.depth {
        BitDepth::Eight => png::BitDepth::Eight,
        BitDepth::Sixteen => png::BitDepth::Sixteen,
    });
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&samples(image, options))?;
    writer.finish()?;
    Ok(())
}

fn samples(image: &Image, options: &ImageOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut put = |value: f32| match options.depth {
        // The casts take NaN to black.
        BitDepth::Eight => bytes.push((value * 255.0 + 0.5) as u8),
        BitDepth::Sixteen => bytes.extend(((value * 65535.0 + 0.5) as u16).to_be_bytes()),
    };
    for &[r, g, b, a] in &image.color {
        let a = a.clamp(0.0, 1.0);
        let opacity = match options.alpha {
            Alpha::Keep if 0.0 < a => a,
            _ => 1.0,
        };
        for channel in [r, g, b] {
            put(encode_srgb((channel / opacity).clamp(0.0, 1.0)));
        }
        if options.alpha == Alpha::Keep {
            put(a);
        }
    }
    bytes
}
