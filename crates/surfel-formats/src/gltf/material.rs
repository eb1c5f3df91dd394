//! Materials, with the extensions for transmission, volume and emission.

use std::f32;

use surfel_core::math::Vec3;
use surfel_core::scene::{AlphaMode, Material, MaterialTextures};

use super::document::Document;
use super::json::Json;
use super::texture::TextureCache;
use crate::error::Result;

/// The material of primitives that declare none.
pub(super) const DEFAULT: Material =
    Material { metallic: 1.0, roughness: 1.0, ior: 1.5, ..Material::MATTE };

/// Reads all materials in the order of the file.
pub(super) fn read_all<'a>(
    document: &Document<'a>,
    textures: &mut TextureCache<'a>,
) -> Result<Vec<Material>> {
    let materials = document.root.array_or_empty("materials")?;
    materials.iter().map(|material| read(material, textures)).collect()
}

fn read<'a>(json: &Json<'a>, textures: &mut TextureCache<'a>) -> Result<Material> {
    let mut material = DEFAULT;
    if let Some(base) = json.get("pbrMetallicRoughness") {
        let [r, g, b, alpha] = clamp_all_to_unit(base.floats_or("baseColorFactor", [1.0; 4])?);
        (material.base_color, material.alpha) = (Vec3::new(r, g, b), alpha);
        material.metallic = clamp_to_unit(base.float_or("metallicFactor", 1.0)?);
        material.roughness = clamp_to_unit(base.float_or("roughnessFactor", 1.0)?);
        material.textures = MaterialTextures {
            base_color: textures.load(&base, "baseColorTexture")?,
            metallic_roughness: textures.load(&base, "metallicRoughnessTexture")?,
            ..MaterialTextures::default()
        };
    }
    if let Some(normal) = textures.load(json, "normalTexture")? {
        let scale = json.require("normalTexture")?.float_or("scale", 1.0)?;
        material.textures.normal = Some((normal, scale));
    }
    material.textures.emissive = textures.load(json, "emissiveTexture")?;
    material.emissive = Vec3::from(clamp_all_to_unit(json.floats_or("emissiveFactor", [0.0; 3])?));
    if let Some(emissive) = json.extension("KHR_materials_emissive_strength") {
        let strength = emissive.float_or("emissiveStrength", 1.0)?.max(0.0);
        // The limit keeps sums of several colours finite.
        material.emissive = (strength * material.emissive).min(Vec3::splat(1e30));
    }
    material.alpha_mode = read_alpha_mode(json)?;
    material.is_unlit = json.extension("KHR_materials_unlit").is_some();
    if let Some(ior) = json.extension("KHR_materials_ior") {
        material.ior = read_ior(&ior)?;
    }
    if let Some(transmission) = json.extension("KHR_materials_transmission") {
        material.transmission = clamp_to_unit(transmission.float_or("transmissionFactor", 0.0)?);
        material.textures.transmission = textures.load(&transmission, "transmissionTexture")?;
        material.is_thin = 0.0 < material.transmission;
    }
    if let Some(volume) = json.extension("KHR_materials_volume") {
        read_volume(&volume, &mut material)?;
    }
    Ok(material)
}

fn read_alpha_mode(json: &Json) -> Result<AlphaMode> {
    let Some(mode) = json.get("alphaMode") else { return Ok(AlphaMode::Opaque) };
    match mode.string()? {
        "OPAQUE" => Ok(AlphaMode::Opaque),
        "MASK" => Ok(AlphaMode::Mask(json.float_or("alphaCutoff", 0.5)?)),
        "BLEND" => Ok(AlphaMode::Blend),
        _ => Err(mode.type_error("OPAQUE, MASK or BLEND")),
    }
}

fn read_ior(json: &Json) -> Result<f32> {
    let ior = json.float_or("ior", DEFAULT.ior)?;
    match ior {
        // The extension defines 0 as full reflection; an index of 400 reflects 99 % of the light.
        0.0 => Ok(400.0),
        _ if 1.0 <= ior => Ok(ior),
        _ => Err(json.require("ior")?.type_error("0, or 1 and more")),
    }
}

/// Reads the volume extension, which has no effect without a thickness.
fn read_volume(json: &Json, material: &mut Material) -> Result<()> {
    if json.float_or("thicknessFactor", 0.0)? <= 0.0 {
        return Ok(());
    }
    material.is_thin = false;
    material.attenuation_color =
        Vec3::from(clamp_all_to_unit(json.floats_or("attenuationColor", [1.0; 3])?));
    material.attenuation_distance = json.float_or("attenuationDistance", f32::INFINITY)?;
    if material.attenuation_distance <= 0.0 {
        return Err(json.require("attenuationDistance")?.type_error("a distance above 0"));
    }
    Ok(())
}

fn clamp_all_to_unit<const N: usize>(values: [f32; N]) -> [f32; N] {
    values.map(clamp_to_unit)
}

/// Clamps a factor to the range 0 to 1.
fn clamp_to_unit(value: f32) -> f32 {
    value.clamp(0.0, 1.0)
}
