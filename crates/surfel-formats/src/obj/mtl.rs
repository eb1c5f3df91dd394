//! MTL: the materials of OBJ files, brought to metallic and roughness.

use surfel::math::{Vec2, Vec3};
use surfel::scene::{AlphaMode, Material};

use super::lines::{keyword, line_end, name, numbers, words};
use crate::input::Input;
use crate::lines::LineError;
use crate::pieces::{Fault, Piece};

/// A material as the file describes it. Colours are linear, as renderers have always taken them.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    pub name: String,
    diffuse: Option<Vec3>,
    specular: Option<Vec3>,
    /// Of Phong's highlight.
    exponent: f32,
    pub emissive: Vec3,
    /// Colour of what goes through.
    filter: Option<Vec3>,
    /// 1 if nothing is seen through.
    dissolve: Option<f32>,
    ior: Option<f32>,
    /// Number of the model of illumination.
    model: u32,
    /// Roughness and metallic, which newer programs add.
    roughness: Option<f32>,
    metallic: Option<f32>,
    pub diffuse_map: Option<Map>,
    pub emissive_map: Option<Map>,
    pub normal_map: Option<Map>,
}

/// A picture and how it lies.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    pub file: String,
    /// In the file's coordinates, of which v goes up.
    pub offset: Vec2,
    pub scale: Vec2,
    pub is_clamped: bool,
    /// Of normals.
    pub strength: f32,
}

/// The materials of a file; lines that say nothing sensible are left out, and the first is returned too.
pub(super) fn parse(input: &Input) -> (Vec<Mtl>, Option<Fault>) {
    let mut materials: Vec<Mtl> = Vec::new();
    let mut fault = None;
    for (at, line) in (Piece { text: input, start: 0 }).lines(line_end) {
        let (keyword, rest) = keyword(line);
        if keyword == b"newmtl" {
            materials.push(Mtl { name: name(rest), ..Mtl::default() });
        } else if let Some(material) = materials.last_mut()
            && let Err(error) = material.add(keyword, rest)
        {
            fault.get_or_insert(Fault::new(at, error));
        }
    }
    (materials, fault)
}

impl Mtl {
    fn add(&mut self, keyword: &[u8], rest: &[u8]) -> Result<(), LineError> {
        match keyword {
            b"Kd" => self.diffuse = Some(color(rest)?.min(Vec3::ONE)),
            b"Ks" => self.specular = Some(color(rest)?.min(Vec3::ONE)),
            b"Ke" => self.emissive = color(rest)?,
            b"Tf" => self.filter = Some(color(rest)?.min(Vec3::ONE)),
            b"Ns" => self.exponent = number(rest)?.max(0.0),
            b"Ni" => self.ior = Some(number(rest)?),
            b"d" => self.dissolve = Some(number(rest.strip_prefix(b"-halo").unwrap_or(rest))?),
            // What `d` says counts.
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

    /// Whether it reflects like a mirror, in its specular colour.
    pub fn is_mirror(&self) -> bool {
        let is_new = self.roughness.is_some() || self.metallic.is_some();
        let is_specular = self.specular.is_some_and(|specular| specular != Vec3::ZERO);
        matches!(self.model, 3 | 5) && is_specular && !is_new
    }

    /// All but the textures.
    pub fn material(&self) -> Material {
        let specular = self.specular.unwrap_or_default();
        let alpha = self.dissolve.map_or(1.0, |dissolve| dissolve.clamp(0.0, 1.0));
        let dense = self.ior.filter(|ior| 1.0 < *ior);
        // A picture on black would be black.
        let diffuse = match (self.diffuse, &self.diffuse_map) {
            (None | Some(Vec3::ZERO), Some(_)) | (None, None) => Vec3::ONE,
            (Some(diffuse), _) => diffuse,
        };
        let glow = match self.emissive_map {
            Some(_) if self.emissive == Vec3::ZERO => Vec3::ONE,
            _ => self.emissive,
        };
        let matte = Material { base_color: diffuse, emissive: glow, ..Material::MATTE };
        // Some programs give model 4 to all they write: glass is what bends light or lets it through.
        if matches!(self.model, 4 | 6 | 7) && (dense.is_some() || alpha < 1.0) {
            let tint = self.filter.filter(|filter| *filter != Vec3::ZERO).unwrap_or(Vec3::ONE);
            let roughness = self.roughness.unwrap_or(0.0);
            let ior = dense.unwrap_or(Material::GLASS.ior);
            return Material {
                base_color: tint,
                emissive: glow,
                roughness,
                ior,
                ..Material::GLASS
            };
        }
        let alpha_mode = if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
        let opaque = Material { alpha, alpha_mode, ..matte };
        if self.roughness.is_some() || self.metallic.is_some() {
            return Material {
                metallic: self.metallic.unwrap_or(0.0),
                roughness: self.roughness.unwrap_or(self.highlight()),
                ior: dense.unwrap_or(1.5),
                ..opaque
            };
        }
        if self.is_mirror() {
            return Material { base_color: specular, metallic: 1.0, roughness: 0.0, ..opaque };
        }
        if specular != Vec3::ZERO {
            return Material { roughness: self.highlight(), ior: dense.unwrap_or(1.5), ..opaque };
        }
        opaque
    }

    /// The roughness, a square root of the width of microfacets, whose highlight is as wide as Phong's
    /// (Walter et al. 2007, Karis 2013).
    fn highlight(&self) -> f32 {
        (2.0 / (self.exponent + 2.0)).sqrt().sqrt()
    }
}

fn number(rest: &[u8]) -> Result<f32, LineError> {
    let ([number], _) = numbers::<1, 1>(rest)?;
    let is_sensible = (number as f32).is_finite();
    let found = || LineError { found: format!("{number}"), expected: "a finite number".into() };
    is_sensible.then_some(number as f32).ok_or_else(found)
}

/// Not negative; one number stands for three.
fn color(rest: &[u8]) -> Result<Vec3, LineError> {
    let ([red, green, blue], count) = numbers::<1, 3>(rest)?;
    let color = Vec3::new(red as f32, green as f32, blue as f32);
    let color = if count < 3 { Vec3::splat(red as f32) } else { color };
    let found = || LineError { found: format!("{color}"), expected: "a colour".into() };
    color.is_finite().then_some(color.max(Vec3::ZERO)).ok_or_else(found)
}

/// A file's name behind options, each with numbers or a word.
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
        let (option, behind) = keyword(rest);
        rest = match option {
            b"-o" => up_to_three(behind, &mut map.offset),
            b"-s" => up_to_three(behind, &mut map.scale),
            b"-t" => up_to_three(behind, &mut Vec2::default()),
            b"-mm" => keyword(keyword(behind).1).1,
            b"-clamp" => {
                let (word, behind) = keyword(behind);
                map.is_clamped = word == b"on";
                behind
            }
            b"-bm" => {
                let (word, behind) = keyword(behind);
                map.strength = number(word)?;
                behind
            }
            _ => keyword(behind).1,
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

/// Takes one to three numbers, of which the first two matter.
fn up_to_three<'a>(rest: &'a [u8], pair: &mut Vec2) -> &'a [u8] {
    let mut rest = rest;
    for axis in 0..3 {
        let (word, behind) = keyword(rest);
        let Ok(value) = number(word) else { break };
        if axis < 2 {
            pair[axis] = value;
        }
        rest = behind;
    }
    rest
}
