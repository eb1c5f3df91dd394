//! Linear pictures with named layers; tone and colour mapping.

pub mod colormap;
mod classification;
mod srgb;
mod stretch;
mod tone;

pub use classification::{class_color, class_name};
pub use colormap::Colormap;
pub use srgb::{decode_srgb, decode_srgb8, encode_srgb, encode_srgb8};
pub use stretch::Stretch;
pub use tone::Tone;

use crate::math::Vec3;

/// A rendered picture: row 0 is the top, `width * height` entries a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    pub width: u32,
    pub height: u32,
    /// Linear Rec.709, premultiplied by alpha.
    pub color: Vec<[f32; 4]>,
    /// Share of each pixel's samples that hit something.
    pub coverage: Vec<f32>,
    /// What was seen along the rays through the pixels' centres, if that was asked for.
    pub layers: Option<Layers>,
}

/// What the ray through each pixel's centre met.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Along the view axis, or from the camera of a panorama, in world units; infinite where nothing was hit.
    pub depth: Vec<f32>,
    /// World space, unit, facing the camera; zero where nothing was hit.
    pub normal: Vec<Vec3>,
    /// Relative to the scene's origin; zero where nothing was hit.
    pub position: Vec<Vec3>,
    /// Index of the nearest point hit, `NO_ID` where nothing was hit.
    pub point_id: Vec<u32>,
    /// Index of the instance hit, `NO_ID` where nothing was hit.
    pub instance_id: Vec<u32>,
    /// Linear surface colour; zero where nothing was hit.
    pub albedo: Vec<Vec3>,
}

/// Marks a pixel that shows no point.
pub const NO_ID: u32 = u32::MAX;

impl Image {
    /// A transparent picture that shows nothing, without layers.
    pub fn new(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        Self { width, height, color: vec![[0.0; 4]; n], coverage: vec![0.0; n], layers: None }
    }

    /// The same, with layers that show nothing.
    pub fn with_layers(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        let layers = Layers {
            depth: vec![f32::INFINITY; n],
            normal: vec![Vec3::ZERO; n],
            position: vec![Vec3::ZERO; n],
            point_id: vec![NO_ID; n],
            instance_id: vec![NO_ID; n],
            albedo: vec![Vec3::ZERO; n],
        };
        Self { layers: Some(layers), ..Self::new(width, height) }
    }

    /// The picture cut into bands of so many rows, the last one of fewer, from the top.
    pub fn bands_mut(&mut self, n_rows: usize) -> Vec<Band<'_>> {
        let n = n_rows * self.width as usize;
        let mut layers = self.layers.as_mut().map(|layers| layers.bands_mut(n).into_iter());
        let pixels = self.color.chunks_mut(n).zip(self.coverage.chunks_mut(n));
        let band = |(color, coverage)| {
            let layers = layers.as_mut().and_then(Iterator::next);
            Band { color, coverage, layers }
        };
        pixels.map(band).collect()
    }
}

/// Rows of an image.
pub struct Band<'i> {
    pub color: &'i mut [[f32; 4]],
    pub coverage: &'i mut [f32],
    pub layers: Option<LayersBand<'i>>,
}

/// Rows of an image's layers.
pub struct LayersBand<'i> {
    pub depth: &'i mut [f32],
    pub normal: &'i mut [Vec3],
    pub position: &'i mut [Vec3],
    pub point_id: &'i mut [u32],
    pub instance_id: &'i mut [u32],
    pub albedo: &'i mut [Vec3],
}

impl Layers {
    /// Cut after every `n` pixels.
    fn bands_mut(&mut self, n: usize) -> Vec<LayersBand<'_>> {
        let mut depth = self.depth.chunks_mut(n);
        let mut normal = self.normal.chunks_mut(n);
        let mut position = self.position.chunks_mut(n);
        let mut point_id = self.point_id.chunks_mut(n);
        let mut instance_id = self.instance_id.chunks_mut(n);
        let mut albedo = self.albedo.chunks_mut(n);
        let next = || {
            Some(LayersBand {
                depth: depth.next()?,
                normal: normal.next()?,
                position: position.next()?,
                point_id: point_id.next()?,
                instance_id: instance_id.next()?,
                albedo: albedo.next()?,
            })
        };
        std::iter::from_fn(next).collect()
    }
}
