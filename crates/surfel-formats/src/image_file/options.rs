//! Settings of image files.

use surfel_core::math::DVec3;

use super::georeference::Georeference;

/// Encoding of an image file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageOptions {
    /// Bits per channel of PNG and TIFF files; JPEG and WebP files are always 8-bit, EXR files 32-bit.
    pub depth: BitDepth,
    /// Alpha mode of PNG, WebP and TIFF files; JPEG files have no alpha channel, EXR files always have one.
    pub alpha: Alpha,
    /// World coordinates of the origin of the position layer, written to the header of EXR files.
    pub origin: DVec3,
    /// Pixels per inch at which the picture is to be printed, written to PNG, JPEG and TIFF files.
    pub dpi: Option<f64>,
    /// Place of a plan, written to TIFF files.
    pub georeference: Option<Georeference>,
}

/// Bits per channel of a PNG or TIFF file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BitDepth {
    /// 8 bits per channel.
    #[default]
    Eight,
    /// 16 bits per channel.
    Sixteen,
}

/// Alpha mode of an image file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Alpha {
    /// The file has an alpha channel.
    #[default]
    Keep,
    /// The image is composited over black.
    Drop,
}
