//! Materials, with the extensions for light that goes through and light given off.

use std::f32;

use surfel::math::Vec3;
use surfel::scene::{AlphaMode, Material, Textures};

use super::document::Document;
use super::json::Json;
use super::picture::Pictures;
use crate::error::Result;

/// The material of what names none.
pub(super) const DEFAULT: Material =
    Material { metallic: 1.0, roughness: 1.0, ior: 1.5, ..Material::MATTE };

/// All materials, in the order of the file.
pub(super) fn read_all<'a>(
    document: &Document<'a>,
    pictures: &mut Pictures<'a>,
) -> Result<Vec<Material>> {
    let materials = document.root.list("materials")?;
    materials.iter().map(|material| read(material, pictures)).collect()
}

fn read<'a>(json: &Json<'a>, pictures: &mut Pictures<'a>) -> Result<Material> {
    let mut material = DEFAULT;
    if let Some(base) = json.get("pbrMetallicRoughness") {
        let [r, g, b, alpha] = shares(base.floats_or("baseColorFactor", [1.0; 4])?);
        (material.base_color, material.alpha) = (Vec3::new(r, g, b), alpha);
        material.metallic = share(base.float_or("metallicFactor", 1.0)?);
        material.roughness = share(base.float_or("roughnessFactor", 1.0)?);
        material.textures = Textures {
            base_color: pictures.refer(&base, "baseColorTexture")?,
            metallic_roughness: pictures.refer(&base, "metallicRoughnessTexture")?,
            ..Textures::default()
        };
    }
    if let Some(normal) = pictures.refer(json, "normalTexture")? {
        let scale = json.need("normalTexture")?.float_or("scale", 1.0)?;
        material.textures.normal = Some((normal, scale));
    }
    material.textures.emissive = pictures.refer(json, "emissiveTexture")?;
    material.emissive = Vec3::from(shares(json.floats_or("emissiveFactor", [0.0; 3])?));
    if let Some(emissive) = json.extension("KHR_materials_emissive_strength") {
        let strength = emissive.float_or("emissiveStrength", 1.0)?.max(0.0);
        // The largest finite colour still adds up with others.
        material.emissive = (strength * material.emissive).min(Vec3::splat(1e30));
    }
    material.alpha_mode = alpha_mode(json)?;
    material.is_unlit = json.extension("KHR_materials_unlit").is_some();
    if let Some(ior) = json.extension("KHR_materials_ior") {
        material.ior = index_of_refraction(&ior)?;
    }
    if let Some(transmission) = json.extension("KHR_materials_transmission") {
        material.transmission = share(transmission.float_or("transmissionFactor", 0.0)?);
        material.textures.transmission = pictures.refer(&transmission, "transmissionTexture")?;
        material.is_thin = 0.0 < material.transmission;
    }
    if let Some(volume) = json.extension("KHR_materials_volume") {
        read_volume(&volume, &mut material)?;
    }
    Ok(material)
}

fn alpha_mode(json: &Json) -> Result<AlphaMode> {
    let Some(mode) = json.get("alphaMode") else { return Ok(AlphaMode::Opaque) };
    match mode.text()? {
        "OPAQUE" => Ok(AlphaMode::Opaque),
        "MASK" => Ok(AlphaMode::Mask(json.float_or("alphaCutoff", 0.5)?)),
        "BLEND" => Ok(AlphaMode::Blend),
        _ => Err(mode.unlike("OPAQUE, MASK or BLEND")),
    }
}

fn index_of_refraction(json: &Json) -> Result<f32> {
    let ior = json.float_or("ior", DEFAULT.ior)?;
    match ior {
        // The extension's word for a surface that reflects all light; this one reflects 99 % of it.
        0.0 => Ok(400.0),
        _ if 1.0 <= ior => Ok(ior),
        _ => Err(json.need("ior")?.unlike("0, or 1 and more")),
    }
}

/// Without a thickness there is no volume.
fn read_volume(json: &Json, material: &mut Material) -> Result<()> {
    if json.float_or("thicknessFactor", 0.0)? <= 0.0 {
        return Ok(());
    }
    material.is_thin = false;
    material.attenuation_color = Vec3::from(shares(json.floats_or("attenuationColor", [1.0; 3])?));
    material.attenuation_distance = json.float_or("attenuationDistance", f32::INFINITY)?;
    if material.attenuation_distance <= 0.0 {
        return Err(json.need("attenuationDistance")?.unlike("a distance above 0"));
    }
    Ok(())
}

fn shares<const N: usize>(values: [f32; N]) -> [f32; N] {
    values.map(share)
}

/// What is a share of something lies between nothing and all of it.
fn share(value: f32) -> f32 {
    value.clamp(0.0, 1.0)
}
