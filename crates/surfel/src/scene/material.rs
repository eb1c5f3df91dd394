//! How surfaces answer light, after the metallic-roughness model of glTF 2.0.

use super::texture::TextureRef;
use crate::error::Error;
use crate::math::Vec3;

/// Colours are linear. Textures multiply factors, and the geometry's colours (of points, of vertices)
/// multiply the base colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub base_color: Vec3,
    /// Whether the geometry's own colours do not count.
    pub ignores_colors: bool,
    /// Share of the surface that is there at all; see `alpha_mode`.
    pub alpha: f32,
    pub alpha_mode: AlphaMode,
    /// 0 for what lets light in (stone, glass), 1 for metals, which reflect in their base colour.
    pub metallic: f32,
    /// 0 mirrors, 1 reflects to all sides.
    pub roughness: f32,
    /// Index of refraction; 1 reflects nothing but what metal does.
    pub ior: f32,
    /// Share of the light that enters which goes on through the surface.
    pub transmission: f32,
    /// Colour that white light has after `attenuation_distance` inside (Beer's law).
    pub attenuation_color: Vec3,
    /// In object units; infinite if nothing is absorbed.
    pub attenuation_distance: f32,
    /// A pane without an inside: light goes on straight.
    pub is_thin: bool,
    /// Light that it gives off; matte white under a light of strength 1 is as bright as (1, 1, 1).
    pub emissive: Vec3,
    /// The same as a multiple of the base colour.
    pub glow: f32,
    /// The base colour as it is, whatever the light.
    pub is_unlit: bool,
    pub textures: Textures,
}

/// Pictures that multiply a material's factors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Textures {
    /// sRGB-encoded, with alpha.
    pub base_color: Option<TextureRef>,
    /// Roughness in green, metallic in blue.
    pub metallic_roughness: Option<TextureRef>,
    /// Tangent-space normals, x and y times this scale.
    pub normal: Option<(TextureRef, f32)>,
    /// sRGB-encoded.
    pub emissive: Option<TextureRef>,
    /// Share of `transmission`, in red.
    pub transmission: Option<TextureRef>,
}

impl Textures {
    /// Shows `see` each texture that is there.
    pub fn each_mut(&mut self, see: impl FnMut(&mut TextureRef)) {
        let Self { base_color, metallic_roughness, normal, emissive, transmission } = self;
        let normal = normal.as_mut().map(|(texture, _)| texture);
        let others = [base_color, metallic_roughness, emissive, transmission];
        others.into_iter().flatten().chain(normal).for_each(see);
    }
}

/// What alpha below 1 means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing.
    #[default]
    Opaque,
    /// There is no surface where alpha is below this.
    Mask(f32),
    /// What is behind shows through.
    Blend,
}

impl Default for Material {
    fn default() -> Self {
        Self::MATTE
    }
}

impl Material {
    /// Diffuse, with the geometry's colours as albedo.
    pub const MATTE: Self = Self {
        base_color: Vec3::ONE,
        ignores_colors: false,
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
        glow: 0.0,
        is_unlit: false,
        textures: Textures {
            base_color: None,
            metallic_roughness: None,
            normal: None,
            emissive: None,
            transmission: None,
        },
    };
    /// Reflects in the geometry's colours, slightly blurred.
    pub const METAL: Self = Self { metallic: 1.0, roughness: 0.25, ..Self::MATTE };
    /// Reflects all light.
    pub const MIRROR: Self =
        Self { ignores_colors: true, metallic: 1.0, roughness: 0.0, ..Self::MATTE };
    /// Clear, with the index of refraction of window glass.
    pub const GLASS: Self =
        Self { ignores_colors: true, transmission: 1.0, roughness: 0.0, ior: 1.5, ..Self::MATTE };
    /// Diffuse under a glossy coat.
    pub const PLASTIC: Self = Self { roughness: 0.2, ior: 1.5, ..Self::MATTE };
    /// Shines in the geometry's colours.
    pub const EMISSIVE: Self = Self { glow: 1.0, ..Self::MATTE };
    /// The geometry's colours as they are, without light.
    pub const UNLIT: Self = Self { is_unlit: true, ..Self::MATTE };

    /// Whether light may go on through the surface.
    pub fn is_see_through(&self) -> bool {
        0.0 < self.transmission || self.alpha_mode != AlphaMode::Opaque
    }

    /// The materials that have names.
    pub const NAMED: [(&'static str, Self); 7] = [
        ("matte", Self::MATTE),
        ("metal", Self::METAL),
        ("mirror", Self::MIRROR),
        ("glass", Self::GLASS),
        ("plastic", Self::PLASTIC),
        ("emissive", Self::EMISSIVE),
        ("unlit", Self::UNLIT),
    ];
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
