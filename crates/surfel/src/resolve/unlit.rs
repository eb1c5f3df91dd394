//! Materials in scenes without light.

use surfel_core::math::Vec3;
use surfel_core::scene::Material;

/// Makes materials that would be black without light show their colours as they are.
pub fn unlit_without_lights(materials: &mut [Material]) {
    let black = materials.iter_mut().filter(|material| needs_light(material));
    black.for_each(|material| material.is_unlit = true);
}

/// Returns true if a material is black without light: it neither shines nor shows what is around or behind it.
fn needs_light(material: &Material) -> bool {
    let reflects = 0.5 < material.metallic && material.roughness < 1.0;
    let shines = 0.0 < material.emissive_strength || material.emissive != Vec3::ZERO;
    !reflects && !shines && material.transmission == 0.0
}
