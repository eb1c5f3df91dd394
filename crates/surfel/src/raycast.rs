//! Rays in world coordinates against a built scene, after Open3D's `RaycastingScene`.

use crate::built_scene::BuiltScene;
use crate::ray_query::WorldRays;
use rayon::prelude::*;
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::math::{Aabb, DVec3};
use surfel_core::trace::{InstanceFilter, SceneHit, scene_hits, scene_occlusions};

/// The nearest surface on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance from the ray's origin, in multiples of the length of its direction.
    pub t_hit: f64,
    /// World coordinates of the hit.
    pub position: [f64; 3],
    /// Unit normal that faces the ray's origin.
    pub normal: [f32; 3],
    /// Index of the instance that was hit.
    pub instance: u32,
    /// The point that is nearest to the hit, by its index among those that were read; none for triangles.
    pub point: Option<u32>,
    /// The triangle that was hit, by its index in its mesh; none for points.
    pub triangle: Option<u32>,
}

/// Returns the corners of a box around all instances, in world coordinates: least and greatest.
pub(crate) fn world_bounds(flat: &FlatScene) -> [[f64; 3]; 2] {
    let boxes = flat.instances.iter().map(|instance| instance.bounds);
    let all = boxes.fold(Aabb::EMPTY, Aabb::union);
    [all.min, all.max].map(|corner| (flat.origin + corner.as_dvec3()).to_array())
}

impl BuiltScene {
    /// Returns the corners of a box around everything, in world coordinates: least and greatest.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        world_bounds(self.flat())
    }

    /// Finds the nearest surface on each ray. A ray is `[x, y, z, dx, dy, dz]`: origin and direction in world
    /// coordinates; the direction has any length but 0.
    pub fn cast_rays(&self, rays: &[[f64; 6]]) -> Vec<Option<RayHit>> {
        let local = self.local_rays(rays, f32::INFINITY);
        let mut hits = vec![SceneHit::MISS; rays.len()];
        scene_hits(self.flat(), self.simd(), InstanceFilter::All, local.local(), &mut hits);
        let found = hits.iter().zip(rays).map(|(hit, ray)| self.world_hit(hit, ray));
        found.collect()
    }

    /// Returns whether any surface lies on each ray up to the end of its direction.
    pub fn test_occlusions(&self, rays: &[[f64; 6]]) -> Vec<bool> {
        let local = self.local_rays(rays, 1.0);
        let mut occluded = vec![false; rays.len()];
        scene_occlusions(
            self.flat(),
            self.simd(),
            InstanceFilter::All,
            local.local(),
            &mut occluded,
        );
        occluded
    }

    fn local_rays(&self, rays: &[[f64; 6]], t_max: f32) -> WorldRays {
        WorldRays::new(rays.par_iter().copied(), (0.0, t_max), self.flat())
    }

    fn world_hit(&self, hit: &SceneHit, ray: &[f64; 6]) -> Option<RayHit> {
        if hit.is_miss() {
            return None;
        }
        let [x, y, z, dx, dy, dz] = *ray;
        let (origin, direction) = (DVec3::new(x, y, z), DVec3::new(dx, dy, dz));
        let t_hit = f64::from(hit.distance) / direction.length();
        let instance = self.flat().instances.get(hit.instance as usize)?;
        let is_point = matches!(self.flat().geometry(instance), FlatGeometry::Cloud(_));
        let source = || self.source_index(hit.instance as usize, hit.id).unwrap_or(hit.id);
        Some(RayHit {
            t_hit,
            position: (origin + t_hit * direction).to_array(),
            normal: hit.normal.to_array(),
            instance: hit.instance,
            point: is_point.then(source),
            triangle: (!is_point).then_some(hit.id),
        })
    }
}
