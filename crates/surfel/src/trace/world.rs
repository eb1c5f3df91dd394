//! Rays against whole scenes: each ray goes from instance to instance, nearest box first, and all that are
//! at the same instance are traced there as one batch.

use super::hit::Hit;
use super::rounds::{Rounds, Runs};
use super::surface::SurfaceHit;
use super::{Simd, any_triangles, closest_triangles, occlusions, surface_hits};
use crate::flat::{FlatCloud, FlatGeometry, FlatMesh, FlatScene, Instance, Slot};
use crate::math::{Ray, Vec3, Vec4, WIDE};
use crate::surface::triangle;
use std::ops::Range;

/// Where a ray meets a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneHit {
    /// Infinite if nothing was hit.
    pub distance: f32,
    /// Index in the scene's instances.
    pub instance: u32,
    /// Of the nearest point hit in its cloud, or of the triangle in its mesh.
    pub id: u32,
    /// Of that triangle; 0 for points.
    pub slot: Slot,
    /// Shares of a triangle's second and third corners.
    pub shares: (f32, f32),
    /// Of the nearest point hit, in world units; 0 for triangles.
    pub radius: f32,
    /// Unit, facing the ray's origin; between the corners' normals where a triangle has them.
    pub normal: Vec3,
    /// Unit, facing the ray's origin: that of the triangle's plane, or `normal` again.
    pub facet: Vec3,
    /// The geometry's own colour, linear.
    pub color: Vec3,
    /// The geometry's own alpha.
    pub alpha: f32,
    /// Whether the surface is hit from within, as far as its orientation tells.
    pub is_inner: bool,
}

impl SceneHit {
    pub const MISS: Self = Self {
        distance: f32::INFINITY,
        instance: u32::MAX,
        id: u32::MAX,
        slot: 0,
        shares: (0.0, 0.0),
        radius: 0.0,
        normal: Vec3::ZERO,
        facet: Vec3::ZERO,
        color: Vec3::ZERO,
        alpha: 0.0,
        is_inner: false,
    };

    pub fn is_miss(&self) -> bool {
        self.instance == u32::MAX
    }
}

/// Which instances count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    All,
    /// Those that no light goes through.
    Opaque,
    SeeThrough,
}

impl Which {
    pub(super) fn counts(self, instance: &Instance) -> bool {
        match self {
            Self::All => true,
            Self::Opaque => !instance.is_see_through,
            Self::SeeThrough => instance.is_see_through,
        }
    }
}

/// The nearest surface on each ray.
pub fn scene_hits(
    scene: &FlatScene,
    simd: Simd,
    which: Which,
    rays: &[Ray],
    hits: &mut [SceneHit],
) {
    let mut batch = Batch::default();
    if let Some(place) = only(scene, which) {
        batch.trace(&place, simd, rays);
        for (i, (hit, ray)) in hits.iter_mut().zip(rays).enumerate() {
            let distance = batch.distance(&place, i);
            let is_miss = distance == f32::INFINITY;
            *hit = if is_miss { SceneHit::MISS } else { batch.hit(&place, i, ray, distance) };
        }
        return;
    }
    // Beside the hits, which are large: most rays look at theirs only once.
    let mut distances = unlimited(rays);
    let mut rounds = Rounds::new(scene, simd, which, rays);
    let mut there = RaysThere::default();
    while let Some(batches) = rounds.next(&distances) {
        for (instance_idx, runs) in batches.iter().filter(|(_, runs)| !runs.is_empty()) {
            let place = Place::new(scene, *instance_idx);
            // Discs behind the nearest are blended with it, whatever other instances are among them.
            let reach = match place.geometry {
                FlatGeometry::Cloud(cloud) => cloud.reach,
                FlatGeometry::Mesh(_) => 0.0,
            };
            there.enter(place.instance, runs, rays, &distances, reach);
            batch.trace(&place, simd, &there.rays);
            for (run, there_idx) in runs.placed() {
                let (hits, distances) = (&mut hits[run.clone()], &mut distances[run]);
                batch.keep_nearer(&place, &there, there_idx, hits, distances);
            }
        }
    }
    for (hit, _) in hits.iter_mut().zip(&distances).filter(|(_, distance)| distance.is_infinite()) {
        *hit = SceneHit::MISS;
    }
}

/// Whether any surface lies in each ray's range.
pub fn scene_occlusions(
    scene: &FlatScene,
    simd: Simd,
    which: Which,
    rays: &[Ray],
    occluded: &mut [bool],
) {
    /// Of rays that look for nothing more.
    const BLOCKED: f32 = f32::NEG_INFINITY;
    if let Some(place) = only(scene, which) {
        return occlude(&place, simd, rays, occluded);
    }
    let mut limits = unlimited(rays);
    let mut blocked = Vec::new();
    let mut rounds = Rounds::new(scene, simd, which, rays);
    let mut there = RaysThere::default();
    while let Some(batches) = rounds.next(&limits) {
        for (instance_idx, runs) in batches.iter().filter(|(_, runs)| !runs.is_empty()) {
            let place = Place::new(scene, *instance_idx);
            there.enter(place.instance, runs, rays, &limits, 0.0);
            blocked.resize(there.rays.len(), false);
            occlude(&place, simd, &there.rays, &mut blocked);
            for (run, there_idx) in runs.placed() {
                let found = limits[run].iter_mut().zip(&blocked[there_idx]);
                found
                    .filter(|(_, is_blocked)| **is_blocked)
                    .for_each(|(limit, _)| *limit = BLOCKED);
            }
        }
    }
    for (occluded, limit) in occluded.iter_mut().zip(&limits) {
        *occluded = *limit == BLOCKED;
    }
}

/// How far each ray still looks within its range; there is one for each of sixteen rays in the last row too.
fn unlimited(rays: &[Ray]) -> Vec<f32> {
    vec![f32::INFINITY; rays.len().next_multiple_of(WIDE)]
}

/// An instance with what stands there.
struct Place<'s> {
    instance_idx: u32,
    instance: &'s Instance,
    geometry: &'s FlatGeometry,
}

impl<'s> Place<'s> {
    fn new(scene: &'s FlatScene, instance_idx: u32) -> Self {
        let instance = &scene.instances[instance_idx as usize];
        Self { instance_idx, instance, geometry: scene.geometry(instance) }
    }
}

/// The instance that counts, if there is just one and it is in place: its rays are those of the world.
fn only(scene: &FlatScene, which: Which) -> Option<Place<'_>> {
    let instances = scene.instances.iter().enumerate();
    let mut counting = instances.filter(|(_, instance)| which.counts(instance));
    let (first, second) = (counting.next()?, counting.next());
    let is_only = second.is_none() && first.1.is_in_place;
    is_only.then(|| Place::new(scene, first.0 as u32))
}

/// Rays at one instance, in its coordinates; the room is kept from one to the next.
#[derive(Default)]
struct RaysThere {
    rays: Vec<Ray>,
    /// Object lengths that make one of the world along each ray; none where the instance is in place.
    scales: Vec<f32>,
}

impl RaysThere {
    /// Takes the rays of `runs`; nothing is looked for beyond `reach` behind what is known already, at the
    /// world's `distances`.
    fn enter(
        &mut self,
        instance: &Instance,
        runs: &Runs,
        rays: &[Ray],
        distances: &[f32],
        reach: f32,
    ) {
        self.rays.clear();
        self.scales.clear();
        for run in runs.iter() {
            let rays = rays[run.clone()].iter().zip(&distances[run]);
            // Hits as near as the nearest stay, though it was rounded in the world's lengths and is so again.
            let ending = |ray: Ray, scale: f32, nearest: f32| Ray {
                t_max: ray.t_max.min(nearest * scale * (1.0 + 2.0 * f32::EPSILON) + reach),
                ..ray
            };
            if instance.is_in_place {
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

    /// In the world, a distance that the ray at `i` has here.
    #[inline]
    fn in_world(&self, i: usize, distance: f32) -> f32 {
        self.scales.get(i).map_or(distance, |scale| distance / scale)
    }
}

/// What rays find at one instance; its room is kept from one to the next.
#[derive(Default)]
struct Batch {
    on_points: Vec<SurfaceHit>,
    on_triangles: Vec<Hit>,
}

impl Batch {
    fn trace(&mut self, place: &Place, simd: Simd, rays: &[Ray]) {
        match place.geometry {
            FlatGeometry::Cloud(cloud) => {
                self.on_points.resize(rays.len(), SurfaceHit::MISS);
                surface_hits(cloud, simd, rays, &mut self.on_points);
            }
            FlatGeometry::Mesh(mesh) => {
                self.on_triangles.resize(rays.len(), Hit::MISS);
                closest_triangles(&mesh.triangles, simd, rays, &mut self.on_triangles);
            }
        }
    }

    /// Takes over what was found nearer than the `hits` known at these distances; `there_idx` says by
    /// which rays there.
    fn keep_nearer(
        &self,
        place: &Place,
        there: &RaysThere,
        there_idx: Range<usize>,
        hits: &mut [SceneHit],
        distances: &mut [f32],
    ) {
        for (i, (hit, known)) in there_idx.zip(hits.iter_mut().zip(distances)) {
            let distance = there.in_world(i, self.distance(place, i));
            let is_tie = distance == *known && distance < f32::INFINITY;
            if distance < *known || is_tie && place.instance_idx < hit.instance {
                *hit = self.hit(place, i, &there.rays[i], distance);
                *known = distance;
            }
        }
    }

    /// At which the ray at `i` found something, in the object's coordinates; infinite where it did not.
    #[inline]
    fn distance(&self, place: &Place, i: usize) -> f32 {
        match place.geometry {
            FlatGeometry::Cloud(_) => self.on_points[i].distance,
            FlatGeometry::Mesh(_) => self.on_triangles[i].distance,
        }
    }

    /// What the ray at `i` found, at this distance in the world.
    #[inline]
    fn hit(&self, place: &Place, i: usize, ray: &Ray, distance: f32) -> SceneHit {
        let Place { instance_idx, instance, geometry } = *place;
        match geometry {
            FlatGeometry::Cloud(cloud) => SceneHit {
                distance,
                instance: instance_idx,
                ..point_hit(cloud, &self.on_points[i], instance)
            },
            FlatGeometry::Mesh(mesh) => SceneHit {
                distance,
                instance: instance_idx,
                ..triangle_hit(mesh, &self.on_triangles[i], ray, instance)
            },
        }
    }
}

/// Whether an instance occludes rays in its coordinates.
fn occlude(place: &Place, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
    match place.geometry {
        FlatGeometry::Cloud(cloud) => occlusions(cloud, simd, rays, occluded),
        FlatGeometry::Mesh(mesh) => any_triangles(&mesh.triangles, simd, rays, occluded),
    }
}

/// All that the cloud knows of a hit.
#[inline]
fn point_hit(cloud: &FlatCloud, hit: &SurfaceHit, instance: &Instance) -> SceneHit {
    let normal = instance.world_normal(hit.normal);
    SceneHit {
        id: hit.id,
        radius: hit.radius * instance.scale,
        normal,
        facet: normal,
        color: hit.color,
        alpha: 1.0,
        is_inner: cloud.has_outward_normals && hit.is_inner,
        ..SceneHit::MISS
    }
}

/// All that the mesh knows of a hit.
fn triangle_hit(mesh: &FlatMesh, hit: &Hit, ray: &Ray, instance: &Instance) -> SceneHit {
    let corners = mesh.triangles.triangle(hit.slot);
    let shares = triangle::barycentric(corners.map(|corner| corner - ray.origin), ray.direction);
    let [a, b, c] = corners;
    let outward = unit((b - a).cross(c - a));
    let is_inner = 0.0 < outward.dot(ray.direction);
    let side = if is_inner { -1.0 } else { 1.0 };
    let facet = instance.world_normal(side * outward);
    let normal = match mesh.at(&mesh.normals, hit.slot, shares).and_then(Vec3::try_normalize) {
        Some(between) => {
            let normal = instance.world_normal(between);
            // Not by `is_inner`: some programs write normals against the way that corners go round.
            if normal.dot(facet) < 0.0 { -normal } else { normal }
        }
        None => facet,
    };
    let color = mesh.at(&mesh.colors, hit.slot, shares).unwrap_or(Vec4::ONE);
    SceneHit {
        id: mesh.triangles.id(hit.slot),
        slot: hit.slot,
        shares: (shares[1], shares[2]),
        normal,
        facet,
        color: color.truncate(),
        alpha: color.w,
        is_inner,
        ..SceneHit::MISS
    }
}

/// Unit, even where squares are beyond the range of f32.
fn unit(vector: Vec3) -> Vec3 {
    (vector / vector.abs().max_element()).normalize()
}
