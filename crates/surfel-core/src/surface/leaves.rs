//! Leaves: each point is a cluster of small discs that point in all directions, as the leaves around a point in a crown do.

use super::disc::Disc;
use super::shape::{PointLanes, RayLanes, Shape};
use crate::math::{Floats, LaneMask, Vec3, Vec3Lanes, hash};

/// Centres of the leaves of a cluster whose radius is 1: chosen at random, far from each other. One leaf hides too little,
/// and each one more takes time; eight show no shape of their own.
pub const LEAF_CENTERS: [Vec3; 8] = [
    Vec3::new(0.78, 0.23, -0.38),
    Vec3::new(-0.65, 0.12, -0.54),
    Vec3::new(-0.57, -0.07, 0.69),
    Vec3::new(0.27, 0.75, -0.01),
    Vec3::new(0.14, -0.81, 0.21),
    Vec3::new(0.65, 0.25, 0.27),
    Vec3::new(0.03, 0.27, -0.36),
    Vec3::new(-0.34, -0.08, 0.01),
];
/// Their normals, of any length: chosen at random, in directions far from each other.
pub const LEAF_NORMALS: [Vec3; 8] = [
    Vec3::new(0.69, -0.68, 0.24),
    Vec3::new(0.03, 0.89, -0.45),
    Vec3::new(0.64, 0.75, -0.19),
    Vec3::new(-0.11, -0.52, -0.85),
    Vec3::new(-0.41, -0.72, 0.56),
    Vec3::new(0.93, -0.13, 0.33),
    Vec3::new(0.05, 0.86, 0.52),
    Vec3::new(-0.15, 0.42, -0.89),
];
/// Radius of a leaf in radii of its cluster.
pub const LEAF_RADIUS: f32 = 0.5;
/// Radius, in radii of a cluster, of the ball around its centre that contains all of its leaves.
pub const REACH: f32 = 1.39;

/// The shape of a cluster of leaves. The centres of the leaves lie within the point's radius. The normal of the point is no
/// normal of a surface but the [`mirror`] of the cluster, which is mirrored at its plane.
pub struct Leaves;

impl Shape for Leaves {
    /// Returns the nearest leaf at or beyond `t_min`.
    #[inline(always)]
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask) {
        let reach = points.radius * F::splat(REACH);
        let along = points.center.dot(ray.direction);
        let across = points.center.minus(ray.direction.scaled(along));
        let is_near = across.dot(across).lt(reach * reach);
        let mut nearest = F::splat(f32::INFINITY);
        if is_near.bits() != 0 {
            let center = mirrored(points.center, points.normal);
            let direction = mirrored(ray.direction, points.normal);
            let ray = RayLanes { direction, t_min: ray.t_min };
            let radius = points.radius * F::splat(LEAF_RADIUS);
            for (offset, normal) in LEAF_CENTERS.into_iter().zip(LEAF_NORMALS) {
                let center = center.plus(Vec3Lanes::splat(offset).scaled(points.radius));
                let leaf = PointLanes { center, normal: Vec3Lanes::splat(normal), radius };
                let (distance, is_hit) = Disc::intersect(&leaf, &ray);
                nearest = F::select(is_hit, distance.min(nearest), nearest);
            }
        }
        (nearest, is_near & nearest.lt(F::splat(f32::INFINITY)))
    }
}

/// Returns vectors mirrored at the planes of normals of any length.
#[inline(always)]
fn mirrored<F: Floats>(vector: Vec3Lanes<F>, normal: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let height = normal.dot(vector) / normal.dot(normal);
    vector.minus(normal.scaled(height + height))
}

/// Returns the normal of the leaf at `position`, on either side of it. `mirror` has unit length.
pub fn normal(position: Vec3, center: Vec3, mirror: Vec3, radius: f32) -> Vec3 {
    let at = (position - center).reflect(mirror) / radius;
    let mut nearest = (f32::INFINITY, Vec3::Z);
    for (offset, normal) in LEAF_CENTERS.into_iter().zip(LEAF_NORMALS) {
        let (normal, from_leaf) = (normal.normalize(), at - offset);
        // A position on a leaf is nearer to its plane than the others that it lies on by chance.
        let beyond = (from_leaf.length() - LEAF_RADIUS).max(0.0);
        let distance = normal.dot(from_leaf).abs() + beyond;
        if distance < nearest.0 {
            nearest = (distance, normal);
        }
    }
    nearest.1.reflect(mirror)
}

/// Returns the normal, of any length, of the plane at which the cluster of a point is mirrored, so that the clusters of
/// different points are unlike. `position` is that of the point at rest: neither clips nor deformations change the cluster.
pub fn mirror(position: Vec3) -> Vec3 {
    const BITS: u32 = 21;
    let [x, y, z] = position.to_array().map(|coordinate| u64::from(coordinate.to_bits()));
    let bits = hash(hash(x << 32 | y) ^ z);
    let component = |axis: u32| {
        let steps = bits >> (axis * BITS) & ((1 << BITS) - 1);
        steps as f32 / (1 << (BITS - 1)) as f32 - 1.0
    };
    Vec3::new(component(0), component(1), component(2))
}

#[cfg(test)]
mod tests {
    //! Rays against clusters, and the space that clusters take.

    use super::*;
    use crate::math::{Basis, Random, Ray};
    use crate::surface::shape::hit;

    /// The leaves of a cluster: centres, unit normals and radius.
    fn leaves(center: Vec3, mirror: Vec3, radius: f32) -> Vec<(Vec3, Vec3, f32)> {
        let leaf = |(offset, normal): (Vec3, Vec3)| {
            let normal = normal.normalize().reflect(mirror);
            (center + radius * offset.reflect(mirror), normal, LEAF_RADIUS * radius)
        };
        LEAF_CENTERS.into_iter().zip(LEAF_NORMALS).map(leaf).collect()
    }

    #[test]
    fn rays_hit_the_nearest_leaf_and_find_its_normal() {
        let mut random = Random::new(4, 0);
        let mut vector =
            || Vec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f32() - 1.0));
        let mut n_hits = 0;
        for _ in 0..5000 {
            let (center, mirror, radius) = (3.0 * vector(), vector().normalize(), 0.5);
            let origin = 9.0 * vector();
            let target = center + 1.5 * radius * vector();
            let ray = Ray::new(origin, (target - origin).normalize());
            let leaves = leaves(center, mirror, radius);
            let pierced = |(center, leaf, radius): &(Vec3, Vec3, f32)| {
                let distance = leaf.dot(*center - ray.origin) / leaf.dot(ray.direction);
                (distance, ray.at(distance).distance(*center) / *radius)
            };
            // Rays through rims may be rounded to either side of them.
            if leaves.iter().any(|leaf| (pierced(leaf).1 - 1.0).abs() < 1e-3) {
                continue;
            }
            let is_hit =
                |leaf: &&(Vec3, Vec3, f32)| 0.0 <= pierced(leaf).0 && pierced(leaf).1 < 1.0;
            let hits = leaves.iter().filter(is_hit);
            let nearest = hits.min_by(|a, b| pierced(a).0.total_cmp(&pierced(b).0));
            let found = hit::<Leaves>(center, 300.0 * mirror, radius, &ray);
            assert_eq!(found.is_some(), nearest.is_some(), "{found:?} {nearest:?}");
            if let (Some(found), Some(nearest)) = (found, nearest) {
                n_hits += 1;
                assert!((found - pierced(nearest).0).abs() < 1e-3, "{found} {nearest:?}");
                let normal = normal(ray.at(found), center, mirror, radius);
                assert!(0.9999 < normal.dot(nearest.1).abs(), "{normal} {nearest:?}");
            }
        }
        assert!(1000 < n_hits, "{n_hits}");
    }

    #[test]
    fn all_leaves_lie_within_their_reach_and_their_centres_within_the_radius() {
        let mut farthest = 0.0f32;
        for (center, normal, radius) in leaves(Vec3::ZERO, Vec3::Z, 1.0) {
            assert!(center.length() < 1.0);
            let Basis { tangent, bitangent, .. } = Basis::around(normal);
            for i in 0..360 {
                let (sin, cos) = (i as f32).to_radians().sin_cos();
                farthest =
                    farthest.max((center + radius * (cos * tangent + sin * bitangent)).length());
            }
        }
        assert!((0.97 * REACH..REACH).contains(&farthest), "{farthest}");
    }

    #[test]
    fn a_cluster_hides_two_thirds_of_what_a_ball_hides() {
        let mut random = Random::new(6, 0);
        let mut vector =
            || Vec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f32() - 1.0));
        let (mut n_hits, mut n_rays) = (0, 0);
        for _ in 0..40_000 {
            let (direction, mirror) = (vector().normalize(), vector().normalize());
            let Basis { tangent, bitangent, .. } = Basis::around(direction);
            let across = REACH * vector();
            let origin = across.x * tangent + across.y * bitangent - 3.0 * direction;
            n_rays += 1;
            n_hits += usize::from(
                hit::<Leaves>(Vec3::ZERO, mirror, 1.0, &Ray::new(origin, direction)).is_some(),
            );
        }
        let area = n_hits as f32 / n_rays as f32 * (2.0 * REACH).powi(2) / std::f32::consts::PI;
        assert!((0.6..0.75).contains(&area), "{area}");
    }

    #[test]
    fn mirrors_differ_from_point_to_point() {
        let mirror = |i: u32| mirror(Vec3::new(0.01 * i as f32, 5.0, -1.0)).normalize();
        let mean: Vec3 = (0..1000).map(mirror).sum::<Vec3>() / 1000.0;
        assert!(mean.length() < 0.1, "{mean}");
        assert!((0..1000).all(|i| 1e-3 < mirror(i).distance(mirror(i + 1))));
    }
}
