//! Rays for the tests of traversal: coherent, incoherent, degenerate and invalid ones.

use crate::brute_force::BruteForce;
use surfel_core::bvh::BvhNode;
use surfel_core::flat::FlatCloud;
use surfel_core::math::{Aabb, Basis, LANES, Random, Ray, Vec3};
use surfel_core::trace::{Hit, Simd, SurfaceHit, surface_hits};

/// The number of rays that make a packet.
pub const TILE: usize = 16;

/// Returns the decoded centres of all points, in the order of their slots.
pub fn centers(scene: &FlatCloud) -> Vec<Vec3> {
    scene.points.slots().map(|slot| scene.points.center(slot)).collect()
}

/// Returns parallel rays along -Z through the points of a square grid, from a height of 5.
pub fn rays_from_above(half_side: f32, n_side: usize) -> Vec<Ray> {
    let at = |i: usize| half_side * ((2 * i + 1) as f32 / n_side as f32 - 1.0);
    let origins = (0..n_side * n_side).map(|i| Vec3::new(at(i % n_side), at(i / n_side), 5.0));
    origins.map(|origin| Ray::new(origin, Vec3::NEG_Z)).collect()
}

/// Returns the hits of rays on the surface of a cloud.
pub fn hits(scene: &FlatCloud, rays: &[Ray]) -> Vec<SurfaceHit> {
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    surface_hits(scene, Simd::detect(), rays, &mut hits);
    hits
}

/// Returns camera rays through tiles of four by four pixels, each tile about a point.
pub fn camera_rays(scene: &FlatCloud, n_tiles: usize) -> Vec<Ray> {
    let centers = centers(scene);
    let bounds = Aabb::of_points(centers.iter().copied());
    let to_eye = (bounds.diagonal() + scene.points.radius(0)) * Vec3::new(0.8, 0.5, 0.6);
    let eye = bounds.center() + to_eye;
    let tile = |i: usize| {
        let to_point = centers[i * 7919 % centers.len()] - eye;
        let basis = Basis::around(to_point.normalize_or(Vec3::X));
        // The spacing of the rays goes from a few a radius to one in a few radii.
        let slope = 0.02 / (1 + i % 5 * 4) as f32;
        (0..TILE).map(move |pixel| {
            let (x, y) = ((pixel % 4) as f32 - 1.5, (pixel / 4) as f32 - 1.5);
            let across = slope * (x * basis.tangent + y * basis.bitangent);
            Ray::new(eye, (to_point.normalize_or(Vec3::X) + across).normalize())
        })
    };
    (0..n_tiles).flat_map(tile).collect()
}

/// Returns rays from the hits of camera rays to a light, where their ranges end.
pub fn shadow_rays(scene: &FlatCloud, camera: &BruteForce) -> Vec<Ray> {
    let bounds = Aabb::of_points(centers(scene));
    let light = bounds.center() + bounds.diagonal() * Vec3::new(0.4, 0.7, 0.5);
    let hits = camera.rays.iter().zip(&camera.closest).filter(|(_, hit)| !hit.is_miss());
    let ray = |(ray, hit): (&Ray, &Hit)| {
        let origin = ray.at(hit.distance - 0.5 * scene.points.radius(hit.slot));
        let distance = origin.distance(light);
        Ray { t_max: distance, ..Ray::new(origin, (light - origin) / distance) }
    };
    hits.map(ray).collect()
}

/// Returns incoherent rays toward points, from near and far, some of bounded range, some along an axis.
pub fn incoherent_rays(scene: &FlatCloud, n: usize) -> Vec<Ray> {
    let centers = centers(scene);
    let diagonal = Aabb::of_points(centers.iter().copied()).diagonal();
    let mut random = Random::new(52, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    (0..n)
        .map(|i| {
            let radius = scene.points.radius(0);
            let away = Vec3::new(gaussian(), gaussian(), gaussian()).normalize_or(Vec3::X);
            let distance = if i % 2 == 0 { 4.0 * radius } else { diagonal + radius };
            let origin = centers[i * 7919 % centers.len()] + distance * away;
            let direction = if i % 7 == 0 { Vec3::AXES[i % 3] } else { -away };
            let range = if i % 5 == 0 { 0.5..1.5 } else { 0.0..f32::INFINITY };
            Ray { origin, t_min: range.start * distance, direction, t_max: range.end * distance }
        })
        .collect()
}

/// Returns rays along axes, in planes of discs, past rims, on faces of boxes, with bare and empty ranges, and
/// from far away.
pub fn degenerate_rays(scene: &FlatCloud) -> Vec<Ray> {
    let points = &scene.points;
    let mut rays = Vec::new();
    for slot in some_slots(scene) {
        let (center, normal, radius) =
            (points.center(slot), points.normal(slot), points.radius(slot));
        for direction in axes_and_normals(normal) {
            let distances = [radius, 3.0 * radius, 1e6, 1e12, 1e20, 1e30];
            rays.extend(distances.map(|d| Ray::new(center - d * direction, direction)));
        }
        let ray = Ray::new(center - 3.0 * radius * normal, normal);
        let distance = BruteForce::new(scene, vec![ray]).closest[0].distance;
        rays.extend(ranges(distance).map(|(t_min, t_max)| Ray { t_min, t_max, ..ray }));
    }
    rays.extend(from_box_faces(scene));
    rays.push(Ray::new(Vec3::splat(0.1), Vec3::ZERO));
    rays
}

/// Returns about five slots, evenly spread.
pub fn some_slots(scene: &FlatCloud) -> Vec<u32> {
    let slots: Vec<u32> = scene.points.slots().collect();
    slots.iter().copied().step_by(slots.len().div_ceil(5)).collect()
}

/// Returns the axes and the directions along and across a normal.
pub fn axes_and_normals(normal: Vec3) -> Vec<Vec3> {
    let basis = Basis::around(normal);
    let others = [normal, -normal, basis.tangent, -basis.bitangent];
    signed_axes().into_iter().chain(others).collect()
}

/// Returns ranges that begin or end at a hit or one float around it, and empty ranges.
fn ranges(distance: f32) -> impl Iterator<Item = (f32, f32)> {
    let (before, after, end) = (distance.next_down(), distance.next_up(), f32::INFINITY);
    let at_hit = [(distance, distance), (0.0, distance), (distance, end), (0.0, before)];
    let around = [(after, end), (before, after), (after, before), (before, end)];
    let empty = [(2.0 * distance, 0.5 * distance), (end, end), (end, 0.0)];
    let short = [(0.0, 0.0), (-0.0, end), (0.0, 1e-38), (0.0, f32::from_bits(1))];
    at_hit.into_iter().chain(around).chain(empty).chain(short)
}

/// Returns rays along axes from faces and corners of the boxes of the first nodes.
fn from_box_faces(scene: &FlatCloud) -> Vec<Ray> {
    let children = |node| (0..LANES).filter(move |&lane| BvhNode::child(node, lane).is_some());
    let nodes = scene.points.nodes.iter().take(3);
    let boxes = nodes.flat_map(|node| children(node).map(|lane| node.bounds(lane)));
    let rays = |bounds: Aabb| {
        let ray = move |(i, direction): (usize, Vec3)| {
            let mut origin = bounds.center();
            origin[i % 3] = bounds.min[i % 3];
            [Ray::new(origin, direction), Ray::new(bounds.max, direction)]
        };
        signed_axes().into_iter().enumerate().flat_map(ray)
    };
    boxes.flat_map(rays).collect()
}

/// Returns each axis in both directions, combined with zeros of both signs.
fn signed_axes() -> Vec<Vec3> {
    let zeros = [Vec3::ZERO, -Vec3::ZERO];
    let axes = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    axes.flat_map(|axis| zeros.map(|zero| Vec3::select(axis.cmpeq(Vec3::ZERO), zero, axis)))
        .collect()
}

/// Returns copies of a ray in which one field is NaN or infinite.
pub fn non_finite_rays(ray: Ray) -> Vec<Ray> {
    let is_axis = |axis: Vec3| axis.cmpeq(Vec3::ONE);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().flat_map(|value| {
        Vec3::AXES.into_iter().chain([Vec3::ONE]).flat_map(move |axes| {
            let with_bad = |vector| Vec3::select(is_axis(axes), Vec3::splat(value), vector);
            let origin = Ray { origin: with_bad(ray.origin), ..ray };
            [origin, Ray { direction: with_bad(ray.direction), ..ray }]
        })
    });
    bad.chain([Ray { t_min: f32::NAN, ..ray }, Ray { t_max: f32::NAN, ..ray }]).collect()
}

/// Returns the values in a random order that is the same in each run.
pub fn shuffled<T>(mut values: Vec<T>) -> Vec<T> {
    let mut random = Random::new(51, 0);
    for i in (1..values.len()).rev() {
        values.swap(i, random.below(i as u64 + 1) as usize);
    }
    values
}
