//! Pictures in, as light: linear radiance from Radiance HDR and from EXR.

mod exr;
mod hdr;

use std::path::Path;

use surfel::math::Vec3;
use surfel::progress::Progress;

use crate::error::{Place, Result};
use crate::input::Input;

const SUPPORTED: &str = "surfel reads pictures of light as .hdr (Radiance) and .exr";
/// A picture of 16384 x 16384 pixels; as floats it has 3 GiB.
const MOST_PIXELS: u64 = 1 << 28;
/// Decoded bytes that each byte of a file may stand for. ZIP reaches 1032, and no picture of any light
/// reaches that with another compression.
const MOST_BYTES_PER_BYTE: u64 = 2048;
/// Decoded bytes that are granted to a file of any size: small pictures may be of one colour.
const USUAL_BYTES: u64 = 64 << 20;

/// Linear radiance as a file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPicture {
    pub width: u32,
    pub height: u32,
    /// Rec.709 unless the file says otherwise, which is told but not converted; `width * height`, row 0
    /// at the top. EXR files may hold values that are no light: negative, infinite, NaN.
    pub pixels: Vec<Vec3>,
}

/// Reads a picture of light: .hdr (RGBE of Radiance, Ward 1991), or the first part of an .exr with the
/// channels R, G and B, or Y alone.
///
/// An error if the file cannot be read, is broken, of another kind, or claims more pixels than its bytes
/// can stand for or than 2^28; and if `progress` cancels.
pub fn load_environment_picture(path: &Path, progress: &dyn Progress) -> Result<LinearPicture> {
    read(&Input::open(path)?, progress)
}

/// The same from the bytes of a file; `name` stands in messages.
pub fn load_environment_picture_bytes(
    name: &str,
    bytes: &[u8],
    progress: &dyn Progress,
) -> Result<LinearPicture> {
    read(&Input::of_bytes(name, bytes), progress)
}

/// The first bytes alone tell what it is.
fn read(input: &Input, progress: &dyn Progress) -> Result<LinearPicture> {
    progress.check()?;
    if input.is_empty() {
        let advice = "write the file again or copy it again from its source";
        return Err(input.malformed(Place::Byte(0), "an empty file", "a picture", advice));
    }
    if input.starts_with(hdr::MAGIC) {
        return hdr::read(input, progress);
    }
    if input.starts_with(exr::MAGIC) {
        return exr::read(input, progress);
    }
    let known = [
        (&b"\x89PNG"[..], "a PNG picture"),
        (b"\xff\xd8\xff", "a JPEG picture"),
        (b"RIFF", "a WebP picture"),
        (b"II*\0", "a TIFF picture"),
        (b"MM\0*", "a TIFF picture"),
        (b"PF\n", "a PFM picture"),
    ];
    if let Some((_, found)) = known.iter().find(|(magic, _)| input.starts_with(magic)) {
        let advice = "pictures for the eye have no light brighter than white: take the .hdr or .exr that \
            it was made from, or convert it to one of them";
        return Err(input.unsupported(*found, advice));
    }
    let found = format!("`{}`", input[..input.len().min(4)].escape_ascii());
    match input.extension().as_str() {
        "hdr" | "pic" | "rgbe" => {
            let advice = "the extension does not fit the content; give the file its right one";
            Err(input.malformed(Place::Byte(0), found, "`#?RADIANCE`", advice))
        }
        "exr" => {
            let advice = "the extension does not fit the content; give the file its right one";
            Err(input.malformed(Place::Byte(0), found, "`v/1\\x01`", advice))
        }
        _ => Err(input.unsupported(format!("unknown content that begins with {found}"), SUPPORTED)),
    }
}

/// Refuses a size that the file's bytes cannot stand for, or that is too large for any file.
fn check_size(input: &Input, place: Place, size: [u64; 2], bytes_per_pixel: u64) -> Result<()> {
    let [width, height] = size;
    if width == 0 || height == 0 {
        let found = format!("a size of {width} x {height} pixels");
        return Err(input.malformed(place, found, "at least one", "write the file again"));
    }
    let n_pixels = width.saturating_mul(height);
    if MOST_PIXELS < n_pixels {
        let found = format!("a picture of {width} x {height} pixels");
        let advice = "scale it down: an environment lights the same with 8192 x 4096";
        return Err(input.unsupported(found, advice));
    }
    // The result has three floats a pixel, whatever the file has.
    let n_bytes = n_pixels.saturating_mul(bytes_per_pixel.max(size_of::<Vec3>() as u64));
    if granted_bytes(input) < n_bytes {
        let found = format!("{width} x {height} pixels in {} bytes", input.len());
        let advice = "copy the file again from its source, or write it again with less compression";
        return Err(input.malformed(place, found, "a size that the bytes can hold", advice));
    }
    Ok(())
}

/// Decoded bytes that the file may stand for.
fn granted_bytes(input: &Input) -> u64 {
    USUAL_BYTES.max(MOST_BYTES_PER_BYTE.saturating_mul(input.len() as u64))
}

/// Tells of primaries and white (x and y of each) that are not those of Rec.709 and so give other colours.
fn note_primaries(input: &Input, given: &[f64], progress: &dyn Progress) {
    let known = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
    // Radiance's own have a white that is 0.02 away, and are what most of its files mean by Rec.709.
    let is_near = |(given, known): (&f64, f64)| (given - known).abs() < 0.025;
    if given.len() != known.len() || !given.iter().zip(known).all(is_near) {
        progress.note(&format!("{}: its primaries are taken as those of Rec.709", input.name));
    }
}

/// A black picture to fill, of a size that was checked.
fn black(input: &Input, width: u32, height: u32) -> Result<LinearPicture> {
    let n_pixels = width as usize * height as usize;
    let mut pixels = Vec::new();
    if pixels.try_reserve_exact(n_pixels).is_err() {
        let found = format!("a picture of {width} x {height} pixels, for which there is no memory");
        return Err(input.unsupported(found, "scale it down"));
    }
    pixels.resize(n_pixels, Vec3::ZERO);
    Ok(LinearPicture { width, height, pixels })
}
