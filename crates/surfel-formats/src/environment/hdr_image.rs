//! The decoded image and the limits that a file's claims are checked against.

use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use crate::error::{Location, Result};
use crate::file::Input;

/// Maximum number of pixels: an image of 16384 x 16384 pixels takes 3 GiB as floats.
const MAX_PIXELS: u64 = 1 << 28;
/// Maximum number of decoded bytes per byte of the file. ZIP reaches 1032, and no image with any light in it
/// reaches that with another compression.
const MAX_BYTES_PER_BYTE: u64 = 2048;
/// Number of decoded bytes that a file of any size may claim, because a small file may hold an image of one
/// colour.
const BASE_BYTES: u64 = 64 << 20;

/// An image of linear radiance, as stored in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct HdrImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear RGB radiance, `width * height` pixels with row 0 at the top. The primaries are those of
    /// Rec.709; a file that declares others is reported but not converted. EXR files may contain values that
    /// are not physical: negative, infinite or NaN.
    pub pixels: Vec<Vec3>,
}

impl HdrImage {
    /// Creates a black image of a size that [`check_size`] accepted.
    ///
    /// # Errors
    ///
    /// Fails if there is not enough memory.
    pub(super) fn black(input: &Input, width: u32, height: u32) -> Result<Self> {
        let n_pixels = width as usize * height as usize;
        let mut pixels = Vec::new();
        if pixels.try_reserve_exact(n_pixels).is_err() {
            let found =
                format!("an image of {width} x {height} pixels, which does not fit in memory");
            return Err(input.unsupported(found, "scale it down"));
        }
        pixels.resize(n_pixels, Vec3::ZERO);
        Ok(Self { width, height, pixels })
    }
}

/// Rejects a size that the file's bytes cannot decode to, or that exceeds the limit for all files.
pub(super) fn check_size(
    input: &Input,
    location: Location,
    size: [u64; 2],
    bytes_per_pixel: u64,
) -> Result<()> {
    let [width, height] = size;
    if width == 0 || height == 0 {
        let found = format!("a size of {width} x {height} pixels");
        return Err(input.malformed(location, found, "at least one", "write the file again"));
    }
    let n_pixels = width.saturating_mul(height);
    if MAX_PIXELS < n_pixels {
        let found = format!("an image of {width} x {height} pixels");
        let advice = "scale it down: an environment of 8192 x 4096 gives the same light";
        return Err(input.unsupported(found, advice));
    }
    // The decoded image has three floats per pixel, whatever the file stores.
    let n_bytes = n_pixels.saturating_mul(bytes_per_pixel.max(size_of::<Vec3>() as u64));
    if max_decoded_bytes(input) < n_bytes {
        let found = format!("{width} x {height} pixels in {}", counted(input.len(), "byte"));
        let advice = "copy the file again from its source, or write it again with less compression";
        return Err(input.malformed(location, found, "a size that the bytes can hold", advice));
    }
    Ok(())
}

/// Returns the maximum number of bytes that the file may decode to.
pub(super) fn max_decoded_bytes(input: &Input) -> u64 {
    BASE_BYTES.max(MAX_BYTES_PER_BYTE.saturating_mul(input.len() as u64))
}

/// Reports primaries and a white point (x and y of each) that differ from Rec.709, since the colours are then
/// wrong.
pub(super) fn warn_about_primaries(input: &Input, primaries: &[f64], progress: &dyn Progress) {
    let rec709 = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
    // Radiance's own white point is 0.02 away, and most of its files mean Rec.709 by it.
    let is_near = |(found, expected): (&f64, f64)| (found - expected).abs() < 0.025;
    if primaries.len() != rec709.len() || !primaries.iter().zip(rec709).all(is_near) {
        progress.note(&format!("{}: its primaries are taken as those of Rec.709", input.name));
    }
}
