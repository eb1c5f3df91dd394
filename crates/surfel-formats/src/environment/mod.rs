//! Environment map readers: linear radiance from Radiance HDR and OpenEXR files.

mod hdr_image;
mod exr;
mod hdr;

pub use hdr_image::HdrImage;

use std::path::Path;

use surfel_core::progress::Progress;

use crate::error::{Location, Result};
use crate::file::Input;

const SUPPORTED: &str = "surfel reads environment maps as .hdr (Radiance) and .exr";

/// Reads an environment map: a Radiance .hdr file (RGBE; Ward 1991, *Real Pixels*), or the first part of an
/// .exr file with the channels R, G and B, or Y alone.
///
/// # Errors
///
/// Fails if the file cannot be read, is malformed or of another format, claims more pixels than its bytes can
/// hold or than 2^28, or if `progress` cancels.
pub fn load_environment_map(path: &Path, progress: &dyn Progress) -> Result<HdrImage> {
    read(&Input::open(path)?, progress)
}

/// Reads an environment map from the bytes of a file. Messages call the file `name`.
///
/// # Errors
///
/// Fails like [`load_environment_map`].
pub fn load_environment_map_bytes(
    name: &str,
    bytes: &[u8],
    progress: &dyn Progress,
) -> Result<HdrImage> {
    read(&Input::from_bytes(name, bytes), progress)
}

/// Selects the reader by the first bytes alone.
fn read(input: &Input, progress: &dyn Progress) -> Result<HdrImage> {
    progress.check()?;
    if input.is_empty() {
        let advice = "write the file again or copy it again from its source";
        return Err(input.malformed(Location::Byte(0), "an empty file", "an image", advice));
    }
    if input.starts_with(hdr::MAGIC) {
        return hdr::read(input, progress);
    }
    if input.starts_with(exr::MAGIC) {
        return exr::read(input, progress);
    }
    let known = [
        (&b"\x89PNG"[..], "a PNG image"),
        (b"\xff\xd8\xff", "a JPEG image"),
        (b"RIFF", "a WebP image"),
        (b"II*\0", "a TIFF image"),
        (b"MM\0*", "a TIFF image"),
        (b"PF\n", "a PFM image"),
    ];
    if let Some((_, found)) = known.iter().find(|(magic, _)| input.starts_with(magic)) {
        let advice = "display images have no light brighter than white: use the .hdr or .exr that it was \
            made from, or convert it to one of them";
        return Err(input.unsupported(*found, advice));
    }
    let found = format!("`{}`", input[..input.len().min(4)].escape_ascii());
    match input.extension().as_str() {
        "hdr" | "pic" | "rgbe" => {
            let advice = "the extension does not fit the content; give the file its right one";
            Err(input.malformed(Location::Byte(0), found, "`#?RADIANCE`", advice))
        }
        "exr" => {
            let advice = "the extension does not fit the content; give the file its right one";
            Err(input.malformed(Location::Byte(0), found, "`v/1\\x01`", advice))
        }
        _ => Err(input.unsupported(format!("unknown content that begins with {found}"), SUPPORTED)),
    }
}
