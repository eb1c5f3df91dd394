//! Rays against a scene: each ray visits instances, nearest box first, and all rays at the same instance are
//! traced there as one batch.

use crate::flat::{FlatGeometry, FlatScene, Instance};
use crate::math::{PACKET_WIDTH, Ray};
use crate::trace::query::any::any_triangles;
use crate::trace::query::closest::closest_triangles;
use crate::trace::query::hit::Hit;
use crate::trace::query::surface::{occlusions, surface_hits_at};
use crate::trace::query::surface_hit::SurfaceHit;
use crate::trace::scene::instance_filter::InstanceFilter;
use crate::trace::scene::scene_hit::{SceneHit, point_hit, triangle_hit};
use crate::trace::scene::scheduler::{InstanceScheduler, RayRanges};
use crate::trace::simd::Simd;
use crate::trace::traversal::octree_walk::PixelSize;
use std::ops::Range;

/// Finds the closest hit of each ray on the accepted instances.
pub fn scene_hits(
    scene: &FlatScene,
    simd: Simd,
    filter: InstanceFilter,
    rays: &[Ray],
    hits: &mut [SceneHit],
) {
    scene_hits_at(scene, simd, filter, PixelSize::ZERO, rays, hits);
}

/// Finds the closest hit of each ray on the accepted instances, where nothing smaller than a pixel counts.
pub fn scene_hits_at(
    scene: &FlatScene,
    simd: Simd,
    filter: InstanceFilter,
    pixel: PixelSize,
    rays: &[Ray],
    hits: &mut [SceneHit],
) {
    let mut batch = InstanceHits::default();
    if let Some(instance) = sole_identity_instance(scene, filter) {
        batch.trace(&instance, simd, pixel, rays);
        for (i, (hit, ray)) in hits.iter_mut().zip(rays).enumerate() {
            let distance = batch.distance(&instance, i);
            let is_miss = distance == f32::INFINITY;
            *hit = if is_miss { SceneHit::MISS } else { batch.hit(&instance, i, ray, distance) };
        }
        return;
    }
    // The distances are apart from the hits, which are large: most rays touch theirs only once.
    let mut distances = initial_limits(rays);
    let mut scheduler = InstanceScheduler::new(scene, simd, filter, rays);
    let mut local = ObjectRays::default();
    while let Some(batches) = scheduler.next(&distances) {
        for (instance_idx, ranges) in batches.iter().filter(|(_, ranges)| !ranges.is_empty()) {
            let instance = InstanceRef::new(scene, *instance_idx);
            // Discs behind the nearest are blended with it, and what is behind a slit closes it, whatever other instances
            // are between them.
            let blend_distance = match instance.geometry {
                FlatGeometry::Cloud(cloud) => cloud.max_blend_distance,
                FlatGeometry::Mesh(_) => 0.0,
            };
            local.load(instance.instance, ranges, rays, &distances, blend_distance);
            let scaled = pixel.scaled(1.0 / instance.instance.max_scale);
            batch.trace(&instance, simd, scaled, &local.rays);
            for (range, positions) in ranges.with_positions() {
                let (hits, distances) = (&mut hits[range.clone()], &mut distances[range]);
                batch.merge_nearer(&instance, &local, positions, hits, distances);
            }
        }
    }
    for (hit, _) in hits.iter_mut().zip(&distances).filter(|(_, distance)| distance.is_infinite()) {
        *hit = SceneHit::MISS;
    }
}

/// Finds out for each ray whether an accepted instance has a surface in its range.
pub fn scene_occlusions(
    scene: &FlatScene,
    simd: Simd,
    filter: InstanceFilter,
    rays: &[Ray],
    occluded: &mut [bool],
) {
    /// The limit of rays that are occluded.
    const DONE: f32 = f32::NEG_INFINITY;
    if let Some(instance) = sole_identity_instance(scene, filter) {
        return instance_occlusions(&instance, simd, rays, occluded);
    }
    let mut limits = initial_limits(rays);
    let mut local_occluded = Vec::new();
    let mut scheduler = InstanceScheduler::new(scene, simd, filter, rays);
    let mut local = ObjectRays::default();
    while let Some(batches) = scheduler.next(&limits) {
        for (instance_idx, ranges) in batches.iter().filter(|(_, ranges)| !ranges.is_empty()) {
            let instance = InstanceRef::new(scene, *instance_idx);
            local.load(instance.instance, ranges, rays, &limits, 0.0);
            local_occluded.resize(local.rays.len(), false);
            instance_occlusions(&instance, simd, &local.rays, &mut local_occluded);
            for (range, positions) in ranges.with_positions() {
                let found = limits[range].iter_mut().zip(&local_occluded[positions]);
                found.filter(|(_, is_occluded)| **is_occluded).for_each(|(limit, _)| *limit = DONE);
            }
        }
    }
    for (occluded, limit) in occluded.iter_mut().zip(&limits) {
        *occluded = *limit == DONE;
    }
}

/// Returns an infinite limit for each ray, and for each lane of the last row of sixteen.
fn initial_limits(rays: &[Ray]) -> Vec<f32> {
    vec![f32::INFINITY; rays.len().next_multiple_of(PACKET_WIDTH)]
}

/// An instance with its index and its geometry.
struct InstanceRef<'s> {
    instance_idx: u32,
    instance: &'s Instance,
    geometry: &'s FlatGeometry,
}

impl<'s> InstanceRef<'s> {
    fn new(scene: &'s FlatScene, instance_idx: u32) -> Self {
        let instance = &scene.instances[instance_idx as usize];
        Self { instance_idx, instance, geometry: scene.geometry(instance) }
    }
}

/// Returns the accepted instance, if there is just one and its transform is the identity: its object space is
/// the world space.
fn sole_identity_instance(scene: &FlatScene, filter: InstanceFilter) -> Option<InstanceRef<'_>> {
    let instances = scene.instances.iter().enumerate();
    let mut accepted = instances.filter(|(_, instance)| filter.accepts(instance));
    let (first, second) = (accepted.next()?, accepted.next());
    let is_sole = second.is_none() && first.1.is_identity;
    is_sole.then(|| InstanceRef::new(scene, first.0 as u32))
}

/// Rays in the object space of an instance. The memory is reused from one instance to the next.
#[derive(Default)]
struct ObjectRays {
    rays: Vec<Ray>,
    /// Length in object space of a unit length in world space along each ray; empty if the transform is the
    /// identity.
    scales: Vec<f32>,
}

impl ObjectRays {
    /// Replaces the rays by those of `ranges`. They end `blend_distance` behind the nearest known hits, which
    /// are at `distances` in world space.
    fn load(
        &mut self,
        instance: &Instance,
        ranges: &RayRanges,
        rays: &[Ray],
        distances: &[f32],
        blend_distance: f32,
    ) {
        self.rays.clear();
        self.scales.clear();
        for range in ranges.iter() {
            let rays = rays[range.clone()].iter().zip(&distances[range]);
            // Hits as near as the nearest stay, although their distances were rounded in world space and are
            // again.
            let ending = |ray: Ray, scale: f32, nearest: f32| Ray {
                t_max: ray.t_max.min(nearest * scale * (1.0 + 2.0 * f32::EPSILON) + blend_distance),
                ..ray
            };
            if instance.is_identity {
                self.rays.extend(rays.map(|(ray, nearest)| ending(*ray, 1.0, *nearest)));
                continue;
            }
            for (ray, nearest) in rays {
                let (ray, scale) = instance.object_ray(ray);
                self.rays.push(ending(ray, scale, *nearest));
                self.scales.push(scale);
            }
        }
    }

    /// Converts a distance along the ray at `i` from object space to world space.
    #[inline]
    fn world_distance(&self, i: usize, distance: f32) -> f32 {
        self.scales.get(i).map_or(distance, |scale| distance / scale)
    }
}

/// The hits of rays on one instance. The memory is reused from one instance to the next.
#[derive(Default)]
struct InstanceHits {
    of_points: Vec<SurfaceHit>,
    of_triangles: Vec<Hit>,
}

impl InstanceHits {
    fn trace(&mut self, instance: &InstanceRef, simd: Simd, pixel: PixelSize, rays: &[Ray]) {
        match instance.geometry {
            FlatGeometry::Cloud(cloud) => {
                self.of_points.resize(rays.len(), SurfaceHit::MISS);
                surface_hits_at(cloud, simd, pixel, rays, &mut self.of_points);
            }
            FlatGeometry::Mesh(mesh) => {
                self.of_triangles.resize(rays.len(), Hit::MISS);
                closest_triangles(&mesh.triangles, simd, rays, &mut self.of_triangles);
            }
        }
    }

    /// Replaces `hits`, which are at `distances`, by nearer ones of the local rays at `positions`.
    fn merge_nearer(
        &self,
        instance: &InstanceRef,
        local: &ObjectRays,
        positions: Range<usize>,
        hits: &mut [SceneHit],
        distances: &mut [f32],
    ) {
        for (i, (hit, known)) in positions.zip(hits.iter_mut().zip(distances)) {
            let distance = local.world_distance(i, self.distance(instance, i));
            let is_tie = distance == *known && distance < f32::INFINITY;
            if distance < *known || is_tie && instance.instance_idx < hit.instance {
                *hit = self.hit(instance, i, &local.rays[i], distance);
                *known = distance;
            }
        }
    }

    /// Returns the distance of the hit of the ray at `i` in object space, infinite if it misses.
    #[inline]
    fn distance(&self, instance: &InstanceRef, i: usize) -> f32 {
        match instance.geometry {
            FlatGeometry::Cloud(_) => self.of_points[i].distance,
            FlatGeometry::Mesh(_) => self.of_triangles[i].distance,
        }
    }

    /// Returns the hit of the ray at `i`, whose distance in world space is given.
    #[inline]
    fn hit(&self, instance: &InstanceRef, i: usize, ray: &Ray, distance: f32) -> SceneHit {
        let InstanceRef { instance_idx, instance, geometry } = *instance;
        match geometry {
            FlatGeometry::Cloud(cloud) => SceneHit {
                distance,
                instance: instance_idx,
                ..point_hit(cloud, &self.of_points[i], instance)
            },
            FlatGeometry::Mesh(mesh) => SceneHit {
                distance,
                instance: instance_idx,
                ..triangle_hit(mesh, &self.of_triangles[i], ray, instance)
            },
        }
    }
}

/// Finds out for each ray in object space whether an instance occludes it.
fn instance_occlusions(instance: &InstanceRef, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    match instance.geometry {
        FlatGeometry::Cloud(cloud) => occlusions(cloud, simd, rays, occluded),
        FlatGeometry::Mesh(mesh) => any_triangles(&mesh.triangles, simd, rays, occluded),
    }
}
