//! Radiance along rays that leave the scene.

use crate::flat::FlatScene;
use crate::math::Vec3;
use crate::scene::{Background, Light, Sun};

/// Maximum radiance of the sun's disc in mirrors. Its true radiance, tens of thousands, would speckle
/// pictures.
pub const MAX_SUN_RADIANCE: f32 = 50.0;

/// Returns the radiance that a ray which leaves the scene in `direction` (unit) brings.
///
/// This is the environment's radiance. Without an environment it is the background as the picture shows
/// it, or the sky's radiance where the background is transparent. `with_sun` adds the sun's disc.
pub fn background_radiance(scene: &FlatScene, direction: Vec3, with_sun: bool) -> Vec3 {
    let (mut sky, mut environment, mut suns) = (Vec3::ZERO, None, Vec3::ZERO);
    for light in &scene.lights {
        match light {
            Light::Sky(light) => sky += light.radiance(direction),
            Light::Environment(light) => {
                *environment.get_or_insert(Vec3::ZERO) += light.radiance(direction);
            }
            Light::Sun(sun) if with_sun => suns += disc_radiance(sun, direction),
            Light::Sun(_) | Light::Headlight(_) => {}
        }
    }
    let ambient = match (environment, scene.background) {
        (Some(environment), _) => environment + sky,
        (None, Background::Gradient { top, bottom }) => {
            // The gradient spans 60 degrees, about a picture's angle of view; its end colours continue
            // above and below.
            let up = scene.camera.view_up.as_vec3().normalize_or(Vec3::Z);
            top.lerp(bottom, (0.5 - direction.dot(up)).clamp(0.0, 1.0))
        }
        (None, Background::Transparent | Background::Environment) => sky,
    };
    ambient + suns
}

/// Returns the radiance of the sun's disc in `direction`, which is zero outside of the disc.
fn disc_radiance(sun: &Sun, direction: Vec3) -> Vec3 {
    let cos = (sun.angular_diameter_deg.to_radians() / 2.0).cos();
    if direction.dot(sun.direction) < cos || 1.0 <= cos {
        return Vec3::ZERO;
    }
    // Unit strength means an irradiance of pi at normal incidence, from a solid angle of 2 pi (1 - cos).
    sun.color * (0.5 / (1.0 - cos)).min(MAX_SUN_RADIANCE)
}
