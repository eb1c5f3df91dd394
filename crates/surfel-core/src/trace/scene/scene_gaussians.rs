//! The light of all Gaussians of a scene along rays.

use crate::flat::{FlatGeometry, FlatScene, Instance};
use crate::math::Ray;
use crate::trace::query::gaussian_light::{GaussianLight, PlacedGaussians, gaussian_light};
use crate::trace::scene::box_entries::box_entry;
use crate::trace::simd::Simd;

/// Computes the light that the Gaussians of a scene add along each ray up to its `t_max`, and what they let pass. Those of
/// all instances are composited together, in the order in which the ray passes them.
pub fn scene_gaussians(scene: &FlatScene, simd: Simd, rays: &[Ray], lights: &mut [GaussianLight]) {
    let (mut placed, mut bounds) = (Vec::new(), Vec::new());
    for instance in scene.instances.iter().filter(|instance| instance.is_gaussian) {
        if let FlatGeometry::Cloud(cloud) = scene.geometry(instance) {
            let moved: Option<&Instance> = (!instance.is_identity).then_some(instance);
            placed.push(PlacedGaussians { gaussians: &cloud.gaussians, instance: moved });
            bounds.push(instance.bounds);
        }
    }
    let enters = |cloud_idx: usize, ray: &Ray, limit: f32| {
        let entry = box_entry(&bounds[cloud_idx], ray);
        entry < f32::INFINITY && entry <= limit
    };
    gaussian_light(&placed, simd, enters, rays, lights);
}
