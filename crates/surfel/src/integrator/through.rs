//! Light that reaches a place: stopped by what is opaque, tinted by what it goes through.

use super::shading::Shading;
use super::specular::{fresnel, pane_fresnel};
use crate::flat::FlatScene;
use crate::math::{Ray, Vec3};
use crate::scene::Material;
use crate::trace::{self, SceneHit, Simd, Which};

/// Surfaces that light goes through at most.
const MOST_SURFACES: usize = 64;
/// Light below this share is none.
const LEAST: f32 = 1.0 / 512.0;

/// The share of light that goes along each ray to its end. It goes straight on: what glass focuses is left
/// out.
pub fn light_through(scene: &FlatScene, simd: Simd, rays: &[Ray], shares: &mut [Vec3]) {
    let mut occluded = vec![false; rays.len()];
    trace::scene_occlusions(scene, simd, Which::Opaque, rays, &mut occluded);
    for (share, is_occluded) in shares.iter_mut().zip(&occluded) {
        *share = if *is_occluded { Vec3::ZERO } else { Vec3::ONE };
    }
    if !scene.is_see_through {
        return;
    }
    let open = (0..rays.len() as u32).filter(|&i| !occluded[i as usize]);
    let mut passing: Vec<(u32, Option<u32>)> = open.map(|ray_idx| (ray_idx, None)).collect();
    let mut rays: Vec<Ray> = passing.iter().map(|(i, _)| rays[*i as usize]).collect();
    let mut hits = vec![SceneHit::MISS; rays.len()];
    for _ in 0..MOST_SURFACES {
        hits.truncate(rays.len());
        trace::scene_hits(scene, simd, Which::SeeThrough, &rays, &mut hits);
        let mut n_left = 0;
        for i in 0..rays.len() {
            let ((ray_idx, medium), ray, hit) = (passing[i], rays[i], &hits[i]);
            if hit.is_miss() {
                continue;
            }
            let share = &mut shares[ray_idx as usize];
            let shading = Shading::new(scene, &ray, hit);
            *share *= passed(&shading, ray.direction);
            let is_inner = scene.has_outside(hit.instance) && hit.is_inner;
            let medium = medium.or_else(|| is_inner.then_some(hit.instance));
            if let Some(medium) = medium {
                *share *= absorbed(scene, medium, hit.distance);
            }
            if share.max_element() < LEAST {
                *share = Vec3::ZERO;
                continue;
            }
            let on = shading.spawn(ray.direction);
            let t_max = (ray.t_max - hit.distance).max(0.0);
            rays[n_left] = Ray { t_max, ..on };
            let is_solid = 0.0 < shading.transmission && !shading.is_thin;
            let is_leaving = medium == Some(hit.instance);
            let medium = if is_solid { (!is_leaving).then_some(hit.instance) } else { medium };
            passing[n_left] = (ray_idx, medium);
            n_left += 1;
        }
        rays.truncate(n_left);
        passing.truncate(n_left);
        if rays.is_empty() {
            return;
        }
    }
    for (ray_idx, _) in passing {
        shares[ray_idx as usize] = Vec3::ZERO;
    }
}

/// What a surface lets pass.
fn passed(shading: &Shading, direction: Vec3) -> Vec3 {
    let cos = -shading.normal.dot(direction);
    let at_boundary = match shading.is_thin {
        true => pane_fresnel(cos, shading.ior),
        false => fresnel(cos, 1.0 / shading.ior),
    };
    let entering = (1.0 - at_boundary) * (1.0 - shading.metallic);
    let through = entering * shading.transmission * shading.base_color;
    Vec3::splat(1.0 - shading.alpha) + shading.alpha * through
}

/// What is left of light after a way inside an instance (Beer's law).
pub fn absorbed(scene: &FlatScene, instance: u32, distance: f32) -> Vec3 {
    let instance = &scene.instances[instance as usize];
    let Material { attenuation_color, attenuation_distance, .. } =
        scene.materials[instance.material as usize];
    if !(attenuation_distance < f32::INFINITY && distance < f32::INFINITY) {
        return Vec3::ONE;
    }
    attenuation_color.powf(distance / (attenuation_distance * instance.scale))
}
