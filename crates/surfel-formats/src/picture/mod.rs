//! Pictures out: PNG for eyes, EXR with all layers.

mod exr;
pub(crate) mod png;

pub use self::png::png_bytes;

use std::path::Path;

use surfel::image::Image;
use surfel::math::DVec3;

use crate::error::Result;
use crate::save::{check_output, extension, unsupported};

/// How a picture is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageOptions {
    pub depth: BitDepth,
    pub alpha: Alpha,
    /// World coordinates of the zero of the positions, for the header of an EXR file.
    pub origin: DVec3,
}

/// Bits a channel of a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BitDepth {
    #[default]
    Eight,
    Sixteen,
}

/// What becomes of the picture's opacity in a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Alpha {
    #[default]
    Keep,
    /// The picture is shown over black.
    Drop,
}

/// Writes `image` to `path`: .png, .exr, or `-` for PNG on the standard output.
pub fn save_image(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    check_output(path)?;
    match extension(path).as_str() {
        "png" => png::write(path, image, options),
        "exr" => exr::write(path, image, options),
        _ if path == Path::new("-") => png::write_to_stdout(image, options),
        _ => Err(unsupported(path, "surfel writes pictures as .png and .exr")),
    }
}
