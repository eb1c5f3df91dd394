//! Pictures on triangles.

use crate::image::decode_srgb8;
use crate::math::{Vec2, Vec4};
use std::sync::Arc;

/// A picture whose meaning (colour, roughness, normal) follows from the place in a material that uses it.
/// Clones share the texels.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    pub width: u32,
    pub height: u32,
    /// Row 0 is the top; `width * height` entries.
    pub texels: Arc<[[u8; 4]]>,
}

/// How a material uses a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index in the graph's textures.
    pub texture: usize,
    /// Which set of the mesh's texture coordinates: 0 or 1.
    pub uv_set: usize,
    pub wrap: [Wrap; 2],
    /// Texels as they are, rather than blended.
    pub is_nearest: bool,
    /// Moves, turns and scales coordinates: uv' = offset + rotation * scale * uv.
    pub offset: Vec2,
    /// Counter-clockwise, as KHR_texture_transform has it.
    pub rotation_rad: f32,
    pub scale: Vec2,
}

/// What is beyond a texture's sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    #[default]
    Repeat,
    MirroredRepeat,
    ClampToEdge,
}

impl TextureRef {
    /// The whole texture over the first set of coordinates, repeated.
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

/// What a texture's numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Colours, sRGB-encoded but for alpha.
    Srgb,
    /// Anything else, 0 to 1.
    Linear,
}

impl Texture {
    /// The texture at coordinates, in linear numbers.
    pub fn at(&self, uv: Vec2, reference: &TextureRef, encoding: Encoding) -> Vec4 {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let place = reference.transformed(uv) * size;
        if reference.is_nearest {
            return self.texel(place.floor(), reference, encoding);
        }
        let corner = (place - 0.5).floor();
        let share = place - 0.5 - corner;
        let texel = |x: f32, y: f32| self.texel(corner + Vec2::new(x, y), reference, encoding);
        let above = texel(0.0, 0.0).lerp(texel(1.0, 0.0), share.x);
        above.lerp(texel(0.0, 1.0).lerp(texel(1.0, 1.0), share.x), share.y)
    }

    fn texel(&self, place: Vec2, reference: &TextureRef, encoding: Encoding) -> Vec4 {
        let [across, down] = reference.wrap;
        let x = across.index(place.x, self.width);
        let y = down.index(place.y, self.height);
        let [r, g, b, a] = self.texels[y * self.width as usize + x];
        let decode = |value: u8| match encoding {
            Encoding::Srgb => decode_srgb8(value),
            Encoding::Linear => f32::from(value) / 255.0,
        };
        Vec4::new(decode(r), decode(g), decode(b), f32::from(a) / 255.0)
    }
}

impl TextureRef {
    /// Coordinates on the texture of those of a mesh.
    pub fn transformed(&self, uv: Vec2) -> Vec2 {
        if self.rotation_rad == 0.0 {
            return self.offset + self.scale * uv;
        }
        // Counter-clockwise where the second coordinate runs down.
        let (sin, cos) = self.rotation_rad.sin_cos();
        let Vec2 { x, y } = self.scale * uv;
        self.offset + Vec2::new(cos * x + sin * y, cos * y - sin * x)
    }
}

impl Wrap {
    /// The texel that stands at `place`, of `size` of them.
    fn index(self, place: f32, size: u32) -> usize {
        let (place, size) = (place as i64, i64::from(size));
        let index = match self {
            Self::Repeat => place.rem_euclid(size),
            Self::MirroredRepeat => {
                let place = place.rem_euclid(2 * size);
                place.min(2 * size - 1 - place)
            }
            Self::ClampToEdge => place.clamp(0, size - 1),
        };
        index as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checks() -> Texture {
        let texel = |grey: u8| [grey, grey, grey, 255];
        Texture { width: 2, height: 1, texels: [texel(0), texel(255)].into() }
    }

    fn red(u: f32, reference: TextureRef) -> f32 {
        checks().at(Vec2::new(u, 0.5), &reference, Encoding::Linear).x
    }

    #[test]
    fn texels_are_blended_and_wrapped() {
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
    fn coordinates_are_moved_turned_and_scaled() {
        let quarter = std::f32::consts::FRAC_PI_2;
        let reference = TextureRef {
            offset: Vec2::new(0.5, 0.25),
            rotation_rad: quarter,
            scale: Vec2::new(2.0, 3.0),
            ..TextureRef::new(0)
        };
        // Scaled, turned counter-clockwise in a picture whose second axis runs down, moved.
        let turned = reference.transformed(Vec2::new(1.0, 0.0));
        assert!(turned.distance(Vec2::new(0.5, 0.25 - 2.0)) < 1e-6, "{turned}");
    }
}
