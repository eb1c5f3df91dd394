//! Image writers: PNG, JPEG, WebP and TIFF for display, OpenEXR with all layers.

mod options;
mod exr;
pub(crate) mod png;
mod display;

pub use self::options::{Alpha, BitDepth, ImageOptions};
pub use self::png::encode_png;

use std::path::Path;

use surfel_core::image::Image;

use self::display::DisplayFormat;
use crate::error::Result;
use crate::file::{check_output, extension, unsupported_extension};

const ADVICE: &str = "surfel writes images as .png, .jpg, .webp, .tif and .exr";

/// Writes `image` to a .png, .jpg, .webp, .tif or .exr file, or as PNG to the standard output if `path` is `-`.
///
/// # Errors
///
/// Fails if the extension is unknown or if the file cannot be written.
pub fn save_image(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    check_output(path)?;
    let extension = extension(path);
    if let Some(format) = DisplayFormat::from_extension(&extension) {
        return display::write(path, image, options, format);
    }
    match extension.as_str() {
        "png" => png::write(path, image, options),
        "exr" => exr::write(path, image, options),
        _ if path == Path::new("-") => png::write_to_stdout(image, options),
        _ => Err(unsupported_extension(path, ADVICE)),
    }
}
