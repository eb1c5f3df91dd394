//! The closest hits of rays on the cells of an octree: packets of coherent rays, and single ones, which find the same.

use crate::flat::{CellCorners, CellPlane, FlatCloud, Octree};
use crate::image::decode_srgb8;
use crate::math::{
    Floats, LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Ray, SimdTask, Vec3, Vec3Lanes,
    finite_inverse, set_bits,
};
use crate::trace::counts::{Counted, count};
use crate::trace::query::hit::Hit;
use crate::trace::simd::packet_rays::PacketRays;
use crate::trace::traversal::octree_walk::{
    CellInterval, MAX_CELL_MARGIN, OctreeWalk, PixelSize, WalkRays,
};
use std::marker::PhantomData;

/// Widening of a ray's interval in a cell that holds the field at its corners, in sides of the cell. Neighbouring planes do
/// not meet exactly and need `MAX_CELL_MARGIN`.
pub const CORNER_MARGIN: f32 = 0.01;
/// Number of parts of a ray's interval in which the sign of the field is compared.
pub const N_PARTS: usize = 2;
/// Minimum cosine between the directions of a packet's rays.
const MIN_COHERENT_COSINE: f32 = 0.98;
/// Maximum distance between the origins of a packet's rays along any axis, in sides of the octree.
const MAX_ORIGIN_DISTANCE: f32 = 0.02;

/// The hit of a ray on an octree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellHit {
    /// Distance along the ray, and the slot of the point nearest to the middle of the cell.
    pub hit: Hit,
    /// Unit normal, facing the ray's origin.
    pub normal: Vec3,
    /// Length of the cell's sides.
    pub size: f32,
}

impl CellHit {
    /// The result of a ray that hits nothing.
    pub const MISS: Self = Self { hit: Hit::MISS, normal: Vec3::ZERO, size: 0.0 };
}

/// Finds the closest hit of each ray.
#[inline(always)]
pub fn octree_hits<L: Lanes, const HAS_CORNERS: bool>(
    cloud: &FlatCloud,
    pixel: PixelSize,
    rays: &[Ray],
    hits: &mut [CellHit],
) {
    let octree = &*cloud.octree;
    L::dispatch(OctreeHits::<L, HAS_CORNERS> { octree, pixel, rays, hits, lanes: PhantomData });
}

/// Returns the linear colour of the point in a slot.
#[inline(always)]
pub fn cell_color(cloud: &FlatCloud, slot: u32) -> Vec3 {
    let block = &cloud.points.blocks[slot as usize / LANES];
    Vec3::from_array(block.color(slot as usize % LANES).map(decode_srgb8))
}

struct OctreeHits<'a, L, const HAS_CORNERS: bool> {
    octree: &'a Octree,
    pixel: PixelSize,
    rays: &'a [Ray],
    hits: &'a mut [CellHit],
    lanes: PhantomData<L>,
}

/// The nearest cell on a ray so far: of two equally near ones that with the lower index.
#[derive(Clone, Copy)]
struct NearestCell {
    distance: f32,
    cell_idx: u32,
    interval: CellInterval<f32>,
}

impl<L: Lanes, const HAS_CORNERS: bool> SimdTask for OctreeHits<'_, L, HAS_CORNERS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { octree, pixel, rays, hits, .. } = self;
        let side = octree.cube().map_or(0.0, |cube| cube.size().x);
        let mut walk = OctreeWalk::new(octree, pixel);
        for (rays, hits) in rays.chunks(PACKET_WIDTH).zip(hits.chunks_mut(PACKET_WIDTH)) {
            let mut nearest = [None; PACKET_WIDTH];
            if is_coherent(rays, side) {
                trace_packet::<L, HAS_CORNERS>(octree, &mut walk, rays, &mut nearest);
            } else {
                for (ray, nearest) in rays.iter().zip(&mut nearest) {
                    *nearest = trace_ray::<L, HAS_CORNERS>(octree, &mut walk, ray);
                }
            }
            for ((ray, nearest), hit) in rays.iter().zip(&nearest).zip(hits) {
                *hit = nearest.map_or(CellHit::MISS, |nearest: NearestCell| {
                    finish::<HAS_CORNERS>(octree, ray, &nearest)
                });
            }
        }
    }
}

/// True if rays pass about the same nodes.
#[inline(always)]
fn is_coherent(rays: &[Ray], side: f32) -> bool {
    let first = &rays[0];
    let is_near = |ray: &Ray| {
        let offset = (ray.origin - first.origin).abs().max_element();
        offset <= MAX_ORIGIN_DISTANCE * side
            && MIN_COHERENT_COSINE <= ray.direction.dot(first.direction)
    };
    1 < rays.len() && rays.iter().all(is_near)
}

#[inline(always)]
fn walk_rays<F: Floats>(
    origin: Vec3Lanes<F>,
    direction: Vec3Lanes<F>,
    range: (F, F),
) -> WalkRays<F> {
    let Vec3Lanes { x, y, z } = direction;
    let inverse = Vec3Lanes { x: finite_inverse(x), y: finite_inverse(y), z: finite_inverse(z) };
    WalkRays { origin, direction, inverse, t_min: range.0, t_max: range.1 }
}

#[inline(always)]
fn trace_packet<L: Lanes, const HAS_CORNERS: bool>(
    octree: &Octree,
    walk: &mut OctreeWalk,
    rays: &[Ray],
    nearest: &mut [Option<NearestCell>; PACKET_WIDTH],
) {
    let packet = PacketRays::<L::PacketLanes>::new(rays);
    let lanes = walk_rays(packet.origin(), packet.direction(), (packet.t_min, packet.t_max));
    let mut limits = packet.t_max;
    walk.start(((1u64 << rays.len()) - 1) as u32, rays[0].direction);
    while let Some((interval, shown)) = walk.next_cell(&lanes, limits) {
        count(Counted::CellRoots, PACKET_WIDTH);
        let (distances, is_hit) = cell_distances::<_, HAS_CORNERS>(octree, &interval, &lanes);
        let found = shown & is_hit.bits();
        if found == 0 {
            continue;
        }
        let (distances, enter) = (distances.store(), interval.enter.store());
        let (leave, mut stored_limits) = (interval.leave.store(), limits.store());
        for lane in set_bits::<PACKET_WIDTH>(found) {
            let (enter, leave) = (enter[lane], leave[lane]);
            let CellInterval { cell_idx, cube, .. } = interval;
            let cell = CellInterval { cell_idx, enter, leave, cube };
            take_nearer(&mut nearest[lane], &cell, distances[lane]);
            stored_limits[lane] = stored_limits[lane].min(distances[lane]);
        }
        limits = L::PacketLanes::load(&stored_limits);
    }
}

#[inline(always)]
fn trace_ray<L: Lanes, const HAS_CORNERS: bool>(
    octree: &Octree,
    walk: &mut OctreeWalk,
    ray: &Ray,
) -> Option<NearestCell> {
    let Ray { origin, direction, t_min, t_max } = *ray;
    let vectors = (Vec3Lanes::<L>::splat(origin), Vec3Lanes::splat(direction));
    let lanes = walk_rays(vectors.0, vectors.1, (L::splat(t_min), L::splat(t_max)));
    let single = walk_rays(Vec3Lanes::splat(origin), Vec3Lanes::splat(direction), (t_min, t_max));
    let (mut nearest, mut limit) = (None, t_max);
    walk.start(1, direction);
    while let Some(interval) = walk.next_cell_of_ray::<L>(&single, &lanes, limit) {
        count(Counted::CellRoots, 1);
        let (distance, is_hit) = cell_distances::<f32, HAS_CORNERS>(octree, &interval, &single);
        if is_hit {
            take_nearer(&mut nearest, &interval, distance);
            limit = limit.min(distance);
        }
    }
    nearest
}

#[inline(always)]
fn take_nearer(nearest: &mut Option<NearestCell>, interval: &CellInterval<f32>, distance: f32) {
    let cell_idx = interval.cell_idx;
    let is_nearer = nearest.is_none_or(|nearest| {
        distance < nearest.distance || distance == nearest.distance && cell_idx < nearest.cell_idx
    });
    if is_nearer {
        *nearest = Some(NearestCell { distance, cell_idx, interval: *interval });
    }
}

#[inline(always)]
fn finish<const HAS_CORNERS: bool>(octree: &Octree, ray: &Ray, nearest: &NearestCell) -> CellHit {
    let NearestCell { distance, cell_idx, interval } = *nearest;
    let cube = interval.cube;
    let (normal, slot) = if HAS_CORNERS {
        let corners = octree.corners(cell_idx);
        let position = (ray.at(distance) - cube.min) / cube.size;
        let Vec3Lanes { x, y, z } = corner_normal(corners, Vec3Lanes::splat(position));
        (Vec3::new(x, y, z).normalize_or(-ray.direction), corners.slot)
    } else {
        let plane = octree.plane(cell_idx);
        (plane.normal, plane.slot)
    };
    let normal = if 0.0 < normal.dot(ray.direction) { -normal } else { normal };
    CellHit { hit: Hit { distance, slot }, normal, size: cube.size }
}

/// Returns the distances of rays to the surface in a cell, and the lanes in which they hit it.
#[inline(always)]
fn cell_distances<F: Floats, const HAS_CORNERS: bool>(
    octree: &Octree,
    interval: &CellInterval<F>,
    rays: &WalkRays<F>,
) -> (F, F::Mask) {
    if HAS_CORNERS {
        corner_distances(octree.corners(interval.cell_idx), interval, rays)
    } else {
        plane_distances(octree.plane(interval.cell_idx), interval, rays)
    }
}

#[inline(always)]
fn plane_distances<F: Floats>(
    plane: &CellPlane,
    interval: &CellInterval<F>,
    rays: &WalkRays<F>,
) -> (F, F::Mask) {
    let CellInterval { enter, leave, cube, .. } = *interval;
    let normal = Vec3Lanes::splat(plane.normal);
    let middle = Vec3Lanes::splat(cube.min + Vec3::splat(0.5 * cube.size));
    let height = normal.dot(rays.origin.minus(middle)) + F::splat(plane.height);
    let distance = (F::splat(0.0) - height) / normal.dot(rays.direction);
    let margin = F::splat(MAX_CELL_MARGIN * cube.size);
    // A ray along the plane gives NaN or infinity, and fails the tests.
    let is_inside = (enter - margin).le(distance) & distance.le(leave + margin);
    (distance, is_inside & rays.t_min.le(distance) & distance.le(rays.t_max))
}

#[inline(always)]
fn corner_distances<F: Floats>(
    corners: &CellCorners,
    interval: &CellInterval<F>,
    rays: &WalkRays<F>,
) -> (F, F::Mask) {
    let CellInterval { enter, leave, cube, .. } = *interval;
    let margin = F::splat(CORNER_MARGIN * cube.size);
    let start = enter - margin;
    let step = (leave + margin - start) * F::splat(1.0 / N_PARTS as f32);
    let per_size = F::splat(1.0 / cube.size);
    let origin = rays.origin.minus(Vec3Lanes::splat(cube.min));
    let origin = origin.plus(rays.direction.scaled(start)).scaled(per_size);
    let values = corners.values.map(f32::from);
    let cell = CellRays { values: &values, origin, direction: rays.direction.scaled(per_size) };
    let zero = F::splat(0.0);
    let mut is_hit = zero.lt(zero);
    let (mut distance, mut before) = (F::splat(f32::INFINITY), cell.value(zero));
    for part in 0..N_PARTS {
        let low = F::splat(part as f32) * step;
        let high = F::splat((part + 1) as f32) * step;
        let after = cell.value(high);
        let changes = before.le(zero) & zero.lt(after) | zero.lt(before) & after.le(zero);
        if changes.bits() != 0 {
            let root = cell.root((low, before), (high, after));
            let normal = corner_normal(corners, cell.position(root));
            let found = start + root;
            let is_in_range = rays.t_min.le(found) & found.le(rays.t_max);
            let rises = (after - before) * normal.dot(rays.direction);
            let is_new = changes & is_in_range & zero.le(rises) & found.lt(distance);
            distance = F::select(is_new, found, distance);
            is_hit = is_hit | is_new;
        }
        before = after;
    }
    (distance, is_hit)
}

/// Rays in the coordinates of a cell, in which its sides have length 1.
#[derive(Clone, Copy)]
struct CellRays<'c, F> {
    values: &'c [f32; 8],
    origin: Vec3Lanes<F>,
    direction: Vec3Lanes<F>,
}

impl<F: Floats> CellRays<'_, F> {
    #[inline(always)]
    fn position(&self, t: F) -> Vec3Lanes<F> {
        self.origin.plus(self.direction.scaled(t))
    }

    #[inline(always)]
    fn value(&self, t: F) -> F {
        trilinear(self.values, self.position(t))
    }

    /// Returns the zero between two distances with values of different signs, by two steps of regula falsi.
    #[inline(always)]
    fn root(&self, low: (F, F), high: (F, F)) -> F {
        let guess = zero_of_line(low, high);
        let (value, zero) = (self.value(guess), F::splat(0.0));
        let is_like_low = zero.lt(value) & zero.lt(low.1) | value.le(zero) & low.1.le(zero);
        let other = F::select(is_like_low, high.0, low.0);
        let other_value = F::select(is_like_low, high.1, low.1);
        let better = zero_of_line((guess, value), (other, other_value));
        // Where the value is exactly zero, the line may be level.
        F::select(value.le(zero) & zero.le(value), guess, better)
    }
}

/// Returns the distance at which the line through two pairs of distance and value is zero.
#[inline(always)]
fn zero_of_line<F: Floats>(a: (F, F), b: (F, F)) -> F {
    a.0 + (b.0 - a.0) * (a.1 / (a.1 - b.1))
}

/// Returns the value at a position between eight corners of the unit cube.
#[inline(always)]
fn trilinear<F: Floats>(corners: &[f32; 8], position: Vec3Lanes<F>) -> F {
    let [a, b, c, d, e, f, g, h] = *corners;
    let Vec3Lanes { x, y, z } = position;
    let low = between(between_corners(a, b, x), between_corners(c, d, x), y);
    let high = between(between_corners(e, f, x), between_corners(g, h, x), y);
    between(low, high, z)
}

#[inline(always)]
fn between_corners<F: Floats>(low: f32, high: f32, fraction: F) -> F {
    F::splat(low) + fraction * F::splat(high - low)
}

#[inline(always)]
fn between<F: Floats>(low: F, high: F, fraction: F) -> F {
    low + fraction * (high - low)
}

#[inline(always)]
fn corner_normal<F: Floats>(corners: &CellCorners, position: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let mut axes = [[0.0; 8]; 3];
    for (i, normal) in corners.normals.iter().enumerate() {
        [axes[0][i], axes[1][i], axes[2][i]] = normal.map(f32::from);
    }
    Vec3Lanes {
        x: trilinear(&axes[0], position),
        y: trilinear(&axes[1], position),
        z: trilinear(&axes[2], position),
    }
}
