//! What rays see that leave the scene.

use crate::flat::FlatScene;
use crate::math::Vec3;
use crate::scene::{Background, Light, Sun};

/// Radiance of the sun's disc in mirrors, at most: its true one, tens of thousands, would speckle pictures.
const BRIGHTEST_SUN: f32 = 50.0;

/// What a reflected or refracted ray in `direction` (unit) sees: the sky, or the background where there is
/// none; the sun too if it `sees_sun`.
pub fn surroundings(scene: &FlatScene, direction: Vec3, sees_sun: bool) -> Vec3 {
    let mut radiance = Vec3::ZERO;
    let mut has_sky = false;
    for light in &scene.lights {
        match light {
            Light::Sky(sky) => {
                radiance += sky.radiance(direction);
                has_sky = true;
            }
            Light::Environment(environment) => {
                radiance += environment.radiance(direction);
                has_sky = true;
            }
            Light::Sun(sun) if sees_sun => radiance += disc(sun, direction),
            Light::Sun(_) | Light::Headlight(_) => {}
        }
    }
    if !has_sky && let Background::Gradient { top, bottom } = scene.background {
        let up = scene.camera.view_up.as_vec3().normalize_or(Vec3::Z);
        radiance += top.lerp(bottom, 0.5 - 0.5 * direction.dot(up));
    }
    radiance
}

fn disc(sun: &Sun, direction: Vec3) -> Vec3 {
    let cos = (sun.angular_diameter_deg.to_radians() / 2.0).cos();
    if direction.dot(sun.direction) < cos || 1.0 <= cos {
        return Vec3::ZERO;
    }
    // A light of strength 1 brings pi to a surface that faces it, from 2 pi (1 - cos) of directions.
    sun.color * (0.5 / (1.0 - cos)).min(BRIGHTEST_SUN)
}
