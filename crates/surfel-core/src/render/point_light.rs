//! Light on rasterised points that have normals: that of the scene's lights, without shadows.

use crate::flat::{FlatPunctualLight, FlatScene};
use crate::math::{Basis, Vec3, cosine_hemisphere, owen_sobol_2d};
use crate::scene::{Light, PunctualLightKind};
use std::sync::LazyLock;

/// Number of directions from which light of a sky or an environment is taken. Points get all of it at once: they are drawn
/// once a picture.
const N_DIRECTIONS: usize = 16;

/// The directions from which light of a sky or an environment is taken, around the normal +Z.
static DIRECTIONS: LazyLock<[Vec3; N_DIRECTIONS]> =
    LazyLock::new(|| std::array::from_fn(|i| cosine_hemisphere(owen_sobol_2d(i as u32, 0))));

/// A point that is lit.
#[derive(Clone, Copy, Debug)]
pub struct LitPoint {
    /// Position relative to the scene's origin.
    pub position: Vec3,
    /// Unit normal, facing the viewer.
    pub normal: Vec3,
    /// Unit direction toward the viewer.
    pub to_viewer: Vec3,
}

/// True if a scene has lights that shade points by their normals.
pub fn has_lights(scene: &FlatScene) -> bool {
    !(scene.lights.is_empty() && scene.punctual_lights.is_empty())
}

impl LitPoint {
    /// Returns a point whose normal is turned toward the viewer.
    pub fn new(position: Vec3, normal: Vec3, to_viewer: Vec3) -> Self {
        let normal = if normal.dot(to_viewer) < 0.0 { -normal } else { normal };
        Self { position, normal, to_viewer }
    }

    /// Returns what a white matte surface reflects here.
    pub fn reflected(&self, lights: &[Light], punctual: &[FlatPunctualLight]) -> Vec3 {
        let lights = lights.iter().map(|light| match light {
            Light::Sun(sun) => self.cosine(sun.direction) * sun.color,
            Light::Sky(sky) => self.mean(|direction| sky.radiance(direction)),
            Light::Environment(environment) => {
                self.mean(|direction| environment.radiance(direction))
            }
            Light::Headlight(strength) => Vec3::splat(strength * self.cosine(self.to_viewer)),
        });
        let punctual = punctual.iter().map(|light| self.punctual(light));
        lights.chain(punctual).sum()
    }

    fn cosine(&self, direction: Vec3) -> f32 {
        self.normal.dot(direction).max(0.0)
    }

    fn mean(&self, radiance: impl Fn(Vec3) -> Vec3) -> Vec3 {
        let basis = Basis::around(self.normal);
        let sum: Vec3 = DIRECTIONS.iter().map(|&local| radiance(basis.to_world(local))).sum();
        sum / N_DIRECTIONS as f32
    }

    fn punctual(&self, light: &FlatPunctualLight) -> Vec3 {
        if light.kind == PunctualLightKind::Directional {
            return self.cosine(-light.direction) * light.color;
        }
        let offset = light.position - self.position;
        let Some(direction) = offset.try_normalize() else { return Vec3::ZERO };
        light.falloff(-direction, offset.length()) * self.cosine(direction) * light.color
    }
}

#[cfg(test)]
mod tests {
    //! A sun lights by the cosine, a headlight what faces the viewer, a uniform sky everything.

    use super::*;
    use crate::scene::{Sky, Sun};

    fn reflected(light: Light, normal: Vec3) -> f32 {
        LitPoint::new(Vec3::ZERO, normal, Vec3::Z).reflected(&[light], &[]).x
    }

    #[test]
    fn each_light_has_its_closed_form() {
        let tilted = Vec3::new(0.6, 0.0, 0.8);
        let sun = Sun { direction: Vec3::X, color: Vec3::ONE, angular_diameter_deg: 0.0 };
        let (zenith, ground) = (Vec3::ONE, Vec3::ONE);
        let sky = Sky { up: Vec3::Z, zenith, ground, ao_distance: 1.0 };
        for (light, expected) in
            [(Light::Sun(sun), 0.6), (Light::Headlight(0.5), 0.4), (Light::Sky(sky), 1.0)]
        {
            // The sign of a normal does not count.
            assert!((reflected(light.clone(), tilted) - expected).abs() < 1e-6, "{light:?}");
            assert!((reflected(light.clone(), -tilted) - expected).abs() < 1e-6, "{light:?}");
        }
    }
}
