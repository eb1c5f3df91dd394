//! Octrees whose cells hold the surface: known answers, depths, and clouds that are hard on them.

use crate::bad_clouds;
use crate::implicit::sheets;
use crate::rays::{hits, rays_from_above};
use std::sync::Mutex;
use surfel_core::flat::{FlatCloud, Octree, OctreeOptions};
use surfel_core::math::{Ray, Vec3};
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::scene::CloudGeometry;
use surfel_core::surface::{OctreeDepth, SurfaceKind};
use surfel_core::trace::{Simd, SurfaceHit, occlusions};
use surfel_tests::clouds;
use surfel_tests::scenes;

const KINDS: [SurfaceKind; 2] = [SurfaceKind::Octree, SurfaceKind::OctreeSplat];

#[test]
fn a_sphere_has_its_depth_and_its_normals() {
    for kind in KINDS {
        let flat = scenes::flat(clouds::sphere(20_000, 1.0), kind);
        let rays = rays_from_above(0.65, 80);
        for (ray, hit) in rays.iter().zip(hits(&flat, &rays)) {
            let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
            // Cells are 0.025 wide.
            assert!((hit.distance - (5.0 - height)).abs() < 2e-3, "{kind:?}: {ray:?} {hit:?}");
            let angle = hit.normal.angle_between(ray.origin.with_z(height)).to_degrees();
            assert!(angle < 2.0, "{kind:?}: {angle}");
        }
    }
}

#[test]
fn a_plane_is_flat_and_ends_at_its_outermost_points() {
    for kind in KINDS {
        let flat = scenes::flat(clouds::plane(50, 0.3, 4), kind);
        for hit in hits(&flat, &rays_from_above(0.9, 60)) {
            assert!(
                (hit.distance - 5.0).abs() < 1e-4 && 0.9999 < hit.normal.z,
                "{kind:?}: {hit:?}"
            );
        }
        // The outermost points are at 0.98 and cells 0.04 wide.
        let beyond = rays_from_above(1.2, 120).into_iter();
        let beyond: Vec<Ray> =
            beyond.filter(|ray| 1.05 < ray.origin.truncate().abs().max_element()).collect();
        assert!(hits(&flat, &beyond).iter().all(SurfaceHit::is_miss), "{kind:?}");
    }
}

#[test]
fn crossing_planes_stay_planes_away_from_the_crossing() {
    for kind in KINDS {
        let flat = scenes::flat(clouds::crossing_planes(50, 0.3, 5), kind);
        let rays = rays_from_above(0.9, 60);
        for (ray, hit) in rays.iter().zip(hits(&flat, &rays)) {
            if 0.2 < ray.origin.x.abs() {
                assert!((hit.distance - 5.0).abs() < 1e-3, "{kind:?}: {ray:?} {hit:?}");
            }
        }
    }
}

#[test]
fn a_cube_is_flat_and_closed() {
    for kind in KINDS {
        let flat = scenes::flat(clouds::cube(40, 0.3, 3), kind);
        for hit in hits(&flat, &rays_from_above(0.85, 60)) {
            assert!((hit.distance - 4.0).abs() < 1e-3 && 0.999 < hit.normal.z, "{kind:?}: {hit:?}");
        }
        let rays = scenes::random_rays(3000, 0.9, 4).into_iter();
        let cube = surfel_core::math::Aabb { min: -0.9 * Vec3::ONE, max: 0.9 * Vec3::ONE };
        let is_through = |ray: &Ray| ray.t_max.is_infinite() && 0.1 < cube.length_along(ray);
        let rays: Vec<Ray> = rays.filter(is_through).collect();
        let n_misses = hits(&flat, &rays).iter().filter(|hit| hit.is_miss()).count();
        assert!(5 * n_misses <= rays.len() / 1000, "{kind:?}: {n_misses} of {}", rays.len());
    }
}

#[test]
fn sheets_are_apart_beyond_the_reach_of_their_points_and_merge_below() {
    // The reach is 0.096, and cells are 0.04 wide: between sheets that are closer, one cell has the field of both.
    for (kind, gap) in KINDS.into_iter().flat_map(|kind| [(kind, 0.16), (kind, 0.07)]) {
        let flat = FlatCloud::new(&sheets(gap, kind), &NoProgress).unwrap();
        let rays = rays_from_above(0.85, 60);
        let upper = hits(&flat, &rays);
        if gap < 0.096 {
            let is_between = |hit: &SurfaceHit| (4.98..5.02 + gap).contains(&hit.distance);
            assert!(upper.iter().all(is_between), "{kind:?}");
            continue;
        }
        assert!(upper.iter().all(|hit| (hit.distance - 5.0).abs() < 1e-3), "{kind:?}");
        let behind = |(ray, hit): (&Ray, &SurfaceHit)| Ray { t_min: hit.distance + 0.05, ..*ray };
        let behind: Vec<Ray> = rays.iter().zip(&upper).map(behind).collect();
        for hit in hits(&flat, &behind) {
            assert!((hit.distance - 5.0 - gap).abs() < 1e-3, "{kind:?} {hit:?}");
        }
    }
}

#[test]
fn what_a_camera_ray_hits_also_occludes_it() {
    for kind in KINDS {
        let flat = scenes::flat(clouds::cube(24, 0.4, 11), kind);
        let rays = scenes::random_rays(4000, 1.5, 8);
        let mut occluded = vec![false; rays.len()];
        occlusions(&flat, Simd::detect(), &rays, &mut occluded);
        let is_hit: Vec<bool> = hits(&flat, &rays).iter().map(|hit| !hit.is_miss()).collect();
        let n_hits = is_hit.iter().filter(|is_hit| **is_hit).count();
        assert!(400 < n_hits, "{kind:?}: {n_hits}");
        assert_eq!(is_hit, occluded);
    }
}

#[test]
fn a_given_depth_gives_cells_of_that_size() {
    for kind in KINDS {
        let mut points = scenes::points(clouds::sphere(20_000, 1.0), kind);
        let mut last_error = f32::INFINITY;
        for depth in [3, 4, 5] {
            points.octree_depth = OctreeDepth::Levels(depth);
            let flat = FlatCloud::new(&points, &NoProgress).unwrap();
            assert_eq!(flat.octree.depth(), depth as usize);
            let rays = rays_from_above(0.6, 40);
            let errors = rays.iter().zip(hits(&flat, &rays)).map(|(ray, hit)| {
                let height = (1.0 - ray.origin.truncate().length_squared()).sqrt();
                assert!(!hit.is_miss(), "{kind:?} at depth {depth}: {ray:?}");
                (hit.distance - (5.0 - height)).abs()
            });
            let error = errors.fold(0.0, f32::max);
            assert!(error < 0.7 * last_error, "{kind:?} at depth {depth}: {error}");
            last_error = error;
        }
    }
}

/// Keeps warnings.
#[derive(Default)]
struct Warnings(Mutex<Vec<String>>);

impl Progress for Warnings {
    fn warning(&self, line: &str, _keys: &[&str]) {
        self.0.lock().unwrap().push(line.to_owned());
    }
}

#[test]
fn levels_that_take_too_much_memory_are_reported() {
    for kind in KINDS {
        let mut points = scenes::points(clouds::sphere(2000, 1.0), kind);
        let warnings_at = |points: &CloudGeometry| {
            let warnings = Warnings::default();
            FlatCloud::new(points, &warnings).unwrap();
            warnings.0.into_inner().unwrap()
        };
        points.octree_depth = OctreeDepth::Levels(4);
        assert_eq!(warnings_at(&points), [] as [String; 0]);
        points.octree_depth = OctreeDepth::Levels(14);
        let lines = warnings_at(&points);
        assert!(lines.len() == 1 && lines[0].contains("more take too much memory"), "{lines:?}");
    }
}

#[test]
fn octrees_of_bad_clouds_have_bounded_size_and_depth() {
    for (name, cloud) in bad_clouds::bad_clouds() {
        let n = cloud.len();
        let rays = bad_clouds::rays_toward(&cloud, 20);
        for (kind, depth) in KINDS
            .into_iter()
            .flat_map(|kind| [OctreeDepth::Auto, OctreeDepth::Levels(6)].map(|depth| (kind, depth)))
        {
            let mut flat = bad_clouds::flat(cloud.clone(), kind);
            let options = OctreeOptions {
                has_corners: kind == SurfaceKind::Octree,
                depth,
                has_edge_test: true,
                has_sides: false,
            };
            flat.octree = Octree::new(&flat.points, &options, &NoProgress).unwrap().into();
            assert!(flat.octree.bytes() <= 192 * n + 10_000, "{name}: {}", flat.octree.bytes());
            let found = hits(&flat, &rays);
            assert!(found.iter().all(|hit| hit.is_miss() || hit.distance.is_finite()), "{name}");
        }
    }
}
