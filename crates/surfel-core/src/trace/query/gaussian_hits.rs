//! The hits of rays on Gaussians where these let half of the light pass, for queries that want a surface.

use crate::flat::FlatCloud;
use crate::math::Ray;
use crate::trace::query::gaussian_light::{GaussianLight, PlacedGaussians, gaussian_light};
use crate::trace::query::surface_hit::SurfaceHit;
use crate::trace::simd::Simd;

/// Finds the place on each ray behind which half of the light or less passes.
pub fn gaussian_hits(cloud: &FlatCloud, simd: Simd, rays: &[Ray], hits: &mut [SurfaceHit]) {
    let lights = lights(cloud, simd, rays);
    for ((ray, light), hit) in rays.iter().zip(&lights).zip(hits) {
        *hit = SurfaceHit::MISS;
        let Some(median) = light.median else { continue };
        let gaussian = cloud.gaussians.gaussian(median.slot);
        let axis = gaussian.thinnest_axis();
        *hit = SurfaceHit {
            distance: median.distance,
            id: cloud.gaussians.id(median.slot),
            slot: median.slot,
            radius: gaussian.max_deviation(),
            normal: if axis.dot(ray.direction) < 0.0 { axis } else { -axis },
            color: light.color(),
            surface: cloud.surface,
            is_backface: false,
        };
    }
}

/// Finds out for each ray whether half of the light or less passes up to its end.
pub fn gaussian_occlusions(cloud: &FlatCloud, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    let lights = lights(cloud, simd, rays);
    occluded.iter_mut().zip(&lights).for_each(|(found, light)| *found = light.median.is_some());
}

fn lights(cloud: &FlatCloud, simd: Simd, rays: &[Ray]) -> Vec<GaussianLight> {
    let placed = PlacedGaussians { gaussians: &cloud.gaussians, instance: None };
    let mut lights = vec![GaussianLight::NONE; rays.len()];
    gaussian_light(&[placed], simd, |_, _, _| true, rays, &mut lights);
    lights
}
