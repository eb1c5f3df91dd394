//! The colours of a mesh from those of a cloud of its vertices.

use surfel_core::image::{decode_srgb, decode_srgb8};
use surfel_core::math::Vec4;
use surfel_core::points::{COLOR_8_TO_16, PointCloud, Values};

/// Returns the colours of the vertices, linear and with alpha.
pub(crate) fn linear_colors(cloud: &PointCloud) -> Option<Vec<Vec4>> {
    let colors = cloud.colors.as_ref()?;
    let alpha = cloud.scalar("alpha");
    let linear = |channel: u16| match (channel / COLOR_8_TO_16, channel % COLOR_8_TO_16) {
        // Most files have 8 bits, for which there is a table.
        (byte, 0) => decode_srgb8(byte as u8),
        _ => decode_srgb(f32::from(channel) / 65535.0),
    };
    let color = |(i, color): (usize, &[u16; 3])| {
        let [red, green, blue] = color.map(linear);
        let alpha = alpha.map_or(1.0, |alpha: &Values| alpha.get(i).clamp(0.0, 1.0) as f32);
        Vec4::new(red, green, blue, alpha)
    };
    Some(colors.iter().enumerate().map(color).collect())
}
