//! All paths that a batch may take through the tree, against brute force at every SIMD level: whole and partial
//! packets, packets whose rays end in one place, and interleaved single rays.

use crate::bad_clouds;
use crate::batches::trace_surface;
use crate::brute_force::BruteForce;
use crate::rays::{
    self, TILE, axes_and_normals, camera_rays, degenerate_rays, incoherent_rays, non_finite_rays,
    shadow_rays, some_slots,
};
use crate::searches;
use std::path::Path;
use surfel_core::flat::FlatCloud;
use surfel_core::math::{Random, Ray, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{Hit, Simd};
use surfel_formats::{LoadOptions, load};
use surfel_tests::clouds;
use surfel_tests::ground_truth::GroundTruth;
use surfel_tests::scenes;
use surfel_tests::shared_data::shared_data;

#[test]
fn all_paths_find_the_same_hits_in_sound_clouds() {
    let more = [
        ("cube", clouds::cube(12, 0.3, 5)),
        ("even cube", clouds::cube(8, 0.0, 5)),
        ("sphere of more discs than rays", clouds::sphere(20_000, 1.0)),
    ];
    for (name, cloud) in searches::test_clouds().into_iter().chain(more) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::SplatFit] {
            check_paths(name, &scenes::flat(cloud.clone(), kind), 8);
        }
    }
}

#[test]
fn all_paths_find_the_same_hits_in_bad_clouds() {
    for (name, cloud) in bad_clouds::bad_clouds().into_iter().take(6) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            check_paths(name, &bad_clouds::flat(cloud.clone(), kind), 4);
        }
    }
}

/// Overflow may hide hits, but each search ends, and each hit that it finds is in the ray's range.
#[test]
fn searches_end_where_numbers_overflow() {
    for (name, cloud) in bad_clouds::bad_clouds().into_iter().skip(6) {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let flat = bad_clouds::flat(cloud.clone(), kind);
            let finite = [camera_rays(&flat, 8), degenerate_rays(&flat)].concat();
            let non_finite = non_finite_rays(Ray::new(Vec3::X, -Vec3::X));
            let rays = [&finite[..], &non_finite].concat();
            for simd in Simd::available() {
                let found = trace_surface(&flat, simd, &rays);
                for (ray, (hit, _)) in rays.iter().zip(&found) {
                    let is_in_range = ray.t_min <= hit.distance && hit.distance <= ray.t_max;
                    let is_sound = is_in_range && (hit.id as usize) < cloud.len();
                    assert!(hit.is_miss() || is_sound, "{name}, {kind:?}: {hit:?} of {ray:?}");
                }
                let mut of_non_finite = found[finite.len()..].iter();
                assert!(of_non_finite.all(|(hit, is_occluded)| hit.is_miss() && !is_occluded));
            }
        }
    }
}

#[test]
fn all_paths_find_the_same_hits_in_real_clouds() {
    let Some(data) = shared_data() else { return };
    let bunny = GroundTruth::from_file(&data.join("meshes/bun_zipper.ply")).vertices;
    let scan = loaded(&data.join("clouds/sample_c.las"));
    for (name, cloud) in [("bunny", PointCloud::from_positions(bunny)), ("scan", scan)] {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Splat] {
            check_paths(name, &scenes::flat(cloud.clone(), kind), 4);
        }
    }
}

fn loaded(path: &Path) -> PointCloud {
    load(path, &LoadOptions::default(), &surfel_core::progress::NoProgress).unwrap().cloud
}

/// Compares camera rays, shadow rays from their hits, and incoherent rays with brute force: in tiles, in parts
/// of tiles, shuffled, in shuffled tiles, and with single incoherent rays among coherent ones.
fn check_paths(name: &str, scene: &FlatCloud, n_tiles: usize) {
    let camera = BruteForce::new(scene, camera_rays(scene, n_tiles));
    let shadow = shadow_rays(scene, &camera);
    let rays = [camera.rays, shadow, incoherent_rays(scene, n_tiles * TILE)].concat();
    let plain = BruteForce::new(scene, rays);
    let n = plain.rays.len();
    let in_order: Vec<usize> = (0..n).collect();
    let shuffled = rays::shuffled(in_order.clone());
    let tiles = in_order.chunks(TILE).map(<[usize]>::to_vec).collect();
    let tiles = rays::shuffled(tiles).concat();
    // Finite and infinite ranges are mixed by `finite_and_infinite_ranges_may_share_a_packet`.
    let ends = |i: usize| plain.rays[i].t_max.is_finite();
    let with_strays = tiles.iter().zip(&shuffled).enumerate().map(|(position, (&i, &stray))| {
        if position % 37 == 5 && ends(i) == ends(stray) { stray } else { i }
    });
    let lens: Vec<usize> = (1..=40).collect();
    plain.check(&format!("{name} in tiles"), &in_order, &[TILE]);
    plain.check(&format!("{name} in parts of tiles"), &in_order, &lens);
    plain.check(&format!("{name} shuffled"), &shuffled, &[1, 31, 32, 33, 1000]);
    plain.check(&format!("{name} in shuffled tiles"), &tiles, &[1000]);
    plain.check(&format!("{name} with strays"), &with_strays.collect::<Vec<_>>(), &[1000]);
}

#[test]
fn all_paths_agree_on_degenerate_rays() {
    for (name, cloud) in [
        ("one point", clouds::sphere(1, 1.0)),
        ("sphere", clouds::sphere(300, 1.0)),
        ("even plane", clouds::plane(12, 0.0, 1)),
        ("crossing planes", clouds::crossing_planes(12, 0.4, 2)),
        ("even cube", clouds::cube(4, 0.0, 5)),
        ("line", clouds::line(50)),
    ] {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(cloud.clone(), kind);
            let (ending, endless): (Vec<Ray>, Vec<Ray>) =
                degenerate_rays(&scene).into_iter().partition(|ray| ray.t_max.is_finite());
            for rays in [ending, endless] {
                check_degenerate(name, &BruteForce::new(&scene, rays));
            }
        }
    }
}

/// Compares rays with brute force: each in a packet of sixteen copies, all in order, and shuffled.
fn check_degenerate(name: &str, plain: &BruteForce) {
    let n = plain.rays.len();
    let in_order: Vec<usize> = (0..n).collect();
    let copied: Vec<usize> = (0..n).flat_map(|i| [i; TILE]).collect();
    plain.check(&format!("{name} copied"), &copied, &[TILE]);
    plain.check(&format!("{name} in order"), &in_order, &[n]);
    plain.check(&format!("{name} shuffled"), &rays::shuffled(in_order), &[1, 5, 33]);
}

#[test]
fn a_degenerate_ray_does_not_change_others_of_its_packet() {
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
        let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
        check_strays(&scene, degenerate_rays(&scene));
    }
}

/// Compares packets of coherent rays, one of which is replaced by each of `strays`, with brute force.
fn check_strays(scene: &FlatCloud, strays: Vec<Ray>) {
    let n_tiles = 4;
    let first = n_tiles * TILE;
    let plain = BruteForce::new(scene, [camera_rays(scene, n_tiles), strays].concat());
    let tile = |stray: usize| {
        let stray_lane = 1 + stray % (TILE - 1);
        let first = stray % n_tiles * TILE;
        (0..TILE).map(move |lane| if lane == stray_lane { stray } else { first + lane })
    };
    let order: Vec<usize> = (first..plain.rays.len()).flat_map(tile).collect();
    plain.check("one degenerate", &order, &[TILE]);
}

#[test]
fn non_finite_rays_hit_nothing() {
    for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
        let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
        let plain = BruteForce::new(&scene, non_finite_rays(Ray::new(3.0 * Vec3::X, -Vec3::X)));
        assert!(plain.closest.iter().all(Hit::is_miss));
        check_degenerate("not finite", &plain);
    }
}

/// Ties are everywhere: discs lie in one plane, spheres touch, rays go through corners and along planes.
#[test]
fn all_paths_agree_on_small_grids() {
    let rays = grid_rays(BESIDE_PLANES);
    for n in 1..=17 {
        for draw in 0..3u64 {
            let cloud = grid_points(n, draw);
            for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
                let scene = bad_clouds::flat(cloud.clone(), kind);
                check_grid(&format!("{n} points, draw {draw}"), &scene, &rays);
            }
        }
    }
}

/// Covers every cloud whose points are corners of one cube.
#[test]
fn all_paths_agree_on_the_corners_of_a_cube() {
    let rays: Vec<Ray> = grid_rays(BESIDE_PLANES).into_iter().step_by(7).collect();
    for set in 1..256u32 {
        let corners = (0..8u32).filter(|corner| set >> corner & 1 == 1);
        let positions: Vec<Vec3> = corners.map(|i| grid_corner(i as usize, 2)).collect();
        let normals = (0..positions.len()).map(|i| Vec3::AXES[(i + set as usize) % 3]);
        let cloud = PointCloud {
            normals: Some(normals.collect()),
            radii: Some(vec![0.5 + 0.5 * (set % 3) as f32; positions.len()]),
            ..PointCloud::from_positions(positions)
        };
        let kind = [SurfaceKind::Sphere, SurfaceKind::Disc][set as usize % 2];
        check_grid(&format!("corners {set:b}"), &bad_clouds::flat(cloud, kind), &rays);
    }
}

fn check_grid(name: &str, scene: &FlatCloud, rays: &[Ray]) {
    let plain = BruteForce::new(scene, rays.to_vec());
    plain.check_in_order(name);
    let shuffled = rays::shuffled((0..rays.len()).collect());
    plain.check(name, &shuffled, &[rays.len()]);
}

fn grid_corner(i: usize, n_side: usize) -> Vec3 {
    Vec3::new((i % n_side) as f32, (i / n_side % n_side) as f32, (i / n_side / n_side) as f32)
}

/// Returns a cloud of distinct points of a 3 x 3 x 3 grid with normals along axes and radii of 0.5, 1 or 1.5.
fn grid_points(n: usize, draw: u64) -> PointCloud {
    let mut random = Random::new(53, draw);
    let mut positions: Vec<Vec3> = (0..27).map(|i| grid_corner(i, 3)).collect();
    for i in 0..n {
        positions.swap(i, i + random.below(27 - i as u64) as usize);
    }
    positions.truncate(n);
    let normals = positions.iter().map(|_| Vec3::AXES[random.below(3) as usize]).collect();
    let radii = positions.iter().map(|_| 0.5 * (1 + random.below(3)) as f32).collect();
    PointCloud {
        normals: Some(normals),
        radii: Some(radii),
        ..PointCloud::from_positions(positions)
    }
}

/// Coordinates of ray origins that lie in no disc's plane.
const BESIDE_PLANES: [f32; 4] = [-1.0, 0.25, 0.5, 3.0];

/// Returns rays from points in and around the grid in the directions of a cube's faces, edges and corners;
/// sixteen neighbouring origins share a direction.
fn grid_rays(along: [f32; 4]) -> Vec<Ray> {
    let directions = (0..27).filter(|&i| i != 13).map(|i| grid_corner(i, 3) - Vec3::ONE);
    let origin = move |i: usize| Vec3::new(along[i % 4], along[i / 4 % 4], along[i / 16]);
    let from_everywhere =
        move |direction: Vec3| (0..64).map(move |i| Ray::new(origin(i), direction.normalize()));
    directions.flat_map(from_everywhere).collect()
}

/// Regression tests of cases that once failed.
mod known {
    use super::*;

    #[test]
    fn a_disc_that_the_ray_starts_on_is_hit_at_zero() {
        let rays = grid_rays([-1.0, 0.0, 0.5, 2.0]);
        for n in 1..=17 {
            check_grid(
                &format!("{n} points"),
                &bad_clouds::flat(grid_points(n, 1), SurfaceKind::Disc),
                &rays,
            );
        }
    }

    #[test]
    fn a_ray_that_starts_on_several_discs_hits_the_one_in_the_lowest_slot() {
        let scene = scenes::flat(clouds::plane(12, 0.0, 1), SurfaceKind::Disc);
        let from_centers = some_slots(&scene).into_iter().flat_map(|slot| {
            let center = scene.points.center(slot);
            axes_and_normals(Vec3::Z).into_iter().map(move |direction| Ray::new(center, direction))
        });
        check_degenerate("from centres", &BruteForce::new(&scene, from_centers.collect()));
    }

    #[test]
    fn a_range_may_end_at_negative_zero() {
        let scene = scenes::flat(clouds::sphere(300, 1.0), SurfaceKind::Sphere);
        let rays = camera_rays(&scene, 2).into_iter().map(|ray| {
            let origin = ray.at(0.9 * ray.origin.length());
            Ray { origin, t_max: -0.0, ..ray }
        });
        check_degenerate("-0.0", &BruteForce::new(&scene, rays.collect()));
    }

    #[test]
    fn finite_and_infinite_ranges_may_share_a_packet() {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
            for end in [f32::INFINITY, f32::MAX] {
                let rays = camera_rays(&scene, 4).into_iter().enumerate();
                let rays = rays
                    .map(|(i, ray)| Ray { t_max: if i % TILE == 3 { end } else { 9.0 }, ..ray });
                BruteForce::new(&scene, rays.collect()).check_in_order(&format!("{end}"));
            }
        }
    }

    #[test]
    fn a_non_finite_ray_does_not_change_others_of_its_packet() {
        for kind in [SurfaceKind::Sphere, SurfaceKind::Disc] {
            let scene = scenes::flat(clouds::sphere(300, 1.0), kind);
            check_strays(&scene, non_finite_rays(Ray::new(3.0 * Vec3::X, -Vec3::X)));
            // These go in the direction of the other rays.
            let strays = camera_rays(&scene, 4).into_iter().flat_map(non_finite_rays);
            check_strays(&scene, strays.collect());
        }
    }
}
