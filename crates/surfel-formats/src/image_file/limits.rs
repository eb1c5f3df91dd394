//! Sizes of pictures that the formats hold, and the errors of their encoders.

use std::fmt::Display;
use std::path::Path;

use crate::error::{Error, Result};
use crate::file::extension;

/// Greatest side of WebP: a header of 14 bits holds the side less one.
const MAX_WEBP_SIDE: u32 = 1 << 14;
/// Greatest side of JPEG, which has 16 bits in the header.
const MAX_JPEG_SIDE: u32 = u16::MAX as u32;
/// Greatest side of PNG: its numbers have 31 bits.
const MAX_PNG_SIDE: u32 = i32::MAX as u32;
/// Number of pixels that TIFF does not reach: its files have less than 4 GiB, and a pixel up to 8 bytes.
const TOO_MANY_TIFF_PIXELS: u64 = 1 << 29;
/// Greatest width of EXR: the length of a block, 16 rows with 19 layers of 4 bytes each, has 31 bits.
const MAX_EXR_WIDTH: u32 = i32::MAX as u32 / (16 * 19 * 4);
/// Height that EXR does not reach, half the range of its coordinates.
const TOO_HIGH_FOR_EXR: u32 = i32::MAX as u32 / 2;

/// Checks before any work that the format of `path` holds pictures of this size; `-` is PNG on standard output.
///
/// # Errors
///
/// Fails if the picture has no pixels, or more than its format holds.
pub fn check_image_size(path: &Path, width: u32, height: u32) -> Result<()> {
    let longest = width.max(height);
    let n_pixels = u64::from(width) * u64::from(height);
    let (fits, advice) = match extension(path).as_str() {
        _ if n_pixels == 0 => (false, "choose at least 1x1"),
        "webp" => (
            longest <= MAX_WEBP_SIDE,
            "WebP holds at most 16384x16384; choose a smaller size, or write .png or .tif",
        ),
        "jpg" | "jpeg" => (
            longest <= MAX_JPEG_SIDE,
            "JPEG holds at most 65535x65535; choose a smaller size, or write .png or .tif",
        ),
        "tif" | "tiff" => (
            n_pixels < TOO_MANY_TIFF_PIXELS,
            "TIFF holds less than 4 GiB; choose a smaller size, or write .png",
        ),
        "exr" => (
            width <= MAX_EXR_WIDTH && height < TOO_HIGH_FOR_EXR,
            "EXR holds at most 1766022x1073741822; choose a smaller size, or write .png",
        ),
        _ => (
            longest <= MAX_PNG_SIDE,
            "PNG holds at most 2147483647x2147483647; choose a smaller size",
        ),
    };
    if fits {
        return Ok(());
    }
    let found = format!("a picture of {width}x{height} pixels");
    Err(Error::Unsupported { file: path.display().to_string(), action: "write", found, advice })
}

/// Returns the error of an encoder that refuses a picture for another reason than its disk.
pub(crate) fn encoder_error(path: &Path, cause: impl Display) -> Error {
    Error::Unsupported {
        file: path.display().to_string(),
        action: "write",
        found: format!("a picture that its encoder refuses ({cause})"),
        advice: "choose another size or format",
    }
}
