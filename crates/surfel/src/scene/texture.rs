//! Pictures on triangles.

use crate::math::Vec2;

/// A picture whose meaning (colour, roughness, normal) follows from the place in a material that uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    pub width: u32,
    pub height: u32,
    /// Row 0 is the top; `width * height` entries.
    pub texels: Vec<[u8; 4]>,
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
