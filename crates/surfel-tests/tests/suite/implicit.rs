//! The field of weighted planes: known answers, its kd-tree, and clouds that are hard on it.

use crate::bad_clouds;
use crate::rays::{hits, rays_from_above};
use rayon::prelude::*;
use surfel_core::flat::{FieldTree, FlatCloud};
use surfel_core::math::{Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::CloudGeometry;
use surfel_core::surface::{EdgeTest, FieldPoint, SurfaceKind};
use surfel_core::trace::{Simd, SurfaceHit, occlusions};
use surfel_tests::clouds;
use surfel_tests::field_bvh::{FieldBvh, SearchCounts, field_point, zero_between};
use surfel_tests::scenes;

const KIND: SurfaceKind = SurfaceKind::Implicit;

#[test]
fn a_sphere_has_its_depth_and_its_normals() {
    let flat = scenes::flat(clouds::sphere(20_000, 1.0), KIND);
    for (ray, hit) in rays_from_above(0.65, 80).iter().zip(hits(&flat, &rays_from_above(0.65, 80)))
    {
        let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
        // Points of spacing 0.025 have supports of 0.06, whose planes stand out by at most 0.06^2 / 2.
        assert!((hit.distance - (5.0 - height)).abs() < 1.8e-3, "{ray:?} {hit:?}");
        assert!(hit.normal.angle_between(ray.origin.with_z(height)).to_degrees() < 1.0);
    }
}

#[test]
fn a_plane_is_flat_and_ends_at_its_outermost_points() {
    let flat = scenes::flat(clouds::plane(50, 0.3, 4), KIND);
    for hit in hits(&flat, &rays_from_above(0.95, 60)) {
        assert!((hit.distance - 5.0).abs() < 1e-5 && 1.0 - 1e-6 < hit.normal.z, "{hit:?}");
    }
    let beyond = rays_from_above(1.2, 120).into_iter();
    let beyond: Vec<Ray> =
        beyond.filter(|ray| 1.0 < ray.origin.truncate().abs().max_element()).collect();
    assert!(hits(&flat, &beyond).iter().all(SurfaceHit::is_miss));
}

#[test]
fn crossing_planes_stay_planes_away_from_the_crossing() {
    let flat = scenes::flat(clouds::crossing_planes(50, 0.3, 5), KIND);
    let rays = rays_from_above(0.95, 60);
    for (ray, hit) in rays.iter().zip(hits(&flat, &rays)) {
        if 0.15 < ray.origin.x.abs() {
            assert!((hit.distance - 5.0).abs() < 1e-4 && 0.999 < hit.normal.z, "{ray:?} {hit:?}");
        }
    }
}

/// Returns the cube of side 2 with normals that point outward, in random directions if `is_random`.
fn cube(is_random: bool) -> CloudGeometry {
    let mut points = scenes::points(clouds::cube(40, 0.3, 3), KIND);
    if is_random {
        return scenes::changed(&points, |cloud| {
            *cloud = clouds::with_random_signs(std::mem::take(cloud));
        });
    }
    points.has_outward_normals = true;
    points
}

#[test]
fn a_cube_is_flat_and_closed_whatever_the_signs_of_its_normals() {
    for is_random in [false, true] {
        let flat = FlatCloud::new(&cube(is_random), &NoProgress).unwrap();
        let rays = rays_from_above(0.9, 60);
        for hit in hits(&flat, &rays) {
            assert!(
                (hit.distance - 4.0).abs() < 1e-4 && 0.999 < hit.normal.z,
                "{is_random}: {hit:?}"
            );
        }
        let rays: Vec<Ray> = scenes::random_rays(3000, 0.9, 4);
        let rays: Vec<Ray> = rays.into_iter().filter(|ray| ray.t_max.is_infinite()).collect();
        let toward = |ray: &Ray| {
            let cube = surfel_core::math::Aabb { min: -0.9 * Vec3::ONE, max: 0.9 * Vec3::ONE };
            0.1 < cube.length_along(ray)
        };
        let rays: Vec<Ray> = rays.into_iter().filter(toward).collect();
        let n_misses = hits(&flat, &rays).iter().filter(|hit| hit.is_miss()).count();
        assert!(2 * n_misses <= rays.len() / 1000, "{is_random}: {n_misses} of {}", rays.len());
    }
}

/// Two sheets that face up, `gap` apart, of points with spacing 0.04.
pub fn sheets(gap: f32, kind: SurfaceKind) -> CloudGeometry {
    let mut cloud = clouds::plane(50, 0.3, 6);
    let below = cloud.positions.clone();
    cloud.positions.extend(below.iter().map(|position| *position - gap * Vec3::Z));
    let n = cloud.positions.len();
    cloud.normals = Some(vec![Vec3::Z; n]);
    cloud.radii = Some(vec![0.08; n]);
    scenes::points(cloud, kind)
}

#[test]
fn sheets_closer_than_the_reach_of_their_points_stay_apart() {
    // The reach is 0.096.
    let flat = FlatCloud::new(&sheets(0.07, KIND), &NoProgress).unwrap();
    let rays = rays_from_above(0.9, 60);
    let upper = hits(&flat, &rays);
    for hit in &upper {
        assert!((hit.distance - 5.0).abs() < 0.01, "{hit:?}");
    }
    let behind = |(ray, hit): (&Ray, &SurfaceHit)| Ray { t_min: hit.distance + 0.02, ..*ray };
    let behind: Vec<Ray> = rays.iter().zip(&upper).map(behind).collect();
    for hit in hits(&flat, &behind) {
        assert!((hit.distance - 5.07).abs() < 0.01, "{hit:?}");
    }
}

/// Marches along a ray through the field of all points, and returns the distance of the first zero at which the field
/// grows along the normals.
fn march(points: &[FieldPoint], ray: &Ray) -> Option<f32> {
    let along = |point: &FieldPoint| (point.center - ray.origin).dot(ray.direction);
    let is_near = |point: &&FieldPoint| {
        (ray.at(along(point)) - point.center).length_squared() < point.support * point.support
    };
    let mut near: Vec<FieldPoint> = points.iter().filter(is_near).copied().collect();
    near.sort_by(|a, b| along(a).total_cmp(&along(b)));
    let support = near.iter().map(|point| point.support).fold(0.0, f32::max);
    let step = support / 32.0;
    let mut start = f32::NEG_INFINITY;
    for i in 0..near.len() {
        start = start.max(along(&near[i]) - support);
        while start < along(&near[i]) + support {
            let end = start + step;
            let reached = near.iter().skip(i).take_while(|point| along(point) < end + support);
            let zero = zero_between(reached, ray, [start, end]);
            if let Some(zero) = zero.filter(|zero| ray.t_min <= *zero && *zero <= ray.t_max) {
                return Some(zero);
            }
            start = end;
        }
    }
    None
}

#[test]
fn the_kd_tree_finds_the_first_zeros_of_the_field_of_all_points() {
    let rough = |mut cloud: PointCloud| {
        cloud.normals = None;
        cloud
    };
    let tested = [
        ("sphere", clouds::sphere(20_000, 1.0)),
        ("waves", clouds::waves(20_000, 0.3)),
        ("cube", clouds::cube(40, 0.4, 11)),
        ("cube with estimated normals", rough(clouds::cube(40, 0.4, 11))),
    ];
    for (name, cloud) in tested {
        let mut flat = scenes::flat(cloud, KIND);
        flat.edge_test = EdgeTest::Off;
        let points: Vec<FieldPoint> =
            flat.points.slots().map(|slot| field_point(&flat.points, slot)).collect();
        let rays = scenes::random_rays(4000, 1.2, 5);
        let found = hits(&flat, &rays);
        let n_hits = found.iter().filter(|hit| !hit.is_miss()).count();
        let differs = |(hit, ray): (&SurfaceHit, &Ray)| match march(&points, ray) {
            Some(distance) => hit.is_miss() || 0.1 * hit.radius < (hit.distance - distance).abs(),
            None => !hit.is_miss(),
        };
        let n_different = found.par_iter().zip(&rays).filter(|pair| differs(*pair)).count();
        assert!(
            400 < n_hits && 1000 * n_different <= rays.len(),
            "{name}: {n_different} of {} rays differ, {n_hits} hit",
            rays.len()
        );
    }
}

#[test]
fn the_kd_tree_and_the_hierarchy_of_the_points_find_the_same_surface() {
    let mut flat = scenes::flat(clouds::sphere(20_000, 1.0), KIND);
    flat.edge_test = EdgeTest::Off;
    let bvh = FieldBvh::new(&flat);
    let rays = scenes::random_rays(4000, 1.2, 6);
    let found = hits(&flat, &rays);
    let differs = |(hit, ray): &(&SurfaceHit, &Ray)| match bvh
        .first_zero(ray, &mut SearchCounts::default())
    {
        Some(distance) => hit.is_miss() || 0.1 * hit.radius < (hit.distance - distance).abs(),
        None => !hit.is_miss(),
    };
    let n_different = found.par_iter().zip(&rays).filter(differs).count();
    let n_hits = found.iter().filter(|hit| !hit.is_miss()).count();
    assert!(400 < n_hits && n_different <= 4, "{n_different} of {} rays differ", rays.len());
}

#[test]
fn what_a_camera_ray_hits_also_occludes_it() {
    let flat = scenes::flat(clouds::cube(24, 0.4, 11), KIND);
    let rays = scenes::random_rays(4000, 1.5, 8);
    let mut occluded = vec![false; rays.len()];
    occlusions(&flat, Simd::detect(), &rays, &mut occluded);
    let is_hit: Vec<bool> = hits(&flat, &rays).iter().map(|hit| !hit.is_miss()).collect();
    let n_hits = is_hit.iter().filter(|is_hit| **is_hit).count();
    assert!(400 < n_hits, "{n_hits}");
    assert_eq!(is_hit, occluded);
}

#[test]
fn kd_trees_of_bad_clouds_have_bounded_size() {
    for (name, cloud) in bad_clouds::bad_clouds() {
        let n = cloud.len();
        let rays = bad_clouds::rays_toward(&cloud, 20);
        let mut flat = bad_clouds::flat(cloud, KIND);
        for has_sides in [false, true] {
            flat.field = FieldTree::new(&flat.points, has_sides, &NoProgress).unwrap().into();
            assert!(flat.field.bytes() <= 96 * n + 64, "{name}: {} bytes", flat.field.bytes());
            let found = hits(&flat, &rays);
            assert!(found.iter().all(|hit| hit.is_miss() || hit.distance.is_finite()), "{name}");
        }
    }
}
