//! Linear pictures with named layers; tone and colour mapping.

pub mod colormap;
mod classification;
mod srgb;
mod stretch;
mod tone;

pub use classification::{class_color, class_name};
pub use colormap::Colormap;
pub use srgb::{decode_srgb, decode_srgb8, encode_srgb};
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
    /// Along the view axis, in world units; infinite where nothing was hit.
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
}
