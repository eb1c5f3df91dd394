//! Converts MTL materials with their textures.

use surfel_core::math::Vec2;
use surfel_core::scene::{Material, TextureRef, Wrap};

use super::mtl::{Map, Mtl};
use crate::mesh::TextureLoader;

/// Returns the material with those of its textures that can be read.
pub(super) fn material_with_textures(mtl: &Mtl, textures: &mut TextureLoader) -> Material {
    let mut reference = |map: &Option<Map>| map.as_ref().and_then(|map| reference(map, textures));
    let mut material = mtl.material();
    // The colour of glass and mirrors is a tint, to which the diffuse texture does not apply.
    if material.transmission == 0.0 && !mtl.is_mirror() {
        material.textures.base_color = reference(&mtl.diffuse_map);
    }
    material.textures.emissive = reference(&mtl.emissive_map);
    // Without its texture, the emission is what the file states.
    if material.textures.emissive.is_none() {
        material.emissive = mtl.emissive;
    }
    let strength = mtl.normal_map.as_ref().map_or(1.0, |map| map.strength);
    material.textures.normal = reference(&mtl.normal_map).map(|normal| (normal, strength));
    material
}

/// Returns a reference to a texture, if its file can be read.
fn reference(map: &Map, textures: &mut TextureLoader) -> Option<TextureRef> {
    let texture = textures.load(&map.file)?;
    // In the file v points up: 1 - v' = offset + scale * (1 - v).
    let offset = Vec2::new(map.offset.x, 1.0 - map.offset.y - map.scale.y);
    let wrap = if map.is_clamped { Wrap::ClampToEdge } else { Wrap::Repeat };
    Some(TextureRef { offset, scale: map.scale, wrap: [wrap; 2], ..TextureRef::new(texture) })
}
