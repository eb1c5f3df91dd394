//! Image writers: PNG, JPEG, WebP and TIFF for display, OpenEXR with all layers.

mod georeference;
mod options;
mod limits;
mod exr;
pub(crate) mod png;
mod jpeg_webp;
mod tiff;

pub use self::georeference::{EpsgCodes, Georeference};
pub use self::limits::check_image_size;
pub use self::options::{Alpha, BitDepth, ImageOptions};
pub use self::png::encode_png;
pub use self::tiff::{HeightMap, check_height_map, save_height_map};

pub(crate) use self::limits::encoder_error;

use std::path::Path;

use surfel_core::image::Image;

use self::georeference::world_file_extension;
use self::jpeg_webp::DisplayFormat;
use crate::error::Result;
use crate::file::{check_output_path, extension, save_text, unsupported_extension};

const ADVICE: &str = "surfel writes images as .png, .jpg, .webp, .tif and .exr";

/// Checks before any work that a picture can be written to `path`; `-` is standard output.
///
/// # Errors
///
/// Fails if the extension belongs to no format of pictures, or for the reasons of [`check_output_path`].
pub fn check_image_output(path: &Path) -> Result<()> {
    if path == Path::new("-") {
        return Ok(());
    }
    let extension = extension(path);
    let is_known = ["png", "tif", "tiff", "exr"].contains(&&*extension)
        || DisplayFormat::from_extension(&extension).is_some();
    if !is_known {
        return Err(unsupported_extension(path, ADVICE));
    }
    check_output_path(path)
}

/// Writes `image` to a .png, .jpg, .webp, .tif or .exr file, or as PNG to the standard output if `path` is `-`.
///
/// A picture for display that has a [`Georeference`] and is not a TIFF gets a world file beside it, as `plan.pgw`.
///
/// # Errors
///
/// Fails if the extension is unknown, if the format holds no picture of this size, or if the file cannot be written.
pub fn save_image(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    check_image_output(path)?;
    check_image_size(path, image.width, image.height)?;
    let extension = extension(path);
    if let Some(format) = DisplayFormat::from_extension(&extension) {
        jpeg_webp::write(path, image, options, format)?;
        return write_world_file(path, &extension, options);
    }
    match extension.as_str() {
        "png" => {
            png::write(path, image, options)?;
            write_world_file(path, &extension, options)
        }
        "exr" => exr::write(path, image, options),
        "tif" | "tiff" => tiff::write(path, image, options),
        _ => png::write_to_stdout(image, options),
    }
}

fn write_world_file(path: &Path, extension: &str, options: &ImageOptions) -> Result<()> {
    match &options.georeference {
        Some(georeference) => {
            let world_file = path.with_extension(world_file_extension(extension));
            save_text(&world_file, &georeference.world_file())
        }
        None => Ok(()),
    }
}
