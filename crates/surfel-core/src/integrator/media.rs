//! Participating media: the nested solid dielectrics that a ray is inside of, and their absorption.

use super::shading::Shading;
use crate::flat::FlatScene;
use crate::math::{Ray, Vec3};
use crate::scene::Material;
use crate::trace::SceneHit;

/// A stack of instances that a ray is inside of; the one entered last comes first.
///
/// The first instance's medium surrounds the ray, also where bodies overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MediumStack([u32; MAX_NESTED]);

/// Capacity of a medium stack; a push to a full stack drops the outermost instance.
const MAX_NESTED: usize = 4;
/// Marks an empty slot of a medium stack.
const NONE: u32 = u32::MAX;
/// Minimum cosine to the normal by which the height of a ray's origin above its surface gives the offset along the ray.
/// A ray along the surface would otherwise get an unbounded offset.
pub const MIN_OFFSET_COS: f32 = 0.1;

impl MediumStack {
    /// The stack of a ray that is inside of no instance.
    pub const AIR: Self = Self([NONE; MAX_NESTED]);

    fn innermost(self) -> Option<u32> {
        (self.0[0] != NONE).then_some(self.0[0])
    }

    fn contains(self, instance: u32) -> bool {
        self.0.contains(&instance)
    }

    /// Returns the stack inside of `instance`, which becomes the innermost one.
    fn push(self, instance: u32) -> Self {
        let mut nested = [instance; MAX_NESTED];
        nested[1..].copy_from_slice(&self.0[..MAX_NESTED - 1]);
        Self(nested)
    }

    /// Returns the stack outside of `instance`, wherever it stands in the stack.
    fn remove(self, instance: u32) -> Self {
        let mut others = self.0.into_iter().filter(|other| *other != instance);
        Self([(); MAX_NESTED].map(|()| others.next().unwrap_or(NONE)))
    }

    /// Returns the stack with `instance` as the outermost one, or unchanged if it is full.
    fn push_outer(mut self, instance: u32) -> Self {
        if let Some(free) = self.0.iter_mut().find(|slot| **slot == NONE) {
            *free = instance;
        }
        self
    }

    fn ior(self, scene: &FlatScene) -> f32 {
        self.innermost().map_or(1.0, |instance| material(scene, instance).ior)
    }
}

/// A ray and the media that its origin lies in.
#[derive(Clone, Copy, Debug)]
pub struct MediumRay {
    /// The ray, relative to the scene's origin.
    pub ray: Ray,
    /// The media around the ray's origin.
    pub media: MediumStack,
    /// Distance from the surface that the ray left to its origin, along the ray.
    origin_offset: f32,
}

/// The media on both sides of a hit.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// The media on the ray's side.
    pub near: MediumStack,
    /// The media on the other side.
    pub far: MediumStack,
    /// Index of refraction on the near side over that on the far side.
    pub eta: f32,
    /// Transmittance from the ray's origin to the hit.
    pub transmittance: Vec3,
}

impl MediumRay {
    /// Makes a ray that starts in air. [`MediumRay::interface`] corrects this if a hit shows otherwise.
    pub fn from_camera(ray: Ray) -> Self {
        Self { ray, media: MediumStack::AIR, origin_offset: 0.0 }
    }

    /// Makes a ray that left the surface at `shading` into `media`.
    #[inline]
    pub fn from_surface(shading: &Shading, ray: Ray, media: MediumStack) -> Self {
        let height = (ray.origin - shading.position).dot(shading.geometric_normal).abs();
        let cos = ray.direction.dot(shading.geometric_normal).abs();
        Self { ray, media, origin_offset: height / cos.max(MIN_OFFSET_COS) }
    }

    /// Returns the media on both sides of `hit`, whose material is in `shading`.
    #[inline]
    pub fn interface(&self, scene: &FlatScene, shading: &Shading, hit: &SceneHit) -> Interface {
        let instance = hit.instance;
        if !shading.is_solid_dielectric() {
            // Matte surfaces have an index of 1 and stay matte under water.
            let is_matte = shading.ior == 1.0;
            let eta = if is_matte { 1.0 } else { self.media.ior(scene) / shading.ior };
            let transmittance = self.transmittance(scene, self.media, hit.distance);
            return Interface { near: self.media, far: self.media, eta, transmittance };
        }
        let was_entered = self.media.contains(instance);
        let is_inside =
            if scene.has_outward_normals(instance) { hit.is_backface } else { was_entered };
        let near = match (was_entered, is_inside) {
            (false, true) => self.media.push_outer(instance),
            // The ray left the body through a hole.
            (true, false) => self.media.remove(instance),
            _ => self.media,
        };
        let far = if is_inside { near.remove(instance) } else { near.push(instance) };
        let eta = near.ior(scene) / far.ior(scene);
        let transmittance = self.transmittance(scene, near, hit.distance);
        Interface { near, far, eta, transmittance }
    }

    /// Returns the transmittance up to `distance`, where a hit shows that the ray is inside of `near`.
    fn transmittance(&self, scene: &FlatScene, near: MediumStack, distance: f32) -> Vec3 {
        match (self.media.innermost(), near.innermost()) {
            (Some(medium), _) => beer_lambert(scene, medium, self.origin_offset + distance),
            // The ray started inside of the body, which extends no farther than its box.
            (None, Some(medium)) => {
                beer_lambert(scene, medium, self.length_in(scene, medium, distance))
            }
            (None, None) => Vec3::ONE,
        }
    }

    /// Returns the transmittance of the medium around the ray's origin up to `distance`.
    pub fn transmittance_to(&self, scene: &FlatScene, distance: f32) -> Vec3 {
        self.transmittance(scene, self.media, distance)
    }

    /// Returns the transmittance of a ray that hits nothing.
    ///
    /// A body that the ray never leaves extends no farther than its box.
    pub fn transmittance_to_end(&self, scene: &FlatScene) -> Vec3 {
        let Some(medium) = self.media.innermost() else { return Vec3::ONE };
        let end = self.ray.t_max;
        let is_endless = end == f32::INFINITY;
        let length =
            if is_endless { self.length_in(scene, medium, end) } else { self.origin_offset + end };
        beer_lambert(scene, medium, length)
    }

    /// Returns the length of the ray up to `end` within the box of an instance.
    fn length_in(&self, scene: &FlatScene, instance: u32, end: f32) -> f32 {
        let whole = Ray { t_min: -self.origin_offset, t_max: end, ..self.ray };
        scene.instances[instance as usize].bounds.length_along(&whole)
    }
}

/// Returns the transmittance of `length` world units of an instance's medium (Beer-Lambert law).
fn beer_lambert(scene: &FlatScene, instance: u32, length: f32) -> Vec3 {
    let Material { attenuation_color, attenuation_distance, .. } = material(scene, instance);
    if *attenuation_distance == f32::INFINITY {
        return Vec3::ONE;
    }
    let scale = scene.instances[instance as usize].max_scale;
    attenuation_color.powf(length / (attenuation_distance * scale))
}

fn material(scene: &FlatScene, instance: u32) -> &Material {
    &scene.materials[scene.instances[instance as usize].material_idx as usize]
}

#[cfg(test)]
mod tests {
    //! Bodies on a medium stack are entered and left in any order.

    use super::*;

    #[test]
    fn bodies_are_left_in_any_order() {
        let media = MediumStack::AIR.push(7).push(3).push(9);
        assert_eq!(media.innermost(), Some(9));
        assert_eq!(media.remove(7), MediumStack::AIR.push(3).push(9));
        assert_eq!(media.remove(9).innermost(), Some(3));
        assert_eq!(media.remove(5), media);
        assert_eq!(media.remove(9).remove(3).remove(7), MediumStack::AIR);
    }

    #[test]
    fn a_body_around_the_ray_origin_encloses_all_bodies_entered_later() {
        let media = MediumStack::AIR.push(1).push_outer(2);
        assert_eq!((media.innermost(), media.remove(1).innermost()), (Some(1), Some(2)));
    }

    #[test]
    fn a_full_stack_drops_the_outermost_bodies() {
        let media = (0..6).fold(MediumStack::AIR, MediumStack::push);
        assert_eq!(media.0, [5, 4, 3, 2]);
        assert_eq!(media.push_outer(9), media);
    }
}
