//! Transmittance along shadow rays: opaque surfaces block them, glass and alpha-blended layers tint them.

use super::media::MediumRay;
use super::shading::Shading;
use super::specular::{fresnel, thin_slab_fresnel};
use crate::error::Result;
use crate::math::{Ray, Vec3};
use crate::trace::{InstanceFilter, SceneHit, Tracer};

/// Maximum number of surfaces that a shadow ray passes; behind more of them nothing arrives.
pub const MAX_SURFACES: usize = 64;
/// Transmittance below which a shadow ray counts as blocked.
pub const MIN_TRANSMITTANCE: f32 = 1.0 / 512.0;

/// Computes the transmittance of each ray up to its `t_max` and writes it to `transmittances`.
///
/// Light goes on straight behind a surface, so caustics are left out. `medium_ray` returns the ray of an
/// index together with the media that its origin lies in.
///
/// # Errors
///
/// Fails once the work is cancelled.
pub fn shadow_transmittance(
    tracer: &Tracer,
    rays: &[Ray],
    medium_ray: impl Fn(usize) -> MediumRay,
    transmittances: &mut [Vec3],
) -> Result<()> {
    let scene = tracer.scene;
    let mut occluded = vec![false; rays.len()];
    tracer.occlusions(InstanceFilter::Opaque, rays, &mut occluded)?;
    for (transmittance, is_occluded) in transmittances.iter_mut().zip(&occluded) {
        *transmittance = if *is_occluded { Vec3::ZERO } else { Vec3::ONE };
    }
    if scene.has_gaussians {
        attenuate_by_gaussians(tracer, rays, &mut occluded, transmittances)?;
    }
    if !scene.is_transmissive {
        return Ok(());
    }
    let unoccluded = (0..rays.len() as u32).filter(|&i| !occluded[i as usize]);
    let mut active: Vec<(u32, MediumRay)> =
        unoccluded.map(|i| (i, medium_ray(i as usize))).collect();
    let mut rays: Vec<Ray> = active.iter().map(|(_, medium_ray)| medium_ray.ray).collect();
    let mut hits = vec![SceneHit::MISS; rays.len()];
    for _ in 0..MAX_SURFACES {
        hits.truncate(rays.len());
        tracer.hits(InstanceFilter::Transmissive, &rays, &mut hits)?;
        let mut n_active = 0;
        for i in 0..rays.len() {
            let ((ray_idx, medium_ray), hit) = (active[i], &hits[i]);
            let transmittance = &mut transmittances[ray_idx as usize];
            if hit.is_miss() {
                *transmittance *= medium_ray.transmittance_to_end(scene);
                continue;
            }
            let ray = medium_ray.ray;
            let shading = Shading::new(scene, &ray, hit);
            let interface = medium_ray.interface(scene, &shading, hit);
            *transmittance *= interface.transmittance
                * surface_transmittance(&shading, ray.direction, interface.eta);
            if transmittance.max_element() < MIN_TRANSMITTANCE {
                *transmittance = Vec3::ZERO;
                continue;
            }
            let t_max = (ray.t_max - hit.distance).max(0.0);
            let next = Ray { t_max, ..shading.spawn(ray.direction) };
            rays[n_active] = next;
            active[n_active] = (ray_idx, MediumRay::from_surface(&shading, next, interface.far));
            n_active += 1;
        }
        rays.truncate(n_active);
        active.truncate(n_active);
        if rays.is_empty() {
            return Ok(());
        }
    }
    for (ray_idx, _) in active {
        transmittances[ray_idx as usize] = Vec3::ZERO;
    }
    Ok(())
}

/// Multiplies the transmittances of rays that reach the light by those of the Gaussians on the way.
fn attenuate_by_gaussians(
    tracer: &Tracer,
    rays: &[Ray],
    occluded: &mut [bool],
    transmittances: &mut [Vec3],
) -> Result<()> {
    let open: Vec<usize> = (0..rays.len()).filter(|i| !occluded[*i]).collect();
    let rays: Vec<Ray> = open.iter().map(|i| rays[*i]).collect();
    let lights = tracer.gaussians_along(&rays)?;
    for (i, light) in open.into_iter().zip(lights) {
        transmittances[i] *= light.transmittance;
        if light.transmittance < MIN_TRANSMITTANCE {
            (transmittances[i], occluded[i]) = (Vec3::ZERO, true);
        }
    }
    Ok(())
}

/// Returns the fraction of light that passes a surface.
///
/// Light is not refracted here, so both sides of a body use the angle in the thinner medium.
fn surface_transmittance(shading: &Shading, direction: Vec3, eta: f32) -> Vec3 {
    let cos = -shading.normal.dot(direction);
    let eta = eta.min(1.0 / eta);
    let reflected = match shading.is_thin {
        true => thin_slab_fresnel(cos, eta),
        false => fresnel(cos, eta),
    };
    let entering = (1.0 - reflected) * (1.0 - shading.metallic);
    let transmitted = entering * shading.transmission * shading.base_color;
    Vec3::splat(1.0 - shading.alpha) + shading.alpha * transmitted
}
