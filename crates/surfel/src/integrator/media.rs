//! Media: the bodies of glass that light is inside of, one within the other, and what they absorb.

use super::shading::Shading;
use crate::flat::FlatScene;
use crate::math::{Ray, Vec3};
use crate::scene::Material;
use crate::trace::SceneHit;

/// The instances that light is inside of, that which it entered last first: this one's glass is around it,
/// also where bodies overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Media([u32; MOST_NESTED]);

/// Of more, the outermost are forgotten.
const MOST_NESTED: usize = 4;
const NONE: u32 = u32::MAX;

impl Media {
    pub const AIR: Self = Self([NONE; MOST_NESTED]);

    fn innermost(self) -> Option<u32> {
        (self.0[0] != NONE).then_some(self.0[0])
    }

    fn holds(self, instance: u32) -> bool {
        self.0.contains(&instance)
    }

    fn entered(self, instance: u32) -> Self {
        let mut nested = [instance; MOST_NESTED];
        nested[1..].copy_from_slice(&self.0[..MOST_NESTED - 1]);
        Self(nested)
    }

    fn left(self, instance: u32) -> Self {
        let mut others = self.0.into_iter().filter(|other| *other != instance);
        Self([(); MOST_NESTED].map(|()| others.next().unwrap_or(NONE)))
    }

    /// The same within `instance`.
    fn held_by(mut self, instance: u32) -> Self {
        if let Some(free) = self.0.iter_mut().find(|place| **place == NONE) {
            *free = instance;
        }
        self
    }

    fn ior(self, scene: &FlatScene) -> f32 {
        self.innermost().map_or(1.0, |instance| material(scene, instance).ior)
    }
}

/// A ray, and what it goes through.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    pub ray: Ray,
    pub media: Media,
    /// Length before the ray's origin, which is a little off the surface that it left.
    lead: f32,
}

/// Where a way meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Boundary {
    /// On the side that the ray comes from, and beyond.
    pub here: Media,
    pub beyond: Media,
    /// Index of refraction here over that beyond.
    pub eta: f32,
    /// Of the way to it.
    pub transmittance: Vec3,
}

impl Way {
    /// In air, until a surface tells otherwise.
    pub fn from_camera(ray: Ray) -> Self {
        Self { ray, media: Media::AIR, lead: 0.0 }
    }

    /// A ray that left a surface.
    #[inline]
    pub fn from_surface(shading: &Shading, ray: Ray, media: Media) -> Self {
        /// Along the surface, as a plane, the ray would come from far away.
        const LEAST_COS: f32 = 0.1;
        let height = (ray.origin - shading.position).dot(shading.facet).abs();
        let lead = height / ray.direction.dot(shading.facet).abs().max(LEAST_COS);
        Self { ray, media, lead }
    }

    #[inline]
    pub fn boundary(&self, scene: &FlatScene, shading: &Shading, hit: &SceneHit) -> Boundary {
        let instance = hit.instance;
        if !shading.has_inside() {
            // Matte surfaces, whose index is 1, are that under water too.
            let is_matte = shading.ior == 1.0;
            let eta = if is_matte { 1.0 } else { self.media.ior(scene) / shading.ior };
            let transmittance = self.transmittance(scene, self.media, hit.distance);
            return Boundary { here: self.media, beyond: self.media, eta, transmittance };
        }
        let was_entered = self.media.holds(instance);
        let is_inside = if scene.has_outside(instance) { hit.is_inner } else { was_entered };
        let here = match (was_entered, is_inside) {
            (false, true) => self.media.held_by(instance),
            // It left through a hole.
            (true, false) => self.media.left(instance),
            _ => self.media,
        };
        let beyond = if is_inside { here.left(instance) } else { here.entered(instance) };
        let eta = here.ior(scene) / beyond.ior(scene);
        let transmittance = self.transmittance(scene, here, hit.distance);
        Boundary { here, beyond, eta, transmittance }
    }

    /// Up to a distance, where the way turns out to end in `here`.
    fn transmittance(&self, scene: &FlatScene, here: Media, distance: f32) -> Vec3 {
        match (self.media.innermost(), here.innermost()) {
            (Some(medium), _) => beer(scene, medium, self.lead + distance),
            // It began somewhere inside, the body no farther away than its box.
            (None, Some(medium)) => beer(scene, medium, self.length_in(scene, medium, distance)),
            (None, None) => Vec3::ONE,
        }
    }

    /// Of a way that meets nothing: a body that it never leaves reaches no farther than its box.
    pub fn transmittance_to_end(&self, scene: &FlatScene) -> Vec3 {
        let Some(medium) = self.media.innermost() else { return Vec3::ONE };
        let end = self.ray.t_max;
        let is_endless = end == f32::INFINITY;
        let length = if is_endless { self.length_in(scene, medium, end) } else { self.lead + end };
        beer(scene, medium, length)
    }

    /// Length up to `end` within the box of an instance.
    fn length_in(&self, scene: &FlatScene, instance: u32, end: f32) -> f32 {
        let whole = Ray { t_min: -self.lead, t_max: end, ..self.ray };
        scene.instances[instance as usize].bounds.length_along(&whole)
    }
}

/// Share of light that is left after a length in world units (Beer's law).
fn beer(scene: &FlatScene, instance: u32, length: f32) -> Vec3 {
    let Material { attenuation_color, attenuation_distance, .. } = material(scene, instance);
    if *attenuation_distance == f32::INFINITY {
        return Vec3::ONE;
    }
    let scale = scene.instances[instance as usize].scale;
    attenuation_color.powf(length / (attenuation_distance * scale))
}

fn material(scene: &FlatScene, instance: u32) -> &Material {
    &scene.materials[scene.instances[instance as usize].material as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_are_left_in_any_order() {
        let media = Media::AIR.entered(7).entered(3).entered(9);
        assert_eq!(media.innermost(), Some(9));
        assert_eq!(media.left(7), Media::AIR.entered(3).entered(9));
        assert_eq!(media.left(9).innermost(), Some(3));
        assert_eq!(media.left(5), media);
        assert_eq!(media.left(9).left(3).left(7), Media::AIR);
    }

    #[test]
    fn what_light_began_inside_of_holds_all_that_it_entered() {
        let media = Media::AIR.entered(1).held_by(2);
        assert_eq!((media.innermost(), media.left(1).innermost()), (Some(1), Some(2)));
    }

    #[test]
    fn of_too_many_bodies_the_outermost_are_forgotten() {
        let media = (0..6).fold(Media::AIR, Media::entered);
        assert_eq!(media.0, [5, 4, 3, 2]);
        assert_eq!(media.held_by(9), media);
    }
}
