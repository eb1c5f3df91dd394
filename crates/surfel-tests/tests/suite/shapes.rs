//! Shapes with closed forms: the position, normals and edges of the surface that points of them make.

use crate::rays::{hits, rays_from_above};
use surfel_core::flat::FlatCloud;
use surfel_core::math::{Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_core::trace::{Simd, SurfaceHit, occlusions};
use surfel_tests::clouds;
use surfel_tests::scenes;

/// A sphere of 20,000 points of radius 1 has spacing 0.025 and disc radius 0.05.
#[test]
fn a_sphere_of_points_has_the_depth_and_normals_of_a_sphere() {
    // Mean and greatest error of depth in units and of angle in degrees. A ball of radius r stands out by r, a
    // disc by r^2 / 2 at its rim, where its normal is off by r: 2.9 degrees. Splats of twice the radius stand out
    // by four times that. Rays are up to 45 degrees from the normal.
    let (r, slant) = (0.05, 1.0 / 0.7);
    let rim = slant * r * r / 2.0;
    let bounds = [
        (SurfaceKind::Sphere, [1.2 * r, slant * r], [20.0, 50.0]),
        (SurfaceKind::Disc, [rim, 1.5 * rim], [2.9, 3.5]),
        (SurfaceKind::SplatMean, [rim, 1.5 * rim], [0.8, 3.0]),
        (SurfaceKind::Splat, [rim, 1.5 * rim], [0.8, 3.0]),
        (SurfaceKind::SplatFit, [4.0 * rim, 6.0 * rim], [3.5, 9.0]),
    ];
    for (kind, depth_bounds, angle_bounds) in bounds {
        let scene = scenes::flat(clouds::sphere(20_000, 1.0), kind);
        // Rays up to 0.7 of the radius are within 45 degrees of the normal.
        let rays: Vec<Ray> = rays_from_above(0.7, 100)
            .into_iter()
            .filter(|ray| ray.origin.truncate().length() < 0.7)
            .collect();
        let (mut depths, mut angles) = (Vec::new(), Vec::new());
        for (ray, hit) in rays.iter().zip(hits(&scene, &rays)) {
            let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
            let true_normal = ray.origin.with_z(height);
            depths.push((hit.distance - (5.0 - height)).abs());
            angles.push(hit.normal.angle_between(true_normal).to_degrees());
        }
        check(kind, "depth", &depths, depth_bounds);
        check(kind, "angle", &angles, angle_bounds);
    }
}

fn check(kind: SurfaceKind, quantity: &str, values: &[f32], [mean_bound, max_bound]: [f32; 2]) {
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    let max = values.iter().copied().fold(0.0, f32::max);
    assert!(
        mean <= mean_bound && max <= max_bound,
        "{}: {quantity} {mean} (at most {max})",
        kind.name()
    );
}

#[test]
fn a_plane_is_flat_and_ends_at_its_outermost_points() {
    for kind in
        [SurfaceKind::Disc, SurfaceKind::SplatMean, SurfaceKind::Splat, SurfaceKind::SplatFit]
    {
        let scene = scenes::flat(clouds::plane(50, 0.3, 4), kind);
        for (ray, hit) in
            rays_from_above(0.95, 60).iter().zip(hits(&scene, &rays_from_above(0.95, 60)))
        {
            assert!((hit.distance - 5.0).abs() < 1e-5, "{kind:?} {ray:?} {hit:?}");
            assert!(1.0 - 1e-6 < hit.normal.z, "{kind:?} {hit:?}");
        }
        // The outermost points are 0.02 from the rim at ±1, plus or minus their jitter.
        let beyond: Vec<Ray> = rays_from_above(1.2, 120)
            .into_iter()
            .filter(|ray| 1.0 < ray.origin.truncate().abs().max_element())
            .collect();
        let n_false = hits(&scene, &beyond).iter().filter(|hit| !hit.is_miss()).count();
        assert_eq!(n_false, 0, "{kind:?}: of {} rays past the rim", beyond.len());
        let open = FlatCloud { edge_test: EdgeTest::Off, ..scene };
        let n_false = hits(&open, &beyond).iter().filter(|hit| !hit.is_miss()).count();
        assert!(
            100 < n_false,
            "{kind:?}: without the edge test discs extend past the rim ({n_false})"
        );
    }
}

/// Horizontal discs near the crossing extend through the vertical plane, and vertical ones through the horizontal
/// plane. The points around such a hit lie in the disc's own plane, so the edge test accepts it. It must reject
/// discs past the ends of the planes.
#[test]
fn crossing_planes_end_where_their_points_end() {
    let scene = scenes::flat(clouds::crossing_planes(50, 0.3, 5), SurfaceKind::Splat);
    let level = hits(&scene, &rays_from_above(0.95, 60));
    for (ray, hit) in rays_from_above(0.95, 60).iter().zip(&level) {
        if 0.15 < ray.origin.x.abs() {
            assert!((hit.distance - 5.0).abs() < 1e-4 && 0.999 < hit.normal.z, "{ray:?} {hit:?}");
        } else {
            assert!(!hit.is_miss(), "a hole beside the crossing: {ray:?}");
        }
    }
    // Rays along X just above the upper end of the vertical plane miss it, and rays just below hit it.
    let along_x = |height: f32| -> Vec<Ray> {
        let ys = (0..50).map(|i| -0.9 + 1.8 * i as f32 / 49.0);
        ys.map(|y| Ray::new(Vec3::new(5.0, y, height), Vec3::NEG_X)).collect()
    };
    assert!(hits(&scene, &along_x(1.01)).iter().all(SurfaceHit::is_miss));
    for hit in hits(&scene, &along_x(0.9)) {
        assert!((hit.distance - 5.0).abs() < 1e-4, "{hit:?}");
    }
}

#[test]
fn the_search_continues_behind_a_rejected_hit() {
    // Past the end of the upper sheet its discs are rejected, and the lower sheet is hit.
    let upper = clouds::plane(40, 0.3, 6);
    let lower = clouds::plane(80, 0.3, 7).positions.into_iter().map(|p| 2.0 * p - Vec3::Z);
    let positions: Vec<Vec3> = upper.positions.iter().copied().chain(lower).collect();
    let scene = scenes::flat(PointCloud::from_positions(positions), SurfaceKind::Splat);
    let rays: Vec<Ray> = rays_from_above(1.3, 130)
        .into_iter()
        .filter(|ray| (1.0..1.1).contains(&ray.origin.truncate().abs().max_element()))
        .collect();
    for (ray, hit) in rays.iter().zip(hits(&scene, &rays)) {
        assert!((hit.distance - 6.0).abs() < 1e-3, "{ray:?} {hit:?}");
    }
}

#[test]
fn aligned_normals_are_exact_where_means_cancel() {
    // The signs of the normals are random: their mean is useless, the mean of aligned normals is exact.
    let cloud = clouds::with_random_signs(clouds::sphere(20_000, 1.0));
    let mean_angle = |kind| {
        let scene = scenes::flat(cloud.clone(), kind);
        let rays = rays_from_above(0.5, 50);
        let angles = rays.iter().zip(hits(&scene, &rays)).map(|(ray, hit)| {
            let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
            hit.normal.angle_between(ray.origin.with_z(height)).to_degrees()
        });
        angles.sum::<f32>() / rays.len() as f32
    };
    let (mean, aligned) = (mean_angle(SurfaceKind::SplatMean), mean_angle(SurfaceKind::Splat));
    assert!(aligned < 0.6 && 4.0 * aligned < mean, "mean {mean}, aligned {aligned}");
}

#[test]
fn a_regular_lattice_has_no_holes() {
    let lattice = (0..900).map(|i| Vec3::new((i % 30) as f32, (i / 30) as f32, 0.0)).collect();
    let scene = scenes::flat(PointCloud::from_positions(lattice), SurfaceKind::Splat);
    // The eyes are straight above, and at a slant, one of them in line with the rows.
    for eye in
        [Vec3::new(14.5, 14.5, 30.0), Vec3::new(14.5, -10.0, 12.0), Vec3::new(40.0, -7.0, 9.0)]
    {
        let targets =
            (0..200 * 200).map(|i| Vec3::new((i % 200) as f32, (i / 200) as f32, 0.0) * 0.14 + 0.5);
        let rays: Vec<Ray> =
            targets.map(|p| Ray::new(eye, (p.with_z(0.0) - eye).normalize())).collect();
        let holes = hits(&scene, &rays).iter().filter(|hit| hit.is_miss()).count();
        assert_eq!(holes, 0, "seen from {eye}, of {}", rays.len());
    }
}

#[test]
fn small_radii_leave_no_holes_if_discs_overlap() {
    // With radii of 0.85 spacings fewer than four points are near a hit, too few for the edge test.
    let mut cloud = clouds::plane(50, 0.1, 12);
    cloud.radii = Some(vec![0.85 * 0.04; cloud.len()]);
    let scene = scenes::flat(cloud, SurfaceKind::Splat);
    let rays = rays_from_above(0.9, 150);
    let holes = hits(&scene, &rays).iter().filter(|hit| hit.is_miss()).count();
    assert_eq!(holes, 0, "of {}", rays.len());
}

#[test]
fn the_scale_of_a_cloud_does_not_matter() {
    let rays = rays_from_above(0.65, 40);
    let scales = |kind| [1e-6, 1.0, 1e6].map(|scale| (kind, scale));
    for (kind, scale) in scenes::FIELD_KINDS.into_iter().flat_map(scales) {
        let mut cloud = clouds::sphere(2000, 1.0);
        cloud.positions.iter_mut().for_each(|position| *position *= scale);
        let flat = scenes::flat(cloud, kind);
        let scaled: Vec<Ray> =
            rays.iter().map(|ray| Ray { origin: scale * ray.origin, ..*ray }).collect();
        for (ray, hit) in rays.iter().zip(hits(&flat, &scaled)) {
            let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
            let distance = hit.distance / scale;
            assert!((distance - (5.0 - height)).abs() < 0.02, "{kind:?} {scale}: {ray:?} {hit:?}");
        }
    }
}

#[test]
fn crowded_discs_occlude_where_the_search_for_the_nearest_hits() {
    let mut cloud = clouds::sphere(3000, 1.0);
    assert!(!scenes::flat(cloud.clone(), SurfaceKind::Splat).is_crowded);
    cloud.radii = Some(vec![0.7; cloud.len()]);
    let flat = scenes::flat(cloud, SurfaceKind::Splat);
    assert!(flat.is_crowded);
    let rays = scenes::random_rays(300, 1.5, 8);
    let mut occluded = vec![false; rays.len()];
    occlusions(&flat, Simd::detect(), &rays, &mut occluded);
    let are_hit: Vec<bool> = hits(&flat, &rays).iter().map(|hit| !hit.is_miss()).collect();
    assert_eq!(occluded, are_hit);
    assert!(are_hit.contains(&true) && are_hit.contains(&false));
}
