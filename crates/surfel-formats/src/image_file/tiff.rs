//! TIFF writer: pictures, and elevations as numbers. A plan's place is written as GeoTIFF (OGC 19-008r4).

use std::io::{Seek, Write};
use std::path::Path;

use surfel_core::image::Image;
use tiff::TiffError;
use tiff::encoder::colortype::{ColorType, Gray32Float, RGB8, RGB16};
use tiff::encoder::{
    Compression, DeflateLevel, DirectoryEncoder, ImageEncoder, Predictor, Rational, TiffEncoder,
    TiffKindStandard, TiffValue,
};
use tiff::tags::{ExtraSamples, ResolutionUnit, Tag};

use super::georeference::Georeference;
use super::limits::{check_image_size, encoder_error};
use super::options::{Alpha, BitDepth, ImageOptions};
use super::png::samples;
use crate::error::Result;
use crate::file::{check_output_path, write_error, write_file};

/// The value of pixels that show nothing, as files of elevations have it.
const NO_DATA: f32 = -9999.0;

/// Elevations of a plan's pixels, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Elevation at the centre of each pixel; NaN where nothing is.
    pub elevations: Vec<f32>,
    /// The place of the pixels.
    pub georeference: Georeference,
}

/// Writes a picture.
pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    let samples = samples(image, options);
    let size = (image.width, image.height);
    match options.depth {
        BitDepth::Eight => write_samples::<RGB8>(path, size, &samples, options, None),
        BitDepth::Sixteen => {
            let pairs = samples.as_chunks().0.iter();
            let numbers: Vec<u16> = pairs.map(|pair| u16::from_be_bytes(*pair)).collect();
            write_samples::<RGB16>(path, size, &numbers, options, None)
        }
    }
}

/// Writes elevations as a GeoTIFF with a sample of 32 bits per pixel, whose value for missing ones is stated.
///
/// # Errors
///
/// Fails if the extension is neither .tif nor .tiff, if TIFF holds no map of this size, and if the file cannot be
/// written.
pub fn save_height_map(path: &Path, map: &HeightMap) -> Result<()> {
    check_height_map(path)?;
    check_image_size(path, map.width, map.height)?;
    let options = ImageOptions {
        alpha: Alpha::Drop,
        georeference: Some(map.georeference),
        ..ImageOptions::default()
    };
    let size = (map.width, map.height);
    let sample = |elevation: &f32| if elevation.is_nan() { NO_DATA } else { *elevation };
    let samples: Vec<f32> = map.elevations.iter().map(sample).collect();
    write_samples::<Gray32Float>(path, size, &samples, &options, Some(NO_DATA))
}

/// Checks that a file of elevations can be written.
///
/// # Errors
///
/// Fails if the extension is neither .tif nor .tiff, and if the folder cannot be written to.
pub fn check_height_map(path: &Path) -> Result<()> {
    check_output_path(path)?;
    match crate::file::extension(path).as_str() {
        "tif" | "tiff" => Ok(()),
        _ => Err(crate::file::unsupported_extension(path, "surfel writes height maps as .tif")),
    }
}

fn write_samples<C: ColorType>(
    path: &Path,
    size: (u32, u32),
    samples: &[C::Inner],
    options: &ImageOptions,
    no_data: Option<f32>,
) -> Result<()>
where
    [C::Inner]: TiffValue,
{
    write_file(path, |writer| {
        encode::<C, _>(writer, size, samples, options, no_data).map_err(|error| match error {
            TiffError::IoError(cause) => write_error(path, cause),
            refusal => encoder_error(path, refusal),
        })
    })
}

fn encode<C: ColorType, W: Write + Seek>(
    writer: W,
    (width, height): (u32, u32),
    samples: &[C::Inner],
    options: &ImageOptions,
    no_data: Option<f32>,
) -> std::result::Result<(), TiffError>
where
    [C::Inner]: TiffValue,
{
    // The encoder predicts samples of a picture with alpha from those of another channel.
    let predictor = match (no_data, options.alpha) {
        (None, Alpha::Drop) => Predictor::Horizontal,
        _ => Predictor::None,
    };
    let mut file = TiffEncoder::new(writer)?
        .with_compression(Compression::Deflate(DeflateLevel::Balanced))
        .with_predictor(predictor);
    let mut image: ImageEncoder<'_, W, C, TiffKindStandard> = file.new_image(width, height)?;
    if options.alpha == Alpha::Keep {
        image.extra_samples(&[ExtraSamples::UnassociatedAlpha])?;
    }
    if let Some(dpi) = options.dpi {
        image.resolution(ResolutionUnit::Inch, Rational { n: (1000.0 * dpi) as u32, d: 1000 });
    }
    if let Some(georeference) = &options.georeference {
        write_georeference(image.encoder(), georeference)?;
    }
    if let Some(no_data) = no_data {
        image.encoder().write_tag(Tag::GdalNodata, &*no_data.to_string())?;
    }
    image.write_data(samples)
}

/// Writes the tags of GeoTIFF.
fn write_georeference<W: Write + Seek>(
    directory: &mut DirectoryEncoder<'_, W, TiffKindStandard>,
    georeference: &Georeference,
) -> std::result::Result<(), TiffError> {
    let Georeference { corner: [x, y], right, down, .. } = *georeference;
    if georeference.is_north_up() {
        directory.write_tag(Tag::ModelPixelScaleTag, &[right[0], -down[1], 0.0][..])?;
        directory.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, x, y, 0.0][..])?;
    } else {
        let rows = [
            [right[0], down[0], 0.0, x],
            [right[1], down[1], 0.0, y],
            [0.0; 4],
            [0.0, 0.0, 0.0, 1.0],
        ];
        directory.write_tag(Tag::ModelTransformationTag, rows.as_flattened())?;
    }
    directory.write_tag(Tag::GeoKeyDirectoryTag, &*geo_keys(georeference))
}

/// Returns the directory of GeoTIFF keys: the kind of coordinates, that pixels are areas, and the codes.
fn geo_keys(georeference: &Georeference) -> Vec<u16> {
    const MODEL_TYPE: u16 = 1024;
    const RASTER_TYPE: u16 = 1025;
    const GEODETIC: u16 = 2048;
    const PROJECTED: u16 = 3072;
    const VERTICAL: u16 = 4096;
    const PIXEL_IS_AREA: u16 = 1;
    let (model, system) = match georeference.is_geographic {
        true => (2, GEODETIC),
        false => (1, PROJECTED),
    };
    let mut keys = Vec::new();
    if georeference.epsg.is_some() {
        keys.push((MODEL_TYPE, model));
    }
    keys.push((RASTER_TYPE, PIXEL_IS_AREA));
    if let Some(epsg) = georeference.epsg {
        keys.push((system, epsg.horizontal));
        keys.extend(epsg.vertical.map(|code| (VERTICAL, code)));
    }
    let header = [1, 1, 1, keys.len() as u16];
    header.into_iter().chain(keys.into_iter().flat_map(|(key, value)| [key, 0, 1, value])).collect()
}
