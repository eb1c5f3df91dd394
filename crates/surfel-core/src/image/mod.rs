//! Linear pictures with arbitrary output variables (AOVs), sRGB, colour maps and class colours.

pub mod colormap;
mod classification;
mod label_color;
mod percentile_range;
mod srgb;

pub use classification::{class_color, class_name, class_named};
pub use colormap::Colormap;
pub use label_color::label_color;
pub use percentile_range::{PercentileRange, is_data};
pub use srgb::{
    decode_srgb, decode_srgb8, encode_srgb, encode_srgb8, encode_srgba8, unpremultiply,
};

use crate::math::Vec3;

/// A rendered picture. Each column has `width * height` entries; row 0 is the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear Rec. 709 colour, premultiplied by alpha, and alpha.
    pub color: Vec<[f32; 4]>,
    /// Fraction of each pixel's samples that hit a surface.
    pub coverage: Vec<f32>,
    /// AOVs of the rays through the pixel centres, if requested.
    pub aovs: Option<Aovs>,
}

/// Arbitrary output variables: data of the surface that the ray through each pixel's centre hits.
#[derive(Clone, Debug, PartialEq)]
pub struct Aovs {
    /// Depth along the view axis, or distance from the camera of a panorama, in world units; infinite without a hit.
    pub depth: Vec<f32>,
    /// Unit normal in world space, facing the camera; zero without a hit.
    pub normal: Vec<Vec3>,
    /// World position relative to the scene's origin; zero without a hit.
    pub position: Vec<Vec3>,
    /// Index of the nearest point or of the triangle, `NO_ID` without a hit.
    pub point_id: Vec<u32>,
    /// Index of the instance, `NO_ID` without a hit.
    pub instance_id: Vec<u32>,
    /// Linear surface colour; zero without a hit.
    pub albedo: Vec<Vec3>,
    /// Number of points within one radius of the hit; 0 on triangles and without a hit.
    pub support_count: Vec<u32>,
    /// Distance from the hit to the nearest point, in radii of the point that was hit; infinite on triangles and without
    /// a hit.
    pub support_distance: Vec<f32>,
}

/// The ID of pixels without a hit.
pub const NO_ID: u32 = u32::MAX;

impl Image {
    /// Creates a transparent picture without AOVs.
    pub fn new(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        Self { width, height, color: vec![[0.0; 4]; n], coverage: vec![0.0; n], aovs: None }
    }

    /// Creates a transparent picture with AOVs that have no hits.
    pub fn with_aovs(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        let aovs = Aovs {
            depth: vec![f32::INFINITY; n],
            normal: vec![Vec3::ZERO; n],
            position: vec![Vec3::ZERO; n],
            point_id: vec![NO_ID; n],
            instance_id: vec![NO_ID; n],
            albedo: vec![Vec3::ZERO; n],
            support_count: vec![0; n],
            support_distance: vec![f32::INFINITY; n],
        };
        Self { aovs: Some(aovs), ..Self::new(width, height) }
    }

    /// Returns the rows and the columns from the first to before the second.
    pub fn cropped(self, rows: (u32, u32), columns: (u32, u32)) -> Self {
        if (rows, columns) == ((0, self.height), (0, self.width)) {
            return self;
        }
        let Self { width, color, coverage, aovs, .. } = self;
        let cut = Cut { width: width as usize, rows, columns };
        Self {
            width: columns.1 - columns.0,
            height: rows.1 - rows.0,
            color: cut.column(&color),
            coverage: cut.column(&coverage),
            aovs: aovs.map(|aovs| Aovs {
                depth: cut.column(&aovs.depth),
                normal: cut.column(&aovs.normal),
                position: cut.column(&aovs.position),
                point_id: cut.column(&aovs.point_id),
                instance_id: cut.column(&aovs.instance_id),
                albedo: cut.column(&aovs.albedo),
                support_count: cut.column(&aovs.support_count),
                support_distance: cut.column(&aovs.support_distance),
            }),
        }
    }

    /// Splits the picture into bands of `n_rows` rows from the top; the last band may have fewer.
    pub fn bands_mut(&mut self, n_rows: usize) -> Vec<Band<'_>> {
        let n = n_rows * self.width as usize;
        let mut aovs = self.aovs.as_mut().map(|aovs| aovs.bands_mut(n).into_iter());
        let pixels = self.color.chunks_mut(n).zip(self.coverage.chunks_mut(n));
        let band = |(color, coverage)| {
            let aovs = aovs.as_mut().and_then(Iterator::next);
            Band { color, coverage, aovs }
        };
        pixels.map(band).collect()
    }
}

/// Rows and columns of pictures of one width, from the first to before the second.
struct Cut {
    width: usize,
    rows: (u32, u32),
    columns: (u32, u32),
}

impl Cut {
    fn column<T: Copy>(&self, pixels: &[T]) -> Vec<T> {
        let columns = self.columns.0 as usize..self.columns.1 as usize;
        let rows = self.rows.0 as usize * self.width..self.rows.1 as usize * self.width;
        pixels[rows].chunks(self.width).flat_map(|row| &row[columns.clone()]).copied().collect()
    }
}

/// A band of rows of an image. The fields are those of [`Image`].
pub struct Band<'i> {
    /// Colour and alpha.
    pub color: &'i mut [[f32; 4]],
    /// Fraction of samples that hit a surface.
    pub coverage: &'i mut [f32],
    /// AOVs, if the image has them.
    pub aovs: Option<AovBand<'i>>,
}

/// A band of rows of the AOVs. The fields are those of [`Aovs`].
pub struct AovBand<'i> {
    /// Depth.
    pub depth: &'i mut [f32],
    /// Normal.
    pub normal: &'i mut [Vec3],
    /// Position.
    pub position: &'i mut [Vec3],
    /// Index of the point or triangle.
    pub point_id: &'i mut [u32],
    /// Index of the instance.
    pub instance_id: &'i mut [u32],
    /// Surface colour.
    pub albedo: &'i mut [Vec3],
    /// Number of points near the hit.
    pub support_count: &'i mut [u32],
    /// Distance to the nearest point.
    pub support_distance: &'i mut [f32],
}

impl Aovs {
    /// Splits the AOVs into bands of `n` pixels.
    fn bands_mut(&mut self, n: usize) -> Vec<AovBand<'_>> {
        let mut depth = self.depth.chunks_mut(n);
        let mut normal = self.normal.chunks_mut(n);
        let mut position = self.position.chunks_mut(n);
        let mut point_id = self.point_id.chunks_mut(n);
        let mut instance_id = self.instance_id.chunks_mut(n);
        let mut albedo = self.albedo.chunks_mut(n);
        let mut support_count = self.support_count.chunks_mut(n);
        let mut support_distance = self.support_distance.chunks_mut(n);
        let next = || {
            Some(AovBand {
                depth: depth.next()?,
                normal: normal.next()?,
                position: position.next()?,
                point_id: point_id.next()?,
                instance_id: instance_id.next()?,
                albedo: albedo.next()?,
                support_count: support_count.next()?,
                support_distance: support_distance.next()?,
            })
        };
        std::iter::from_fn(next).collect()
    }
}
