//! The support of the hits of rays on a scene.

use crate::flat::{FlatGeometry, FlatScene};
use crate::math::{Lanes, Ray};
use crate::trace::query::hit::Hit;
use crate::trace::query::support::{Support, support};
use crate::trace::scene::scene_hit::SceneHit;
use crate::trace::simd::{Simd, dispatch_simd};

/// Finds the support of hits, which [`scene_hits`](crate::trace::scene_hits) found.
pub fn scene_supports(
    scene: &FlatScene,
    simd: Simd,
    rays: &[Ray],
    hits: &[SceneHit],
    supports: &mut [Support],
) {
    dispatch_simd!(
        simd,
        supports_kernel(
            scene: &FlatScene,
            rays: &[Ray],
            hits: &[SceneHit],
            supports: &mut [Support]
        )
    );
}

#[inline(always)]
fn supports_kernel<L: Lanes>(
    scene: &FlatScene,
    rays: &[Ray],
    hits: &[SceneHit],
    supports: &mut [Support],
) {
    for ((ray, hit), found) in rays.iter().zip(hits).zip(supports) {
        *found = Support::NONE;
        let Some(surface) = hit.surface else { continue };
        let instance = &scene.instances[hit.instance as usize];
        if let FlatGeometry::Cloud(cloud) = scene.geometry(instance) {
            let (ray, scale) = instance.object_ray(ray);
            let hit = Hit { distance: scale * hit.distance, slot: hit.slot };
            *found = support::<L>(cloud, &ray, &hit, surface);
        }
    }
}
