//! Light that reaches a place: stopped by what is opaque, tinted by what it goes through.

use super::media::Way;
use super::shading::Shading;
use super::specular::{fresnel, pane_fresnel};
use crate::error::Result;
use crate::math::{Ray, Vec3};
use crate::trace::{SceneHit, Tracer, Which};

/// Surfaces that light goes through at most.
const MOST_SURFACES: usize = 64;
/// Light below this share is none.
const LEAST: f32 = 1.0 / 512.0;

/// The share of light that goes along each ray to its end. It goes straight on: what glass focuses is left
/// out. `way` has what the ray of an index begins inside of.
pub fn light_through(
    tracer: &Tracer,
    rays: &[Ray],
    way: impl Fn(usize) -> Way,
    shares: &mut [Vec3],
) -> Result<()> {
    let scene = tracer.scene;
    let mut occluded = vec![false; rays.len()];
    tracer.occlusions(Which::Opaque, rays, &mut occluded)?;
    for (share, is_occluded) in shares.iter_mut().zip(&occluded) {
        *share = if *is_occluded { Vec3::ZERO } else { Vec3::ONE };
    }
    if !scene.is_see_through {
        return Ok(());
    }
    let open = (0..rays.len() as u32).filter(|&i| !occluded[i as usize]);
    let mut passing: Vec<(u32, Way)> = open.map(|i| (i, way(i as usize))).collect();
    let mut rays: Vec<Ray> = passing.iter().map(|(_, way)| way.ray).collect();
    let mut hits = vec![SceneHit::MISS; rays.len()];
    for _ in 0..MOST_SURFACES {
        hits.truncate(rays.len());
        tracer.hits(Which::SeeThrough, &rays, &mut hits)?;
        let mut n_left = 0;
        for i in 0..rays.len() {
            let ((ray_idx, way), hit) = (passing[i], &hits[i]);
            let share = &mut shares[ray_idx as usize];
            if hit.is_miss() {
                *share *= way.transmittance_to_end(scene);
                continue;
            }
            let ray = way.ray;
            let shading = Shading::new(scene, &ray, hit);
            let boundary = way.boundary(scene, &shading, hit);
            *share *= boundary.transmittance * passed(&shading, ray.direction, boundary.eta);
            if share.max_element() < LEAST {
                *share = Vec3::ZERO;
                continue;
            }
            let t_max = (ray.t_max - hit.distance).max(0.0);
            let on = Ray { t_max, ..shading.spawn(ray.direction) };
            rays[n_left] = on;
            passing[n_left] = (ray_idx, Way::from_surface(&shading, on, boundary.beyond));
            n_left += 1;
        }
        rays.truncate(n_left);
        passing.truncate(n_left);
        if rays.is_empty() {
            return Ok(());
        }
    }
    for (ray_idx, _) in passing {
        shares[ray_idx as usize] = Vec3::ZERO;
    }
    Ok(())
}

/// What a surface lets pass. As nothing bends the light, it meets both sides of a body at the angle that
/// it has in the thinner medium.
fn passed(shading: &Shading, direction: Vec3, eta: f32) -> Vec3 {
    let cos = -shading.normal.dot(direction);
    let eta = eta.min(1.0 / eta);
    let at_boundary = match shading.is_thin {
        true => pane_fresnel(cos, eta),
        false => fresnel(cos, eta),
    };
    let entering = (1.0 - at_boundary) * (1.0 - shading.metallic);
    let through = entering * shading.transmission * shading.base_color;
    Vec3::splat(1.0 - shading.alpha) + shading.alpha * through
}
