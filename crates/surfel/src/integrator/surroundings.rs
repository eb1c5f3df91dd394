//! What rays see that leave the scene.

use crate::flat::FlatScene;
use crate::math::Vec3;
use crate::scene::{Background, Light, Sun};

/// Radiance of the sun's disc in mirrors, at most: its true one, tens of thousands, would speckle pictures.
const BRIGHTEST_SUN: f32 = 50.0;

/// What a reflected or refracted ray in `direction` (unit) sees: the environment; where there is none the
/// background, as the picture shows it; where that is transparent the sky. The sun too if it `sees_sun`.
pub fn surroundings(scene: &FlatScene, direction: Vec3, sees_sun: bool) -> Vec3 {
    let (mut sky, mut environment, mut suns) = (Vec3::ZERO, None, Vec3::ZERO);
    for light in &scene.lights {
        match light {
            Light::Sky(light) => sky += light.radiance(direction),
            Light::Environment(light) => {
                *environment.get_or_insert(Vec3::ZERO) += light.radiance(direction);
            }
            Light::Sun(sun) if sees_sun => suns += disc(sun, direction),
            Light::Sun(_) | Light::Headlight(_) => {}
        }
    }
    let around = match (environment, scene.background) {
        (Some(environment), _) => environment + sky,
        (None, Background::Gradient { top, bottom }) => {
            // About the angle of view of a picture: the colours that are there above and below.
            let up = scene.camera.view_up.as_vec3().normalize_or(Vec3::Z);
            top.lerp(bottom, (0.5 - direction.dot(up)).clamp(0.0, 1.0))
        }
        (None, Background::Transparent | Background::Surroundings) => sky,
    };
    around + suns
}

fn disc(sun: &Sun, direction: Vec3) -> Vec3 {
    let cos = (sun.angular_diameter_deg.to_radians() / 2.0).cos();
    if direction.dot(sun.direction) < cos || 1.0 <= cos {
        return Vec3::ZERO;
    }
    // A light of strength 1 brings pi to a surface that faces it, from 2 pi (1 - cos) of directions.
    sun.color * (0.5 / (1.0 - cos)).min(BRIGHTEST_SUN)
}
