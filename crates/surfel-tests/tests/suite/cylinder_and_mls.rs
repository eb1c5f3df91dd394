//! Surfaces of the methods that the thesis compares itself with: known answers, holes, and one surface for rays of all
//! kinds.

use crate::brute_force::{all_hits, within_limit};
use crate::rays::{hits, rays_from_above};
use surfel_core::flat::FlatCloud;
use surfel_core::math::{Ray, Vec3};
use surfel_core::points::{PointCloud, Preparation};
use surfel_core::progress::NoProgress;
use surfel_core::surface::{EdgeTest, SurfaceKind, SurfaceOptions};
use surfel_core::trace::{Hit, Simd, Splat, SurfaceHit, occlusions, splats, surface_hits};
use surfel_tests::clouds;
use surfel_tests::scenes;
use surfel_tests::scenes::FIELD_KINDS;

const KINDS: [SurfaceKind; 2] = [SurfaceKind::Cylinder, SurfaceKind::Mls];

/// Returns a cloud with these options.
fn flat_with(cloud: PointCloud, kind: SurfaceKind, options: SurfaceOptions) -> FlatCloud {
    let mut points = scenes::points(cloud, kind);
    points.options = options;
    FlatCloud::new(&points, &NoProgress).unwrap()
}

#[test]
fn a_sphere_has_the_depth_and_normals_of_a_sphere() {
    // The radius of a point is 0.05. Greatest errors of depth in units and of angle in degrees, up to 45 degrees from the
    // normal: discs stand out by r^2 / 2 at most, a fitted quadric does not.
    let flat_error = 0.05 * 0.05;
    for (kind, degree, max_depth, max_angle) in [
        (SurfaceKind::Cylinder, 2, 1.5 * flat_error, 3.0),
        (SurfaceKind::Mls, 1, flat_error, 1.0),
        (SurfaceKind::Mls, 2, 0.1 * flat_error, 0.2),
        (SurfaceKind::Mls, 3, 0.1 * flat_error, 0.2),
    ] {
        let options = SurfaceOptions { degree, ..SurfaceOptions::default() };
        let flat = flat_with(clouds::with_random_signs(clouds::sphere(20_000, 1.0)), kind, options);
        let rays = rays_from_above(0.7, 100);
        let inside = |ray: &&Ray| ray.origin.truncate().length() < 0.7;
        let rays: Vec<Ray> = rays.iter().filter(inside).copied().collect();
        for (ray, hit) in rays.iter().zip(hits(&flat, &rays)) {
            let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
            let depth = (hit.distance - (5.0 - height)).abs();
            let angle = hit.normal.angle_between(ray.origin.with_z(height)).to_degrees();
            assert!(depth < max_depth && angle < max_angle, "{kind:?} {degree}: {depth} {angle}");
        }
    }
}

#[test]
fn a_plane_is_flat_and_ends_at_its_outermost_points() {
    for kind in KINDS {
        let flat = scenes::flat(clouds::with_random_signs(clouds::plane(50, 0.3, 4)), kind);
        for hit in hits(&flat, &rays_from_above(0.95, 60)) {
            assert!((hit.distance - 5.0).abs() < 1e-4, "{kind:?} {hit:?}");
            assert!(0.99999 < hit.normal.z, "{kind:?} {hit:?}");
        }
        let beyond: Vec<Ray> = rays_from_above(1.2, 120)
            .into_iter()
            .filter(|ray| 1.0 < ray.origin.truncate().abs().max_element())
            .collect();
        assert!(hits(&flat, &beyond).iter().all(SurfaceHit::is_miss), "{kind:?}");
    }
}

#[test]
fn the_sides_of_a_cube_are_flat() {
    for kind in KINDS {
        let flat = scenes::flat(clouds::with_random_signs(clouds::cube(40, 0.3, 2)), kind);
        // The radius of a point is 0.1.
        for hit in hits(&flat, &rays_from_above(0.8, 60)) {
            assert!((hit.distance - 4.0).abs() < 1e-3 && 0.999 < hit.normal.z, "{kind:?} {hit:?}");
        }
        for hit in hits(&flat, &rays_from_above(0.97, 60)) {
            assert!((hit.distance - 4.0).abs() < 0.06, "{kind:?} {hit:?}");
        }
    }
}

#[test]
fn crossing_planes_are_flat_beside_their_crossing() {
    for kind in KINDS {
        let flat =
            scenes::flat(clouds::with_random_signs(clouds::crossing_planes(50, 0.3, 5)), kind);
        for (ray, hit) in
            rays_from_above(0.95, 60).iter().zip(hits(&flat, &rays_from_above(0.95, 60)))
        {
            if 0.25 < ray.origin.x.abs() {
                let is_flat = (hit.distance - 5.0).abs() < 1e-3 && 0.999 < hit.normal.z;
                assert!(is_flat, "{kind:?} {ray:?} {hit:?}");
            }
        }
        let end = |height: f32| {
            let y = |i: i32| -0.9 + 0.036 * i as f32;
            let ray = |i| Ray::new(Vec3::new(5.0, y(i), height), Vec3::NEG_X);
            let rays: Vec<Ray> = (0..50).map(ray).collect();
            hits(&flat, &rays)
        };
        assert!(end(1.01).iter().all(SurfaceHit::is_miss), "{kind:?}");
        assert!(end(0.8).iter().all(|hit| (hit.distance - 5.0).abs() < 1e-3), "{kind:?}");
    }
}

/// Returns a Möbius strip of radius 1 and its exact normals, which no orientation makes agree.
fn moebius_strip() -> PointCloud {
    let (n_around, n_across) = (300, 20);
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for i in 0..n_around {
        let angle = std::f32::consts::TAU * i as f32 / n_around as f32;
        let outward = Vec3::new(angle.cos(), angle.sin(), 0.0);
        let across = (0.5 * angle).cos() * outward + (0.5 * angle).sin() * Vec3::Z;
        let along = Vec3::new(-angle.sin(), angle.cos(), 0.0);
        for j in 0..n_across {
            let offset = 0.4 * (j as f32 / (n_across - 1) as f32 - 0.5);
            positions.push(outward + offset * across);
            normals.push(across.cross(along));
        }
    }
    PointCloud { normals: Some(normals), ..PointCloud::from_positions(positions) }
}

#[test]
fn a_moebius_strip_has_no_seam() {
    for kind in KINDS.into_iter().chain(FIELD_KINDS) {
        let flat = scenes::flat(clouds::with_random_signs(moebius_strip()), kind);
        for i in 0..2000 {
            let angle = std::f32::consts::TAU * i as f32 / 2000.0;
            let outward = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let across = (0.5 * angle).cos() * outward + (0.5 * angle).sin() * Vec3::Z;
            let normal = across.cross(Vec3::new(-angle.sin(), angle.cos(), 0.0));
            let target = outward + 0.1 * across;
            let [hit] = hits(&flat, &[Ray::new(target + normal, -normal)])[..] else { panic!() };
            assert!((hit.distance - 1.0).abs() < 0.01, "{kind:?} {angle}: {hit:?}");
            assert!(0.99 < hit.normal.dot(normal).abs(), "{kind:?} {angle}: {hit:?}");
        }
    }
}

/// Returns two sheets at Z = 0 and Z = -`distance`, with points of radius 0.1.
fn sheets(distance: f32) -> PointCloud {
    let mut cloud = clouds::plane(40, 0.3, 8);
    let lower = clouds::plane(40, 0.3, 9).positions.into_iter().map(|p| p - distance * Vec3::Z);
    cloud.positions.extend(lower);
    let n = cloud.positions.len();
    (cloud.normals, cloud.radii) = (Some(vec![Vec3::Z; n]), Some(vec![0.1; n]));
    cloud
}

#[test]
fn sheets_closer_than_the_reach_become_one_and_others_do_not() {
    let depths = |kind, distance, reach| {
        let options = SurfaceOptions { reach: Some(reach), ..SurfaceOptions::default() };
        let flat = flat_with(sheets(distance), kind, options);
        let found = hits(&flat, &rays_from_above(0.7, 30));
        found.iter().map(|hit| hit.distance - 5.0).collect::<Vec<f32>>()
    };
    // The ray's cylinder is as long as it is wide.
    let one = depths(SurfaceKind::Cylinder, 0.05, 1.0);
    assert!(one.iter().all(|depth| (0.005..0.045).contains(depth)), "{one:?}");
    let two = depths(SurfaceKind::Cylinder, 0.12, 1.0);
    assert!(two.iter().all(|depth| depth.abs() < 1e-4), "{two:?}");
    // At the upper sheet the points of the lower one have no weight beyond the support.
    let two = depths(SurfaceKind::Mls, 0.16, 1.4);
    assert!(two.iter().all(|depth| depth.abs() < 1e-3), "{two:?}");
    let one = depths(SurfaceKind::Mls, 0.02, 1.4);
    assert!(one.iter().all(|depth| (0.0..0.02).contains(depth)), "{one:?}");
}

#[test]
fn cylinders_with_too_few_points_go_through_holes() {
    let with_density = |density| {
        let options = SurfaceOptions { density, ..SurfaceOptions::default() };
        let mut cloud = clouds::plane(40, 0.0, 1);
        cloud.radii = Some(vec![0.1; cloud.len()]);
        let mut flat = flat_with(cloud, SurfaceKind::Cylinder, options);
        flat.edge_test = EdgeTest::Off;
        flat
    };
    // Beyond the rim fewer and fewer discs are pierced; inside about twelve are.
    let beyond = |distance: f32| -> Vec<Ray> {
        let at = |i: i32| Vec3::new(0.975 + distance, 0.02 * i as f32 - 0.8, 5.0);
        (0..80).map(|i| Ray::new(at(i), Vec3::NEG_Z)).collect()
    };
    let n_hits = |flat: &FlatCloud, distance| {
        hits(flat, &beyond(distance)).iter().filter(|hit| !hit.is_miss()).count()
    };
    let (loose, strict) = (with_density(1), with_density(6));
    assert_eq!((n_hits(&loose, -0.2), n_hits(&strict, -0.2)), (80, 80));
    assert_eq!((n_hits(&loose, 0.05), n_hits(&strict, 0.05)), (80, 0));
    assert_eq!(n_hits(&with_density(128), -0.2), 0);
}

#[test]
fn a_cylinder_has_all_points_that_brute_force_finds_in_it() {
    let rays = [scenes::random_rays(600, 1.2, 21), rays_from_above(0.9, 20)].concat();
    for reach in [1.0, 2.5] {
        let options = SurfaceOptions { reach: Some(reach), ..SurfaceOptions::default() };
        let flat = flat_with(clouds::sphere(4000, 1.0), SurfaceKind::Cylinder, options);
        let expected: Vec<(usize, u32, f32)> =
            rays.iter().map(|ray| mean_of_cylinder(&flat, ray)).collect();
        assert!(expected.iter().any(|(n, ..)| (12.0 * reach * reach) as usize / 2 < *n));
        for simd in Simd::available() {
            let mut found = vec![Splat::MISS; rays.len()];
            splats(&flat, simd, &rays, &mut found);
            for (splat, (n, slot, distance)) in found.iter().zip(&expected) {
                assert_eq!((splat.n_discs as usize, splat.hit.slot), (*n, *slot), "{reach}");
                assert!(*n == 0 || (splat.distance - distance).abs() < 1e-5, "{splat:?}");
            }
        }
    }
}

/// Returns the number of points in a ray's cylinder, the slot of the first one, and the mean of their distances.
fn mean_of_cylinder(flat: &FlatCloud, ray: &Ray) -> (usize, u32, f32) {
    let all = all_hits(flat, ray);
    let slot = all.first().map_or(Hit::MISS.slot, |(hit, _)| hit.slot);
    let (mut n, mut weights, mut sum) = (0, 0.0, 0.0);
    for (hit, radius) in within_limit(&all) {
        let offset = ray.at(hit.distance).distance(flat.points.center(hit.slot));
        let weight = (1.0 - offset / radius).max(1e-4);
        (n, weights, sum) = (n + 1, weights + weight, sum + weight * hit.distance);
    }
    (n, slot, sum / weights)
}

#[test]
fn what_a_ray_hits_also_occludes_it() {
    let rays = scenes::random_rays(3000, 1.5, 8);
    for kind in KINDS {
        let mut cloud = clouds::cube(24, 0.4, 11);
        cloud.normals = None;
        let flat = scenes::flat(cloud, kind);
        let mut occluded = vec![false; rays.len()];
        occlusions(&flat, Simd::detect(), &rays, &mut occluded);
        let found = hits(&flat, &rays);
        assert!(found.iter().zip(&occluded).all(|(hit, occluded)| hit.is_miss() != *occluded));
        assert!(500 < found.iter().filter(|hit| !hit.is_miss()).count(), "{kind:?}");
    }
}

#[test]
fn the_order_of_rays_does_not_change_their_hits() {
    let rays = [scenes::random_rays(700, 1.2, 5), rays_from_above(1.0, 30)].concat();
    for kind in KINDS {
        let flat = scenes::flat(clouds::cube(30, 0.4, 3), kind);
        let together = hits(&flat, &rays);
        for simd in Simd::available() {
            for (i, ray) in rays.iter().enumerate().step_by(7) {
                let mut single = [SurfaceHit::MISS];
                surface_hits(&flat, simd, &[*ray], &mut single);
                assert_eq!(single[0], together[i], "{kind:?} {} {i}", simd.name());
            }
        }
    }
}

/// Returns splats whose planes are fitted to points without normals.
fn splats_without_normals(cloud: PointCloud) -> FlatCloud {
    let preparation = Preparation { estimates_normals: false, ..scenes::one_surface() };
    let cloud = PointCloud { normals: None, ..cloud };
    let points = scenes::prepared(cloud, &preparation, SurfaceKind::SplatFit);
    assert!(points.cloud().normals.is_none());
    FlatCloud::new(&points, &NoProgress).unwrap()
}

#[test]
fn planes_are_fitted_to_points_without_normals() {
    let plane = splats_without_normals(clouds::plane(50, 0.3, 4));
    for hit in hits(&plane, &rays_from_above(0.95, 60)) {
        assert!((hit.distance - 5.0).abs() < 1e-4 && 0.9999 < hit.normal.z, "{hit:?}");
    }
    let beyond = rays_from_above(1.2, 120).into_iter();
    let beyond: Vec<Ray> =
        beyond.filter(|ray| 1.0 < ray.origin.truncate().abs().max_element()).collect();
    assert!(hits(&plane, &beyond).iter().all(SurfaceHit::is_miss));
}

#[test]
fn rays_find_points_without_normals_alone_and_in_packets() {
    let rays = [scenes::random_rays(1500, 1.4, 8), rays_from_above(1.1, 40)].concat();
    let flat = splats_without_normals(clouds::cube(30, 0.4, 11));
    let (together, mut occluded) = (hits(&flat, &rays), vec![false; rays.len()]);
    occlusions(&flat, Simd::detect(), &rays, &mut occluded);
    assert!(together.iter().zip(&occluded).all(|(hit, occluded)| hit.is_miss() != *occluded));
    assert!(500 < occluded.iter().filter(|occluded| **occluded).count());
    for simd in Simd::available() {
        for (ray, found) in rays.iter().zip(&together).step_by(7) {
            let mut single = [SurfaceHit::MISS];
            surface_hits(&flat, simd, &[*ray], &mut single);
            assert_eq!(single[0], *found, "{} {ray:?}", simd.name());
        }
    }
}

#[test]
fn few_points_and_extreme_radii_give_no_panic() {
    for kind in KINDS {
        for n in [1, 2, 3, 9] {
            hits(&scenes::flat(clouds::sphere(n, 1.0), kind), &scenes::random_rays(200, 1.2, 1));
        }
        for scale in [1e-6, 1e6] {
            let mut cloud = clouds::sphere(2000, scale);
            cloud.normals = None;
            let ray = Ray::new(3.0 * scale * Vec3::Z, Vec3::NEG_Z);
            let found = hits(&scenes::flat(cloud, kind), &[ray])[0].distance;
            assert!((found / scale - 2.0).abs() < 0.01, "{kind:?} {scale}: {found}");
        }
        let line = hits(&scenes::flat(clouds::line(300), kind), &scenes::random_rays(500, 1.2, 2));
        assert!(line.iter().all(|hit| hit.is_miss() || hit.distance.is_finite()));
    }
}
