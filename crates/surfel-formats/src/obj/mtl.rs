//! MTL: the materials of OBJ files, converted to metallic and roughness.

use surfel_core::math::{Vec2, Vec3};
use surfel_core::scene::{AlphaMode, Material};

use super::lines::{line_end, name, numbers, split_keyword, words};
use crate::file::Input;
use crate::table::{LineError, ParseFault, TextChunk};

/// A material as the file describes it. Colours are linear, which is how renderers read them.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    /// Name of the material.
    pub name: String,
    diffuse: Option<Vec3>,
    specular: Option<Vec3>,
    /// Exponent of Phong's highlight.
    exponent: f32,
    /// Emitted colour, linear.
    pub emissive: Vec3,
    /// Transmission filter colour.
    filter: Option<Vec3>,
    /// Opacity, 1 if opaque.
    dissolve: Option<f32>,
    ior: Option<f32>,
    /// Number of the illumination model.
    model: u32,
    /// Roughness, which newer programs add.
    roughness: Option<f32>,
    /// Metallic, which newer programs add.
    metallic: Option<f32>,
    /// Texture of the colour.
    pub diffuse_map: Option<Map>,
    /// Texture of the emitted colour.
    pub emissive_map: Option<Map>,
    /// Texture of the normals.
    pub normal_map: Option<Map>,
}

/// A texture with its options.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// Name of the file.
    pub file: String,
    /// Offset of texture coordinates, with v up as in the file.
    pub offset: Vec2,
    /// Scale of the texture coordinates.
    pub scale: Vec2,
    /// True if the texture does not repeat.
    pub is_clamped: bool,
    /// Strength of a normal map.
    pub strength: f32,
}

/// Parses the materials of a file. Broken lines are skipped; the error of the first is returned too.
pub(super) fn parse(input: &Input) -> (Vec<Mtl>, Option<ParseFault>) {
    let mut materials: Vec<Mtl> = Vec::new();
    let mut fault = None;
    for (byte, line) in (TextChunk { text: input, start: 0 }).lines(line_end) {
        let (keyword, rest) = split_keyword(line);
        if keyword == b"newmtl" {
            materials.push(Mtl { name: name(rest), ..Mtl::default() });
        } else if let Some(material) = materials.last_mut()
            && let Err(error) = material.add(keyword, rest)
        {
            fault.get_or_insert(ParseFault::new(byte, error));
        }
    }
    (materials, fault)
}

impl Mtl {
    /// Applies the line with this keyword.
    fn add(&mut self, keyword: &[u8], rest: &[u8]) -> Result<(), LineError> {
        match keyword {
            b"Kd" => self.diffuse = Some(color(rest)?.min(Vec3::ONE)),
            b"Ks" => self.specular = Some(color(rest)?.min(Vec3::ONE)),
            b"Ke" => self.emissive = color(rest)?,
            b"Tf" => self.filter = Some(color(rest)?.min(Vec3::ONE)),
            b"Ns" => self.exponent = number(rest)?.max(0.0),
            b"Ni" => self.ior = Some(number(rest)?),
            b"d" => self.dissolve = Some(number(rest.strip_prefix(b"-halo").unwrap_or(rest))?),
            // `d` takes precedence.
            b"Tr" => self.dissolve = self.dissolve.or(Some(1.0 - number(rest)?)),
            b"illum" => self.model = number(rest)? as u32,
            b"Pr" => self.roughness = Some(number(rest)?.clamp(0.0, 1.0)),
            b"Pm" => self.metallic = Some(number(rest)?.clamp(0.0, 1.0)),
            b"map_Kd" => self.diffuse_map = Some(map(rest)?),
            b"map_Ke" => self.emissive_map = Some(map(rest)?),
            b"norm" => self.normal_map = Some(map(rest)?),
            _ => {}
        }
        Ok(())
    }

    /// Returns true for a mirror, which reflects in its specular colour.
    pub fn is_mirror(&self) -> bool {
        let is_new = self.roughness.is_some() || self.metallic.is_some();
        let is_specular = self.specular.is_some_and(|specular| specular != Vec3::ZERO);
        matches!(self.model, 3 | 5) && is_specular && !is_new
    }

    /// Returns the material without textures.
    pub fn material(&self) -> Material {
        let specular = self.specular.unwrap_or_default();
        let alpha = self.dissolve.map_or(1.0, |dissolve| dissolve.clamp(0.0, 1.0));
        let dense = self.ior.filter(|ior| 1.0 < *ior);
        // A texture is multiplied by the colour, and black would hide it.
        let diffuse = match (self.diffuse, &self.diffuse_map) {
            (None | Some(Vec3::ZERO), Some(_)) | (None, None) => Vec3::ONE,
            (Some(diffuse), _) => diffuse,
        };
        let emissive = match self.emissive_map {
            Some(_) if self.emissive == Vec3::ZERO => Vec3::ONE,
            _ => self.emissive,
        };
        let matte = Material { base_color: diffuse, emissive, ..Material::MATTE };
        // Some programs write model 4 for every material, so glass must also have an index of refraction or opacity.
        if matches!(self.model, 4 | 6 | 7) && (dense.is_some() || alpha < 1.0) {
            let tint = self.filter.filter(|filter| *filter != Vec3::ZERO).unwrap_or(Vec3::ONE);
            let roughness = self.roughness.unwrap_or(0.0);
            let ior = dense.unwrap_or(Material::GLASS.ior);
            return Material { base_color: tint, emissive, roughness, ior, ..Material::GLASS };
        }
        let alpha_mode = if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
        let opaque = Material { alpha, alpha_mode, ..matte };
        if self.roughness.is_some() || self.metallic.is_some() {
            return Material {
                metallic: self.metallic.unwrap_or(0.0),
                roughness: self.roughness.unwrap_or(self.phong_roughness()),
                ior: dense.unwrap_or(1.5),
                ..opaque
            };
        }
        if self.is_mirror() {
            return Material { base_color: specular, metallic: 1.0, roughness: 0.0, ..opaque };
        }
        if specular != Vec3::ZERO {
            return Material {
                roughness: self.phong_roughness(),
                ior: dense.unwrap_or(1.5),
                ..opaque
            };
        }
        opaque
    }

    /// Returns the roughness whose GGX highlight is as wide as Phong's: alpha = sqrt(2 / (exponent + 2)) (Walter et al.
    /// 2007), and roughness = sqrt(alpha) (Karis 2013).
    fn phong_roughness(&self) -> f32 {
        (2.0 / (self.exponent + 2.0)).sqrt().sqrt()
    }
}

/// Parses a finite number.
fn number(rest: &[u8]) -> Result<f32, LineError> {
    let ([number], _) = numbers::<1, 1>(rest)?;
    let is_finite = (number as f32).is_finite();
    let found = || LineError { found: format!("{number}"), expected: "a finite number".into() };
    is_finite.then_some(number as f32).ok_or_else(found)
}

/// Parses a colour, whose negative channels become 0; a single number is a grey.
fn color(rest: &[u8]) -> Result<Vec3, LineError> {
    let ([red, green, blue], count) = numbers::<1, 3>(rest)?;
    let color = Vec3::new(red as f32, green as f32, blue as f32);
    let color = if count < 3 { Vec3::splat(red as f32) } else { color };
    let found = || LineError { found: format!("{color}"), expected: "a colour".into() };
    color.is_finite().then_some(color.max(Vec3::ZERO)).ok_or_else(found)
}

/// Parses options, each with numbers or a word, and the name of a file after them.
fn map(rest: &[u8]) -> Result<Map, LineError> {
    let mut map = Map {
        file: String::new(),
        offset: Vec2::ZERO,
        scale: Vec2::ONE,
        is_clamped: false,
        strength: 1.0,
    };
    let mut rest = rest;
    while rest.starts_with(b"-") {
        let (option, after) = split_keyword(rest);
        rest = match option {
            b"-o" => up_to_three(after, &mut map.offset),
            b"-s" => up_to_three(after, &mut map.scale),
            b"-t" => up_to_three(after, &mut Vec2::default()),
            b"-mm" => split_keyword(split_keyword(after).1).1,
            b"-clamp" => {
                let (word, after) = split_keyword(after);
                map.is_clamped = word == b"on";
                after
            }
            b"-bm" => {
                let (word, after) = split_keyword(after);
                map.strength = number(word)?;
                after
            }
            _ => split_keyword(after).1,
        };
    }
    if words(rest).next().is_none() {
        return Err(LineError {
            found: "the end of the line".into(),
            expected: "a file's name".into(),
        });
    }
    map.file = name(rest);
    Ok(map)
}

/// Parses one to three numbers, the first two of them into `pair`; returns the rest.
fn up_to_three<'a>(rest: &'a [u8], pair: &mut Vec2) -> &'a [u8] {
    let mut rest = rest;
    for axis in 0..3 {
        let (word, after) = split_keyword(rest);
        let Ok(value) = number(word) else { break };
        if axis < 2 {
            pair[axis] = value;
        }
        rest = after;
    }
    rest
}
