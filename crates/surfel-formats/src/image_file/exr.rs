//! OpenEXR writer: linear colour and all layers, lossless.

use std::path::Path;

use exr::meta::attribute::AttributeValue;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, Layer, LayerAttributes,
    Text, WritableImage,
};
use surfel_core::image::Image;
use surfel_core::math::Vec3;

use super::limits::encoder_error;
use super::options::ImageOptions;
use crate::error::Result;
use crate::file::{write_error, write_file};

/// Writes an EXR with all layers of the image.
pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    let size = (image.width as usize, image.height as usize);
    let mut attributes = LayerAttributes::default();
    // A text keeps the precision that coordinates of national grids need; the format's own vectors are f32.
    // A single attribute keeps the file deterministic: several are written in an order that varies from run
    // to run.
    let origin = options.origin.to_array().map(|coordinate| coordinate.to_string()).join(" ");
    attributes.other.insert(Text::from("origin"), AttributeValue::Text(Text::from(&*origin)));
    let channels = AnyChannels::sort(channels(image).into_iter().collect());
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels);
    let exr_image = ExrImage::from_layer(layer);
    write_file(path, |writer| {
        exr_image.write().to_buffered(writer).map_err(|error| match error {
            exr::error::Error::Io(cause) => write_error(path, cause),
            refusal => encoder_error(path, refusal),
        })
    })
}

fn channels(image: &Image) -> Vec<AnyChannel<FlatSamples>> {
    let mut channels = Vec::new();
    let mut add = |name: &str, samples| channels.push(AnyChannel::new(name, samples));
    for (channel, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        add(name, FlatSamples::F32(image.color.iter().map(|color| color[channel]).collect()));
    }
    add("coverage", FlatSamples::F32(image.coverage.clone()));
    let Some(aovs) = &image.aovs else { return channels };
    let mut add_triple = |names: [&str; 3], triples: &[Vec3]| {
        for (axis, name) in names.into_iter().enumerate() {
            add(name, FlatSamples::F32(triples.iter().map(|triple| triple[axis]).collect()));
        }
    };
    add_triple(["N.X", "N.Y", "N.Z"], &aovs.normal);
    add_triple(["P.X", "P.Y", "P.Z"], &aovs.position);
    add_triple(["albedo.R", "albedo.G", "albedo.B"], &aovs.albedo);
    add("Z", FlatSamples::F32(aovs.depth.clone()));
    add("id", FlatSamples::U32(aovs.point_id.clone()));
    add("support.count", FlatSamples::U32(aovs.support_count.clone()));
    add("support.distance", FlatSamples::F32(aovs.support_distance.clone()));
    add("instance", FlatSamples::U32(aovs.instance_id.clone()));
    channels
}
