//! EXR: linear colour and every layer, without loss.

use std::path::Path;

use exr::meta::attribute::AttributeValue;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, Layer, LayerAttributes,
    Text, WritableImage,
};
use surfel::image::Image;
use surfel::math::Vec3;

use super::ImageOptions;
use crate::atomic::{write_failed, write_file};
use crate::error::Result;

pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    let size = (image.width as usize, image.height as usize);
    let mut attributes = LayerAttributes::default();
    // As text: the format's own vectors are f32, too coarse for coordinates of national grids. One
    // attribute only: several would be written in an order that changes from run to run.
    let origin = options.origin.to_array().map(|coordinate| coordinate.to_string()).join(" ");
    attributes.other.insert(Text::from("origin"), AttributeValue::Text(Text::from(&*origin)));
    let channels = AnyChannels::sort(channels(image).into_iter().collect());
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels);
    let picture = ExrImage::from_layer(layer);
    write_file(path, |writer| {
        picture.write().to_buffered(writer).map_err(|error| {
            write_failed(
                path,
                match error {
                    exr::error::Error::Io(source) => source,
                    other => std::io::Error::other(other.to_string()),
                },
            )
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
    let Some(layers) = &image.layers else { return channels };
    let mut add_triple = |names: [&str; 3], triples: &[Vec3]| {
        for (axis, name) in names.into_iter().enumerate() {
            add(name, FlatSamples::F32(triples.iter().map(|triple| triple[axis]).collect()));
        }
    };
    add_triple(["N.X", "N.Y", "N.Z"], &layers.normal);
    add_triple(["P.X", "P.Y", "P.Z"], &layers.position);
    add_triple(["albedo.R", "albedo.G", "albedo.B"], &layers.albedo);
    add("Z", FlatSamples::F32(layers.depth.clone()));
    add("id", FlatSamples::U32(layers.point_id.clone()));
    add("instance", FlatSamples::U32(layers.instance_id.clone()));
    channels
}
