//! Rays against whole scenes: each ray goes from instance to instance, nearest box first, and all that are
//! at the same instance are traced there as one batch.

use super::hit::Hit;
use super::node::{BoxRay, ray_entries};
use super::surface::SurfaceHit;
use super::{Simd, any_triangles, box_entries, closest_triangles, occlusions, surface_hits};
use crate::bvh::{Child, NO_PRIMITIVE, STACK_SIZE};
use crate::flat::{FlatCloud, FlatGeometry, FlatMesh, FlatScene, Instance, Slot};
use crate::math::{Aabb, LaneMask, PortableLanes, Ray, Vec3, Vec4};
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
    fn counts(self, instance: &Instance) -> bool {
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
    if let Some((instance_idx, instance)) = only(scene, which) {
        batch.trace(scene, simd, instance, rays);
        for (i, (hit, ray)) in hits.iter_mut().zip(rays).enumerate() {
            let found = batch.hit(scene, i, ray, instance);
            *hit = found.map_or(SceneHit::MISS, |hit| SceneHit { instance: instance_idx, ..hit });
        }
        return;
    }
    // Beside the hits, which are large: most rays look at theirs only once.
    let mut distances = vec![f32::INFINITY; rays.len()];
    let mut rounds = Rounds::new(scene, simd, which, rays);
    let mut there = RaysThere::default();
    loop {
        let limit = |ray_idx: u32| distances[ray_idx as usize].min(rays[ray_idx as usize].t_max);
        let Some(batches) = rounds.next(limit) else { break };
        for (instance_idx, ray_indices) in batches.iter().filter(|(_, rays)| !rays.is_empty()) {
            let instance = &scene.instances[*instance_idx as usize];
            there.enter(instance, ray_indices, rays);
            // Discs behind the nearest are blended with it, whatever other instances are among them.
            let reach = match scene.geometry(instance) {
                FlatGeometry::Cloud(cloud) => cloud.reach,
                FlatGeometry::Mesh(_) => 0.0,
            };
            there.end_at(ray_indices, &distances, reach);
            batch.trace(scene, simd, instance, &there.rays);
            batch.measure(scene, instance, &there.scales);
            for (i, (&ray_idx, &distance)) in ray_indices.iter().zip(&batch.distances).enumerate() {
                let place = ray_idx as usize;
                let is_first = || {
                    let is_tie = distance == distances[place] && distance < f32::INFINITY;
                    is_tie && *instance_idx < hits[place].instance
                };
                if !(distance < distances[place] || is_first()) {
                    continue;
                }
                if let Some(hit) = batch.hit(scene, i, &there.rays[i], instance) {
                    hits[place] = SceneHit { distance, instance: *instance_idx, ..hit };
                    distances[place] = distance;
                }
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
    if let Some((_, instance)) = only(scene, which) {
        return block(scene, simd, instance, rays, occluded);
    }
    occluded.fill(false);
    let mut blocked = Vec::new();
    let mut rounds = Rounds::new(scene, simd, which, rays);
    let mut there = RaysThere::default();
    loop {
        let limit = |ray_idx: u32| match occluded[ray_idx as usize] {
            true => f32::NEG_INFINITY,
            false => rays[ray_idx as usize].t_max,
        };
        let Some(batches) = rounds.next(limit) else { return };
        for (instance_idx, ray_indices) in batches.iter().filter(|(_, rays)| !rays.is_empty()) {
            let instance = &scene.instances[*instance_idx as usize];
            there.enter(instance, ray_indices, rays);
            blocked.resize(ray_indices.len(), false);
            block(scene, simd, instance, &there.rays, &mut blocked);
            for (&ray_idx, is_blocked) in ray_indices.iter().zip(&blocked) {
                occluded[ray_idx as usize] |= is_blocked;
            }
        }
    }
}

/// The instance that counts, if there is just one and it is in place: its rays are those of the world.
fn only(scene: &FlatScene, which: Which) -> Option<(u32, &Instance)> {
    let instances = scene.instances.iter().enumerate();
    let mut counting = instances.filter(|(_, instance)| which.counts(instance));
    let (first, second) = (counting.next()?, counting.next());
    (second.is_none() && first.1.is_in_place).then_some((first.0 as u32, first.1))
}

/// Where the rays still have to go.
struct Rounds {
    visits: Visits,
    /// Instances, each with the rays that visit it next, in their order: that is what makes packets.
    batches: Vec<(u32, Vec<u32>)>,
}

enum Visits {
    /// Of few instances: where each ray enters the box of each, instance after instance, at infinity once it
    /// was there; and the rays still on their way.
    Few { entries: Vec<f32>, open: Vec<u32> },
    /// Of many: all that each ray comes by, sorted by where it enters, one ray's after another's; and what
    /// is left of that of each ray still on its way. `jobs` is room for the next round.
    Many { entries: Vec<(f32, u32)>, left: Vec<(u32, Range<u32>)>, jobs: Vec<(u32, u32)> },
}

/// With more instances, the tree over them is asked: their boxes one by one would cost more.
const FEW: usize = 16;

impl Rounds {
    fn new(scene: &FlatScene, simd: Simd, which: Which, rays: &[Ray]) -> Self {
        let counting = scene.instances.iter().enumerate();
        let counting = counting.filter(|(_, instance)| which.counts(instance));
        let instances: Vec<u32> = counting.take(FEW + 1).map(|(i, _)| i as u32).collect();
        if FEW < instances.len() {
            return Self { visits: visits_of_many(scene, which, rays), batches: Vec::new() };
        }
        let boxes: Vec<Aabb> =
            instances.iter().map(|&i| scene.instances[i as usize].bounds).collect();
        let mut entries = vec![0.0; boxes.len() * rays.len()];
        box_entries(&boxes, simd, rays, &mut entries);
        Self {
            visits: Visits::Few { entries, open: (0..rays.len() as u32).collect() },
            batches: instances.into_iter().map(|instance| (instance, Vec::new())).collect(),
        }
    }

    /// The next visit of each ray that has one within its limit; none if no ray has.
    fn next(&mut self, limit: impl Fn(u32) -> f32) -> Option<&[(u32, Vec<u32>)]> {
        let Self { visits, batches } = self;
        let n_batches = match visits {
            Visits::Few { entries, open } => next_of_few(entries, open, batches, limit),
            Visits::Many { entries, left, jobs } => {
                next_of_many(entries, left, jobs, limit);
                group(jobs, batches)
            }
        };
        (0 < n_batches).then_some(&batches[..n_batches])
    }
}

/// Puts each ray into the batch of the instance that it visits next; how many batches there are then.
fn next_of_few(
    entries: &mut [f32],
    open: &mut Vec<u32>,
    batches: &mut [(u32, Vec<u32>)],
    limit: impl Fn(u32) -> f32,
) -> usize {
    batches.iter_mut().for_each(|(_, rays)| rays.clear());
    let n_rays = entries.len() / batches.len().max(1);
    open.retain(|&ray| {
        let (mut nearest, mut entry) = (0, f32::INFINITY);
        for i in 0..batches.len() {
            let other = entries[i * n_rays + ray as usize];
            // Two choices instead of one branch, which could not be foretold.
            nearest = if other < entry { i } else { nearest };
            entry = entry.min(other);
        }
        let goes = entry < f32::INFINITY && entry <= limit(ray);
        if goes {
            entries[nearest * n_rays + ray as usize] = f32::INFINITY;
            batches[nearest].1.push(ray);
        }
        goes
    });
    if open.is_empty() { 0 } else { batches.len() }
}

/// Lists the instances that rays visit next, each with the ray.
fn next_of_many(
    entries: &[(f32, u32)],
    left: &mut Vec<(u32, Range<u32>)>,
    jobs: &mut Vec<(u32, u32)>,
    limit: impl Fn(u32) -> f32,
) {
    jobs.clear();
    left.retain_mut(|(ray, left)| {
        let Some(next) = left.next() else { return false };
        let (entry, instance) = entries[next as usize];
        let goes = entry <= limit(*ray);
        if goes {
            jobs.push((instance, *ray));
        }
        goes
    });
}

/// Makes a batch of all jobs at the same instance, in room that is kept; how many batches there are then.
fn group(jobs: &mut [(u32, u32)], batches: &mut Vec<(u32, Vec<u32>)>) -> usize {
    jobs.sort_by_key(|(instance, _)| *instance);
    let mut n_batches = 0;
    for group in jobs.chunk_by(|a, b| a.0 == b.0) {
        if n_batches == batches.len() {
            batches.push((0, Vec::new()));
        }
        let (instance, rays) = &mut batches[n_batches];
        *instance = group[0].0;
        rays.clear();
        rays.extend(group.iter().map(|(_, ray)| *ray));
        n_batches += 1;
    }
    n_batches
}

fn visits_of_many(scene: &FlatScene, which: Which, rays: &[Ray]) -> Visits {
    let (mut entries, mut left) = (Vec::new(), Vec::with_capacity(rays.len()));
    for (ray_idx, ray) in rays.iter().enumerate() {
        let first = entries.len();
        visit_boxes(scene, which, ray, &mut entries);
        if first < entries.len() {
            entries[first..].sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            left.push((ray_idx as u32, first as u32..entries.len() as u32));
        }
    }
    Visits::Many { entries, left, jobs: Vec::new() }
}

/// Adds the instances whose boxes the ray meets, and where it enters them.
fn visit_boxes(scene: &FlatScene, which: Which, ray: &Ray, visits: &mut Vec<(f32, u32)>) {
    let top = &scene.top;
    let Some(root) = top.nodes.first() else { return };
    let prepared = BoxRay::new(root, ray);
    let mut stack = [0; STACK_SIZE];
    let mut size = 1;
    while 0 < size {
        size -= 1;
        let node = &top.nodes[stack[size] as usize];
        let (lanes, _) = ray_entries::<PortableLanes>(node, &prepared, ray.t_max);
        let mut lanes = lanes.bits();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            match node.child(lane) {
                Some(Child::Node(child)) => {
                    stack[size] = child;
                    size += 1;
                }
                Some(Child::Block(block)) => {
                    for &i in top.blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE) {
                        let instance = &scene.instances[i as usize];
                        if which.counts(instance) {
                            visits.extend(box_entry(instance, ray).map(|entry| (entry, i)));
                        }
                    }
                }
                None => {}
            }
        }
    }
}

/// Where the ray enters an instance's box, if it does within its range.
fn box_entry(instance: &Instance, ray: &Ray) -> Option<f32> {
    const LEAST: Vec3 = Vec3::splat(1e-18);
    // Kept finite, so that no product of an infinity and a zero, and no difference of infinities, gives NaN.
    let is_small = ray.direction.abs().cmplt(LEAST);
    let inverse = 1.0 / Vec3::select(is_small, LEAST, ray.direction);
    let low = (instance.bounds.min - ray.origin) * inverse;
    let high = (instance.bounds.max - ray.origin) * inverse;
    let near = low.min(high).max_element().max(ray.t_min);
    let far = low.max(high).min_element().min(ray.t_max);
    // More than the rounding above.
    let slack = 8.0 * f32::EPSILON * near.abs().max(far.abs());
    (near <= far + slack && near < f32::INFINITY).then_some(near - slack)
}

/// Rays at one instance, in its coordinates; the room is kept from one to the next.
#[derive(Default)]
struct RaysThere {
    rays: Vec<Ray>,
    /// Object lengths that make one of the world along each ray.
    scales: Vec<f32>,
}

impl RaysThere {
    fn enter(&mut self, instance: &Instance, indices: &[u32], rays: &[Ray]) {
        self.rays.clear();
        self.scales.clear();
        if instance.is_in_place {
            self.rays.extend(indices.iter().map(|&ray_idx| rays[ray_idx as usize]));
            self.scales.resize(indices.len(), 1.0);
            return;
        }
        for &ray_idx in indices {
            let (ray, scale) = instance.object_ray(&rays[ray_idx as usize]);
            self.rays.push(ray);
            self.scales.push(scale);
        }
    }

    /// Nothing is looked for beyond `reach` behind what is known already, at the world's `distances`.
    fn end_at(&mut self, indices: &[u32], distances: &[f32], reach: f32) {
        let nearest = indices.iter().map(|&ray_idx| distances[ray_idx as usize]);
        for ((ray, scale), nearest) in self.rays.iter_mut().zip(&self.scales).zip(nearest) {
            ray.t_max = ray.t_max.min(nearest * scale + reach);
        }
    }
}

/// What rays find at one instance; its room is kept from one to the next.
#[derive(Default)]
struct Batch {
    on_points: Vec<SurfaceHit>,
    on_triangles: Vec<Hit>,
    /// In the world, infinite where nothing was found.
    distances: Vec<f32>,
}

impl Batch {
    fn trace(&mut self, scene: &FlatScene, simd: Simd, instance: &Instance, rays: &[Ray]) {
        match scene.geometry(instance) {
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

    /// Sets the distances of what was found, from rays with these scales.
    fn measure(&mut self, scene: &FlatScene, instance: &Instance, scales: &[f32]) {
        let Self { on_points, on_triangles, distances } = self;
        distances.clear();
        match scene.geometry(instance) {
            FlatGeometry::Cloud(_) => {
                distances
                    .extend(on_points.iter().zip(scales).map(|(hit, scale)| hit.distance / scale));
            }
            FlatGeometry::Mesh(_) => {
                let found = on_triangles.iter().zip(scales);
                distances.extend(found.map(|(hit, scale)| hit.distance / scale));
            }
        }
    }

    /// What the ray at `i` found, at its distance in the object's coordinates.
    #[inline]
    fn hit(&self, scene: &FlatScene, i: usize, ray: &Ray, instance: &Instance) -> Option<SceneHit> {
        match scene.geometry(instance) {
            FlatGeometry::Cloud(cloud) => point_hit(cloud, &self.on_points[i], instance),
            FlatGeometry::Mesh(mesh) => triangle_hit(mesh, &self.on_triangles[i], ray, instance),
        }
    }
}

/// Whether an instance blocks rays in its coordinates.
fn block(scene: &FlatScene, simd: Simd, instance: &Instance, rays: &[Ray], occluded: &mut [bool]) {
    match scene.geometry(instance) {
        FlatGeometry::Cloud(cloud) => occlusions(cloud, simd, rays, occluded),
        FlatGeometry::Mesh(mesh) => any_triangles(&mesh.triangles, simd, rays, occluded),
    }
}

#[inline]
fn point_hit(cloud: &FlatCloud, hit: &SurfaceHit, instance: &Instance) -> Option<SceneHit> {
    if hit.is_miss() {
        return None;
    }
    let normal = instance.world_normal(hit.normal);
    Some(SceneHit {
        distance: hit.distance,
        id: hit.id,
        radius: hit.radius * instance.scale,
        normal,
        facet: normal,
        color: hit.color,
        alpha: 1.0,
        is_inner: cloud.has_outward_normals && hit.is_inner,
        ..SceneHit::MISS
    })
}

fn triangle_hit(mesh: &FlatMesh, hit: &Hit, ray: &Ray, instance: &Instance) -> Option<SceneHit> {
    if hit.is_miss() {
        return None;
    }
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
    Some(SceneHit {
        distance: hit.distance,
        id: mesh.triangles.id(hit.slot),
        slot: hit.slot,
        shares: (shares[1], shares[2]),
        normal,
        facet,
        color: color.truncate(),
        alpha: color.w,
        is_inner,
        ..SceneHit::MISS
    })
}

/// Unit, even where squares are beyond the range of f32.
fn unit(vector: Vec3) -> Vec3 {
    (vector / vector.abs().max_element()).normalize()
}
