//! Decodes PNG and JPEG pictures to textures.

use std::io::Cursor;
use surfel_core::words::counted;

use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use surfel_core::scene::Texture;

use crate::error::{Error, Location, Result};

/// Maximum number of texels on a side.
const MAX_SIDE: u32 = 16384;

/// Maximum number of texels per byte of a file: deflate packs at most 1032 bytes in one, of eight one-bit texels each.
const MAX_TEXELS_PER_BYTE: u64 = 8 * 1032;

/// Decodes the PNG or JPEG picture in `bytes` to RGBA with 8 bits a channel; its first bytes give the format. `name` is
/// its name in messages.
pub(crate) fn decode_texture(name: &str, bytes: &[u8]) -> Result<Texture> {
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        Ok(other) => return Err(unsupported(name, format!("a picture in {other:?}"))),
        Err(_) => {
            let magic = bytes[..bytes.len().min(4)].escape_ascii();
            let found = format!("`{magic}` at the start of {}", counted(bytes.len(), "byte"));
            return Err(malformed(name, found, "a PNG or JPEG picture"));
        }
    };
    let read = |error: ImageError| failed(name, format, &error);
    let reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut decoder = reader.into_decoder().map_err(read)?;
    let (width, height) = decoder.dimensions();
    let n_texels = u64::from(width) * u64::from(height);
    if MAX_SIDE < width.max(height) {
        let advice = "scale the picture down to at most 16384 x 16384";
        let found = format!("a picture of {width} x {height}");
        return Err(Error::Unsupported { file: name.into(), action: "read", found, advice });
    }
    if n_texels == 0 || bytes.len() as u64 * MAX_TEXELS_PER_BYTE < n_texels {
        let found = format!("{width} x {height} texels in {}", counted(bytes.len(), "byte"));
        return Err(malformed(name, found, "a whole picture"));
    }
    let mut limits = Limits::no_limits();
    // 16 bits a channel, and as much again for the decoder's own use.
    limits.max_alloc = Some(16 * n_texels + (1 << 20));
    decoder.set_limits(limits).map_err(read)?;
    let image = DynamicImage::from_decoder(decoder).map_err(read)?.into_rgba8();
    Ok(Texture { width, height, texels: image.into_raw().as_chunks().0.into() })
}

fn failed(name: &str, format: ImageFormat, error: &ImageError) -> Error {
    match error {
        ImageError::Unsupported(error) => unsupported(name, format!("{format:?}: {error}")),
        error => malformed(name, format!("{format:?}: {error}"), "a whole picture"),
    }
}

fn malformed(name: &str, found: String, expected: &str) -> Error {
    Error::Malformed {
        file: name.into(),
        location: Location::Byte(0),
        found,
        expected: expected.into(),
        advice: "copy the picture again from its source, or save it again".into(),
    }
}

fn unsupported(name: &str, found: String) -> Error {
    let advice = "save the picture as PNG or JPEG";
    Error::Unsupported { file: name.into(), action: "read", found, advice }
}

#[cfg(test)]
mod tests {
    //! Pictures of every pixel format as RGBA with 8 bits a channel, and errors of broken ones.

    use super::*;

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn ramp() -> DynamicImage {
        image::RgbImage::from_fn(5, 3, |x, y| image::Rgb([50 * x as u8, 100 * y as u8, 7])).into()
    }

    #[test]
    fn all_kinds_of_pixels_become_rgba8() {
        let ramp = ramp();
        for image in [
            DynamicImage::from(ramp.to_rgb8()),
            ramp.to_rgba8().into(),
            ramp.to_rgb16().into(),
            ramp.to_rgba16().into(),
        ] {
            let texture = decode_texture("a.png", &encoded(&image, ImageFormat::Png)).unwrap();
            assert_eq!((texture.width, texture.height), (5, 3));
            assert_eq!(texture.texels[5 + 2], [100, 100, 7, 255]);
        }
        for image in [DynamicImage::from(ramp.to_luma8()), ramp.to_luma16().into()] {
            let texture = decode_texture("a.png", &encoded(&image, ImageFormat::Png)).unwrap();
            let [r, g, b, a] = texture.texels[14];
            assert!(r == g && g == b && a == 255);
        }
        let half: DynamicImage = image::RgbaImage::from_pixel(1, 1, image::Rgba([9; 4])).into();
        assert_eq!(
            decode_texture("a.png", &encoded(&half, ImageFormat::Png)).unwrap().texels,
            [[9; 4]].into()
        );
        let jpeg = decode_texture("a.png", &encoded(&ramp, ImageFormat::Jpeg)).unwrap();
        assert_eq!((jpeg.width, jpeg.height, jpeg.texels.len()), (5, 3, 15));
    }

    #[test]
    fn errors_of_broken_pictures_name_the_file() {
        let message = |bytes: &[u8]| decode_texture("wood.png", bytes).unwrap_err().to_string();
        assert!(message(b"").contains("wood.png: byte 0: found `` at the start of 0 bytes"));
        assert!(message(b"<html>").contains("found `<htm`"));
        assert!(message(b"GIF89a123").contains("save the picture as PNG or JPEG"));
        let png = encoded(&ramp(), ImageFormat::Png);
        let mut wide = png.clone();
        // A width that the check sum no longer fits.
        wide[16..20].copy_from_slice(&60_000_u32.to_be_bytes());
        assert!(decode_texture("wood.png", &wide).is_err());
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let bytes = encoded(&ramp(), format);
            for length in 0..bytes.len() {
                let _ = decode_texture("wood.png", &bytes[..length]);
            }
            for at in 0..bytes.len() {
                let mut broken = bytes.clone();
                broken[at] ^= 0x55;
                let _ = decode_texture("wood.png", &broken);
            }
        }
    }
}
