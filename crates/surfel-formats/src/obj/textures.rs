//! The textures of MTL materials.

use surfel::math::Vec2;
use surfel::scene::{Material, TextureRef, Wrap};

use super::mtl::{Map, Mtl};
use crate::beside::Textures;

/// The material with those of its textures that can be read.
pub(super) fn textured(mtl: &Mtl, textures: &mut Textures) -> Material {
    let mut reference = |map: &Option<Map>| map.as_ref().and_then(|map| reference(map, textures));
    let mut material = mtl.material();
    // What glass and mirrors show is their tint.
    if material.transmission == 0.0 && !mtl.is_mirror() {
        material.textures.base_color = reference(&mtl.diffuse_map);
    }
    material.textures.emissive = reference(&mtl.emissive_map);
    // Without its picture nothing says how it shines.
    if material.textures.emissive.is_none() {
        material.emissive = mtl.emissive;
    }
    let strength = mtl.normal_map.as_ref().map_or(1.0, |map| map.strength);
    material.textures.normal = reference(&mtl.normal_map).map(|normal| (normal, strength));
    material
}

fn reference(map: &Map, textures: &mut Textures) -> Option<TextureRef> {
    let texture = textures.read(&map.file)?;
    // In the file v goes up: 1 - v' = offset + scale * (1 - v).
    let offset = Vec2::new(map.offset.x, 1.0 - map.offset.y - map.scale.y);
    let wrap = if map.is_clamped { Wrap::ClampToEdge } else { Wrap::Repeat };
    Some(TextureRef { offset, scale: map.scale, wrap: [wrap; 2], ..TextureRef::new(texture) })
}
