//! Materials after the metallic-roughness model of glTF 2.0.

use super::texture::TextureRef;
use crate::error::Error;
use crate::math::Vec3;

/// The material of a surface.
///
/// Colours are linear. Textures multiply the factors, and the colours of points and vertices multiply the
/// base colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Linear base colour.
    pub base_color: Vec3,
    /// True if the colours of points and vertices are ignored.
    pub ignores_vertex_colors: bool,
    /// Opacity from 0 to 1, interpreted by `alpha_mode`.
    pub alpha: f32,
    /// The interpretation of alpha.
    pub alpha_mode: AlphaMode,
    /// 0 for dielectrics such as stone and glass, 1 for metals, which reflect in their base colour.
    pub metallic: f32,
    /// Perceptual roughness: 0 is a mirror, 1 scatters reflections to all sides.
    pub roughness: f32,
    /// Index of refraction; a dielectric of index 1 has no specular reflection.
    pub ior: f32,
    /// Fraction of the entering light that is transmitted.
    pub transmission: f32,
    /// Colour of white light after `attenuation_distance` inside of the body (Beer-Lambert law).
    pub attenuation_color: Vec3,
    /// Distance in object units; infinite if nothing is absorbed.
    pub attenuation_distance: f32,
    /// True for a thin slab without an interior, which light passes straight.
    pub is_thin: bool,
    /// Emitted radiance; (1, 1, 1) is as bright as a white matte surface that faces a light of unit strength.
    pub emissive: Vec3,
    /// Emitted radiance as a multiple of the base colour, in addition to `emissive`.
    pub emissive_strength: f32,
    /// True if the surface shows its base colour whatever the light.
    pub is_unlit: bool,
    /// Textures that multiply the factors.
    pub textures: MaterialTextures,
}

/// Textures that multiply a material's factors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialTextures {
    /// Base colour, sRGB-encoded, and alpha.
    pub base_color: Option<TextureRef>,
    /// Roughness in green, metallic in blue.
    pub metallic_roughness: Option<TextureRef>,
    /// Tangent-space normals, and a scale for their x and y.
    pub normal: Option<(TextureRef, f32)>,
    /// Emission, sRGB-encoded.
    pub emissive: Option<TextureRef>,
    /// Factor of `transmission`, in red.
    pub transmission: Option<TextureRef>,
}

impl MaterialTextures {
    /// Calls `visit` with each texture reference that is present.
    pub fn for_each_mut(&mut self, visit: impl FnMut(&mut TextureRef)) {
        let Self { base_color, metallic_roughness, normal, emissive, transmission } = self;
        let normal = normal.as_mut().map(|(texture, _)| texture);
        let others = [base_color, metallic_roughness, emissive, transmission];
        others.into_iter().flatten().chain(normal).for_each(visit);
    }
}

/// The interpretation of a material's alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// The surface is cut out where alpha is below this.
    Mask(f32),
    /// The surface is blended with the background.
    Blend,
}

impl Default for Material {
    fn default() -> Self {
        Self::MATTE
    }
}

impl Material {
    /// A diffuse surface in the colours of the geometry.
    pub const MATTE: Self = Self {
        base_color: Vec3::ONE,
        ignores_vertex_colors: false,
        alpha: 1.0,
        alpha_mode: AlphaMode::Opaque,
        metallic: 0.0,
        roughness: 1.0,
        ior: 1.0,
        transmission: 0.0,
        attenuation_color: Vec3::ONE,
        attenuation_distance: f32::INFINITY,
        is_thin: false,
        emissive: Vec3::ZERO,
        emissive_strength: 0.0,
        is_unlit: false,
        textures: MaterialTextures {
            base_color: None,
            metallic_roughness: None,
            normal: None,
            emissive: None,
            transmission: None,
        },
    };
    /// A slightly rough metal in the colours of the geometry.
    pub const METAL: Self = Self { metallic: 1.0, roughness: 0.25, ..Self::MATTE };
    /// A perfect mirror.
    pub const MIRROR: Self =
        Self { ignores_vertex_colors: true, metallic: 1.0, roughness: 0.0, ..Self::MATTE };
    /// Clear glass with the index of refraction of windows.
    pub const GLASS: Self = Self {
        ignores_vertex_colors: true,
        transmission: 1.0,
        roughness: 0.0,
        ior: 1.5,
        ..Self::MATTE
    };
    /// A diffuse surface under a glossy coat.
    pub const PLASTIC: Self = Self { roughness: 0.2, ior: 1.5, ..Self::MATTE };
    /// A surface that emits light in the colours of the geometry.
    pub const EMISSIVE: Self = Self { emissive_strength: 1.0, ..Self::MATTE };
    /// A surface that shows the colours of the geometry whatever the light.
    pub const UNLIT: Self = Self { is_unlit: true, ..Self::MATTE };

    /// True if light can pass the surface, by transmission or alpha.
    pub fn is_transmissive(&self) -> bool {
        0.0 < self.transmission || self.alpha_mode != AlphaMode::Opaque
    }

    /// The named materials.
    pub const NAMED: [(&'static str, Self); 7] = [
        ("matte", Self::MATTE),
        ("metal", Self::METAL),
        ("mirror", Self::MIRROR),
        ("glass", Self::GLASS),
        ("plastic", Self::PLASTIC),
        ("emissive", Self::EMISSIVE),
        ("unlit", Self::UNLIT),
    ];

    /// Returns the base colour of points and vertices of this colour, before textures.
    pub fn color_over(&self, vertex_color: Vec3) -> Vec3 {
        self.base_color * if self.ignores_vertex_colors { Vec3::ONE } else { vertex_color }
    }
}

impl std::str::FromStr for Material {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let known = Self::NAMED.into_iter().find(|(name, _)| *name == text);
        known.map(|(_, material)| material).ok_or_else(|| Error::UnknownName {
            kind: "material",
            found: text.to_owned(),
            known: Self::NAMED.map(|(name, _)| name).join(", "),
        })
    }
}
