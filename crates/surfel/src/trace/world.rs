//! Rays against whole scenes: each ray goes from instance to instance, nearest box first, and all that are
//! at the same instance are traced there as one batch.

use super::boxes::Entries;
use super::hit::Hit;
use super::node::{BoxRay, ray_entries};
use super::surface::SurfaceHit;
use super::{Simd, any_triangles, box_entries, closest_triangles, occlusions, surface_hits};
use crate::bvh::{Child, NO_PRIMITIVE, STACK_SIZE};
use crate::flat::{FlatCloud, FlatGeometry, FlatMesh, FlatScene, Instance, Slot};
use crate::math::{Aabb, LaneMask, PortableLanes, Ray, Vec3, Vec4, WIDE};
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
            there.enter(place.instance, runs, rays);
            // Discs behind the nearest are blended with it, whatever other instances are among them.
            let reach = match place.geometry {
                FlatGeometry::Cloud(cloud) => cloud.reach,
                FlatGeometry::Mesh(_) => 0.0,
            };
            there.end_at(runs, &distances, reach);
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
        return block(&place, simd, rays, occluded);
    }
    let mut limits = unlimited(rays);
    let mut blocked = Vec::new();
    let mut rounds = Rounds::new(scene, simd, which, rays);
    let mut there = RaysThere::default();
    while let Some(batches) = rounds.next(&limits) {
        for (instance_idx, runs) in batches.iter().filter(|(_, runs)| !runs.is_empty()) {
            let place = Place::new(scene, *instance_idx);
            there.enter(place.instance, runs, rays);
            blocked.resize(there.rays.len(), false);
            block(&place, simd, &there.rays, &mut blocked);
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

/// How far each ray still looks within its range; there is one for each of sixteen rays in the last group too.
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

/// Where the rays still have to go.
struct Rounds {
    visits: Visits,
    /// Instances, each with the rays that visit it next, in their order: that is what makes packets.
    batches: Vec<(u32, Runs)>,
}

/// Indices of rays, rising, as ranges of neighbours: most rays go where those beside them go, and what
/// stands together is copied as a whole.
#[derive(Default)]
struct Runs(Vec<Range<usize>>);

impl Runs {
    fn push(&mut self, run: Range<usize>) {
        match self.0.last_mut() {
            Some(last) if last.end == run.start => last.end = run.end,
            _ => self.0.push(run),
        }
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Each run, and where its rays are when all runs are put one after another.
    fn placed(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        let mut end = 0;
        self.0.iter().map(move |run| {
            let first = end;
            end += run.len();
            (run.clone(), first..end)
        })
    }
}

enum Visits {
    /// Of few instances: where the sixteen rays of each group enter the box of each, group after group; and
    /// the groups still on their way.
    Few { entries: Vec<Entries>, open: Vec<u32> },
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
        let n_groups = rays.len().div_ceil(WIDE);
        let mut entries = vec![Entries::NONE; n_groups * boxes.len()];
        box_entries(&boxes, simd, rays, &mut entries);
        Self {
            visits: Visits::Few { entries, open: (0..n_groups as u32).collect() },
            batches: instances.into_iter().map(|instance| (instance, Runs::default())).collect(),
        }
    }

    /// The next visit of each ray that has one within its limit; none if no ray has.
    fn next(&mut self, limits: &[f32]) -> Option<&[(u32, Runs)]> {
        let Self { visits, batches } = self;
        let n_batches = match visits {
            Visits::Few { entries, open } => next_of_few(entries, open, batches, limits),
            Visits::Many { entries, left, jobs } => {
                next_of_many(entries, left, jobs, limits);
                group(jobs, batches)
            }
        };
        (0 < n_batches).then_some(&batches[..n_batches])
    }
}

/// Puts the rays of each group into the batch of the instance that the group visits next, all of them that
/// meet its box within their limits; how many batches there are then.
///
/// Sixteen rays choose at a time: one by one that cost a twentieth of the search among points.
fn next_of_few(
    entries: &mut [Entries],
    open: &mut Vec<u32>,
    batches: &mut [(u32, Runs)],
    limits: &[f32],
) -> usize {
    batches.iter_mut().for_each(|(_, runs)| runs.0.clear());
    let mut goes_any = false;
    open.retain(|&group| {
        let entries = &mut entries[group as usize * batches.len()..][..batches.len()];
        let first = group as usize * WIDE;
        let limits = &limits[first..first + WIDE];
        while let Some(nearest) = nearest(entries) {
            entries[nearest].nearest = f32::INFINITY;
            if send(&mut batches[nearest].1, first, &entries[nearest].of_rays, limits) {
                goes_any = true;
                return true;
            }
        }
        false
    });
    if goes_any { batches.len() } else { 0 }
}

/// The box that any ray of the group enters first.
fn nearest(entries: &[Entries]) -> Option<usize> {
    let (mut nearest, mut entry) = (0, f32::INFINITY);
    for (i, other) in entries.iter().enumerate() {
        // Two choices instead of one branch, which could not be foretold.
        nearest = if other.nearest < entry { i } else { nearest };
        entry = entry.min(other.nearest);
    }
    (entry < f32::INFINITY).then_some(nearest)
}

/// Adds the rays of the group that begins with `first` which enter a box within their limits, if any does.
fn send(runs: &mut Runs, first: usize, entries: &[f32; WIDE], limits: &[f32]) -> bool {
    let goes = |(entry, limit): (&f32, &f32)| (*entry < f32::INFINITY) & (entry <= limit);
    let n_going: u32 = entries.iter().zip(limits).map(|pair| u32::from(goes(pair))).sum();
    if n_going as usize == WIDE {
        runs.push(first..first + WIDE);
    } else if 0 < n_going {
        let going = entries.iter().zip(limits).enumerate().filter(|(_, pair)| goes(*pair));
        going.for_each(|(lane, _)| runs.push(first + lane..first + lane + 1));
    }
    0 < n_going
}

/// Lists the instances that rays visit next, each with the ray.
fn next_of_many(
    entries: &[(f32, u32)],
    left: &mut Vec<(u32, Range<u32>)>,
    jobs: &mut Vec<(u32, u32)>,
    limits: &[f32],
) {
    jobs.clear();
    left.retain_mut(|(ray, left)| {
        let Some(next) = left.next() else { return false };
        let (entry, instance) = entries[next as usize];
        let goes = entry <= limits[*ray as usize];
        if goes {
            jobs.push((instance, *ray));
        }
        goes
    });
}

/// Makes a batch of all jobs at the same instance, in room that is kept; how many batches there are then.
fn group(jobs: &mut [(u32, u32)], batches: &mut Vec<(u32, Runs)>) -> usize {
    jobs.sort_by_key(|(instance, _)| *instance);
    let mut n_batches = 0;
    for group in jobs.chunk_by(|a, b| a.0 == b.0) {
        if n_batches == batches.len() {
            batches.push((0, Runs::default()));
        }
        let (instance, runs) = &mut batches[n_batches];
        *instance = group[0].0;
        runs.0.clear();
        group.iter().for_each(|(_, ray)| runs.push(*ray as usize..*ray as usize + 1));
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
    fn enter(&mut self, instance: &Instance, runs: &Runs, rays: &[Ray]) {
        self.rays.clear();
        self.scales.clear();
        for run in &runs.0 {
            let rays = &rays[run.clone()];
            if instance.is_in_place {
                self.rays.extend_from_slice(rays);
                continue;
            }
            for (ray, scale) in rays.iter().map(|ray| instance.object_ray(ray)) {
                self.rays.push(ray);
                self.scales.push(scale);
            }
        }
        if instance.is_in_place {
            self.scales.resize(self.rays.len(), 1.0);
        }
    }

    /// Nothing is looked for beyond `reach` behind what is known already, at the world's `distances`.
    fn end_at(&mut self, runs: &Runs, distances: &[f32], reach: f32) {
        for (run, there_idx) in runs.placed() {
            let rays = self.rays[there_idx.clone()].iter_mut().zip(&self.scales[there_idx]);
            for ((ray, scale), nearest) in rays.zip(&distances[run]) {
                ray.t_max = ray.t_max.min(nearest * scale + reach);
            }
        }
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
            let distance = self.distance(place, i) / there.scales[i];
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

/// Whether an instance blocks rays in its coordinates.
fn block(place: &Place, simd: Simd, rays: &[Ray], occluded: &mut [bool]) {
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
