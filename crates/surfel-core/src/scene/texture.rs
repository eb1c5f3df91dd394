//! Textures of triangles.

use crate::image::decode_srgb8;
use crate::math::{Vec2, Vec4};
use std::sync::Arc;

/// An 8-bit picture. The material that uses it decides what its channels mean. Clones share the texels.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `width * height` texels; row 0 is the top.
    pub texels: Arc<[[u8; 4]]>,
}

/// A material's reference to a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index of the texture in the graph.
    pub texture: usize,
    /// Index of the mesh's set of texture coordinates: 0 or 1.
    pub uv_set: usize,
    /// Continuation beyond the sides, horizontally and vertically.
    pub wrap: [Wrap; 2],
    /// True to take the nearest texel, false to interpolate bilinearly.
    pub is_nearest: bool,
    /// Offset of the coordinates: uv' = offset + rotation * scale * uv.
    pub offset: Vec2,
    /// Rotation of the coordinates in radians, counter-clockwise as in KHR_texture_transform.
    pub rotation_rad: f32,
    /// Scale of the coordinates.
    pub scale: Vec2,
}

/// The continuation of a texture beyond its sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The texture repeats.
    #[default]
    Repeat,
    /// The texture repeats, mirrored every other time.
    MirroredRepeat,
    /// The texels at the edge continue.
    ClampToEdge,
}

impl TextureRef {
    /// Makes a reference to a texture that repeats over the first set of coordinates, untransformed.
    pub fn new(texture: usize) -> Self {
        Self {
            texture,
            uv_set: 0,
            wrap: [Wrap::Repeat; 2],
            is_nearest: false,
            offset: Vec2::ZERO,
            rotation_rad: 0.0,
            scale: Vec2::ONE,
        }
    }
}

/// The encoding of a texture's colour channels; alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureEncoding {
    /// sRGB-encoded colours.
    Srgb,
    /// Linear values from 0 to 1.
    Linear,
}

impl Texture {
    /// Returns the linear value of the texture at `uv`, which `reference` transforms.
    pub fn sample(&self, uv: Vec2, reference: &TextureRef, encoding: TextureEncoding) -> Vec4 {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let position = reference.transform_uv(uv) * size;
        if reference.is_nearest {
            return self.texel(position.floor(), reference, encoding);
        }
        let corner = (position - 0.5).floor();
        let weight = position - 0.5 - corner;
        let texel = |x: f32, y: f32| self.texel(corner + Vec2::new(x, y), reference, encoding);
        let above = texel(0.0, 0.0).lerp(texel(1.0, 0.0), weight.x);
        above.lerp(texel(0.0, 1.0).lerp(texel(1.0, 1.0), weight.x), weight.y)
    }

    fn texel(&self, position: Vec2, reference: &TextureRef, encoding: TextureEncoding) -> Vec4 {
        let [across, down] = reference.wrap;
        let x = across.index(position.x, self.width);
        let y = down.index(position.y, self.height);
        let [r, g, b, a] = self.texels[y * self.width as usize + x];
        let decode = |value: u8| match encoding {
            TextureEncoding::Srgb => decode_srgb8(value),
            TextureEncoding::Linear => f32::from(value) / 255.0,
        };
        Vec4::new(decode(r), decode(g), decode(b), f32::from(a) / 255.0)
    }
}

impl TextureRef {
    /// Returns the texture coordinates for those of a mesh.
    pub fn transform_uv(&self, uv: Vec2) -> Vec2 {
        if self.rotation_rad == 0.0 {
            return self.offset + self.scale * uv;
        }
        // The rotation is counter-clockwise if the second coordinate points down.
        let (sin, cos) = self.rotation_rad.sin_cos();
        let Vec2 { x, y } = self.scale * uv;
        self.offset + Vec2::new(cos * x + sin * y, cos * y - sin * x)
    }
}

impl Wrap {
    /// Returns the index of the texel at `position`, of `size` texels.
    fn index(self, position: f32, size: u32) -> usize {
        let (position, size) = (position as i64, i64::from(size));
        let index = match self {
            Self::Repeat => position.rem_euclid(size),
            Self::MirroredRepeat => {
                let position = position.rem_euclid(2 * size);
                position.min(2 * size - 1 - position)
            }
            Self::ClampToEdge => position.clamp(0, size - 1),
        };
        index as usize
    }
}

#[cfg(test)]
mod tests {
    //! Textures are interpolated, wrapped and transformed.

    use super::*;

    fn black_and_white() -> Texture {
        let texel = |grey: u8| [grey, grey, grey, 255];
        Texture { width: 2, height: 1, texels: [texel(0), texel(255)].into() }
    }

    fn red(u: f32, reference: TextureRef) -> f32 {
        black_and_white().sample(Vec2::new(u, 0.5), &reference, TextureEncoding::Linear).x
    }

    #[test]
    fn texels_are_interpolated_and_wrapped() {
        let repeat = TextureRef::new(0);
        let wrapped = |wrap| TextureRef { wrap: [wrap; 2], ..repeat };
        assert_eq!(red(0.25, repeat), 0.0);
        assert_eq!(red(0.5, repeat), 0.5);
        assert_eq!(red(0.75, repeat), 1.0);
        assert_eq!(red(1.25, repeat), 0.0);
        assert_eq!(red(-0.25, repeat), 1.0);
        assert_eq!(red(1.25, wrapped(Wrap::MirroredRepeat)), 1.0);
        assert_eq!(red(7.0, wrapped(Wrap::ClampToEdge)), 1.0);
        assert_eq!(red(-7.0, wrapped(Wrap::ClampToEdge)), 0.0);
        assert_eq!(red(0.45, TextureRef { is_nearest: true, ..repeat }), 0.0);
    }

    #[test]
    fn coordinates_are_offset_rotated_and_scaled() {
        let quarter = std::f32::consts::FRAC_PI_2;
        let reference = TextureRef {
            offset: Vec2::new(0.5, 0.25),
            rotation_rad: quarter,
            scale: Vec2::new(2.0, 3.0),
            ..TextureRef::new(0)
        };
        // The scale comes first, then the counter-clockwise rotation, then the offset.
        let found = reference.transform_uv(Vec2::new(1.0, 0.0));
        assert!(found.distance(Vec2::new(0.5, 0.25 - 2.0)) < 1e-6, "{found}");
    }
}
