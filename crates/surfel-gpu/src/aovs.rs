//! AOVs from the hits of a device.

use crate::numbers::{NONE, SURFACES, TRIANGLE};
use crate::pixel_order::PixelOrder;
use crate::records::HitRecord;
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::image::Aovs;
use surfel_core::integrator::albedo;
use surfel_core::math::Vec3;
use surfel_core::scene::View;
use surfel_core::scene::color::SupportColors;
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::SceneHit;

/// The picture whose AOVs are set.
pub struct AovSource<'a> {
    /// The scene.
    pub scene: &'a FlatScene,
    /// The camera for the picture.
    pub view: &'a View,
}

/// Sets the AOVs of the pixels from number `first` on by the hits of the rays through their centres.
pub fn set_aovs(
    aovs: &mut Aovs,
    hits: &[HitRecord],
    source: &AovSource,
    order: PixelOrder,
    first: u32,
) {
    for (i, hit) in hits.iter().enumerate().filter(|(_, hit)| hit.instance != NONE) {
        let scene = source.scene;
        let (x, y) = order.pixel_of(first + i as u32);
        let ray = source.view.ray(x as f32 + 0.5, y as f32 + 0.5);
        let position = ray.at(hit.distance);
        let pixel = order.image_idx(first + i as u32);
        aovs.depth[pixel] = source.view.depth(position);
        aovs.position[pixel] = position;
        aovs.normal[pixel] = Vec3::from_array(hit.normal);
        aovs.point_id[pixel] = point_id(scene, hit);
        aovs.instance_id[pixel] = hit.instance;
        aovs.albedo[pixel] = albedo(scene, &ray, &scene_hit(scene, hit));
        if hit.surface != TRIANGLE {
            aovs.support_count[pixel] = hit.support_count;
            aovs.support_distance[pixel] = hit.support_distance;
        }
    }
}

fn point_id(scene: &FlatScene, hit: &HitRecord) -> u32 {
    match scene.geometry(&scene.instances[hit.instance as usize]) {
        FlatGeometry::Cloud(cloud) if cloud.surface == SurfaceKind::Gaussian => {
            cloud.gaussians.id(hit.slot)
        }
        FlatGeometry::Cloud(cloud) => cloud.points_of(SURFACES[hit.surface as usize]).id(hit.slot),
        FlatGeometry::Mesh(mesh) => mesh.triangles.id(hit.slot),
    }
}

/// Returns the part of a hit that its albedo depends on.
fn scene_hit(scene: &FlatScene, hit: &HitRecord) -> SceneHit {
    let [second, third] = hit.barycentrics;
    let color = match support_colors(scene, hit) {
        Some(colors) => colors.color(hit.support_distance),
        None => Vec3::from_array(hit.color),
    };
    SceneHit {
        distance: hit.distance,
        instance: hit.instance,
        id: point_id(scene, hit),
        slot: hit.slot,
        barycentrics: (second, third),
        radius: hit.radius,
        spawn_radius: hit.radius,
        normal: Vec3::from_array(hit.normal),
        geometric_normal: Vec3::from_array(hit.geometric_normal),
        color,
        alpha: hit.alpha,
        surface: SURFACES.get(hit.surface as usize).copied(),
        is_backface: hit.is_backface == 1,
    }
}

/// Returns the colours by support of the cloud that was hit, if it has them. Trained Gaussians keep their own.
fn support_colors<'s>(scene: &'s FlatScene, hit: &HitRecord) -> Option<&'s SupportColors> {
    match scene.geometry(&scene.instances[hit.instance as usize]) {
        FlatGeometry::Cloud(cloud) if cloud.surface != SurfaceKind::Gaussian => {
            cloud.support_colors.as_ref()
        }
        _ => None,
    }
}
