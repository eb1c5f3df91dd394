//! The smooth surface: its depth and normals where these are known, and one surface for rays of all kinds.

use crate::rays::hits;
use surfel_core::flat::{FlatCloud, FlatScene};
use surfel_core::math::{Random, Ray, Vec3};
use surfel_core::points::{PointCloud, Preparation, prepare};
use surfel_core::progress::NoProgress;
use surfel_core::scene::{CloudGeometry, Geometry, Material, Scene};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{InstanceFilter, SceneHit, Simd, SurfaceHit, occlusions, scene_hits};
use surfel_tests::clouds;
use surfel_tests::scenes;

#[test]
fn a_sphere_of_points_has_the_depth_and_the_normals_of_a_sphere() {
    let n = 5000;
    let spacing = (4.0 * std::f32::consts::PI / n as f32).sqrt();
    let flat = scenes::flat(clouds::sphere(n, 1.0), SurfaceKind::Smooth);
    let rays: Vec<Ray> = scenes::random_rays(3000, 1.0, 3)
        .into_iter()
        .filter(|ray| 2.0 < ray.origin.length() && ray.t_max == f32::INFINITY)
        .collect();
    let (mut n_hits, mut n_misses) = (0, 0);
    for (ray, hit) in rays.iter().zip(hits(&flat, &rays)) {
        // The distance of the ray from the centre.
        let across = ray.origin.cross(ray.direction).length();
        if 0.98 < across || 0.0 < ray.origin.dot(ray.direction) {
            continue;
        }
        if hit.is_miss() {
            n_misses += 1;
            continue;
        }
        n_hits += 1;
        let position = ray.at(hit.distance);
        assert!((position.length() - 1.0).abs() < 0.02 * spacing, "{}", position.length());
        assert!(hit.normal.angle_between(position.normalize()).to_degrees() < 1.0);
    }
    assert!(1000 < n_hits && n_misses == 0, "{n_hits} {n_misses}");
}

/// Returns rays from a distance of 4 to positions on the faces of the cube of side 2, from `inset` to 0.15 within an edge.
fn rays_to_edges(n: usize, inset: f32) -> Vec<Ray> {
    let mut random = Random::new(5, 0);
    let ray = |i: usize| {
        let [along, across, x, y, z]: [f32; 5] = std::array::from_fn(|_| random.next_f32());
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let max = 1.0 - inset;
        let across = side * (max - (max - 0.85) * across);
        let target = Vec3::new(max * (2.0 * along - 1.0), across, 1.0);
        let toward = Vec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, 0.5 + z).normalize();
        let turn = |p: Vec3| match i % 3 {
            0 => p,
            1 => Vec3::new(p.z, p.x, p.y),
            _ => Vec3::new(p.y, p.z, p.x),
        };
        Ray::new(turn(target + 4.0 * toward), -turn(toward))
    };
    (0..n).map(ray).collect()
}

#[test]
fn edges_with_points_on_them_are_closed() {
    // Fields round edges off.
    let kinds = [
        (SurfaceKind::Smooth, 0.02, 0.05),
        (SurfaceKind::Implicit, 0.1, 0.1),
        (SurfaceKind::Octree, 0.1, 0.1),
    ];
    for (kind, inset, max_error) in kinds {
        let flat = scenes::flat(clouds::cube_with_edges(41), kind);
        let rays = rays_to_edges(3000, inset);
        let is_wrong = |hit: &SurfaceHit| hit.is_miss() || max_error < (hit.distance - 4.0).abs();
        let n_wrong = hits(&flat, &rays).iter().filter(|hit| is_wrong(hit)).count();
        assert_eq!(n_wrong, 0, "{kind:?}");
    }
}

#[test]
fn what_a_camera_ray_hits_also_occludes_it() {
    let mut cloud = clouds::cube(24, 0.4, 11);
    cloud.normals = None;
    let flat = scenes::flat(cloud, SurfaceKind::Smooth);
    let rays = scenes::random_rays(4000, 1.5, 8);
    let mut occluded = vec![false; rays.len()];
    occlusions(&flat, Simd::detect(), &rays, &mut occluded);
    let found = hits(&flat, &rays);
    let n_hits = found.iter().filter(|hit| !hit.is_miss()).count();
    let differs = |(hit, occluded): &(&SurfaceHit, &bool)| hit.is_miss() == **occluded;
    let n_different = found.iter().zip(&occluded).filter(differs).count();
    // A camera ray skips discs close behind a rejected one, which an occlusion test may judge.
    assert!(1000 < n_hits && n_different * 200 < rays.len(), "{n_different} of {n_hits}");
}

#[test]
fn lines_and_scattered_points_are_seen_and_occlude() {
    let wire: Vec<Vec3> = (0..400).map(|i| Vec3::new(0.0, 0.01 * i as f32 - 2.0, 1.0)).collect();
    let mut positions = clouds::plane(60, 0.4, 1).positions;
    positions.extend(wire);
    let cloud = PointCloud::from_positions(positions);
    let (cloud, report) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
    assert!(350 < report.structure.unwrap().n_lines);
    let flat =
        FlatCloud::new(&CloudGeometry::with_uniform_color(cloud, [200; 3]), &NoProgress).unwrap();
    let rays: Vec<Ray> =
        (0..100).map(|i| Ray::new(Vec3::new(3.0, 0.017 * i as f32 - 0.8, 1.0), -Vec3::X)).collect();
    let found = hits(&flat, &rays);
    assert!(found.iter().all(|hit| hit.surface == SurfaceKind::Capsule), "{:?}", found[0]);
    assert!(found.iter().all(|hit| (hit.distance - 3.0).abs() < 0.02));
    let mut occluded = vec![false; rays.len()];
    occlusions(&flat, Simd::detect(), &rays, &mut occluded);
    assert!(occluded.iter().all(|occluded| *occluded));
}

#[test]
fn classes_are_not_blended() {
    let cloud = clouds::plane(40, 0.4, 1);
    let mut points = scenes::points(cloud, SurfaceKind::Smooth);
    let colors = points.cloud().positions().iter();
    let colors = colors.map(|p| if p.x < 0.0 { [255, 0, 0] } else { [0, 0, 255] }).collect();
    points = scenes::colored(&points, colors);
    points.blends_colors = false;
    let flat = FlatCloud::new(&points, &NoProgress).unwrap();
    let bounds = points.cloud().bounds();
    let across = |i: usize| Vec3::new(0.002 * i as f32 - 0.2, 0.1, bounds.max.z + 3.0);
    let rays: Vec<Ray> = (0..200).map(|i| Ray::new(across(i), -Vec3::Z)).collect();
    let found = hits(&flat, &rays);
    assert!(found.iter().all(|hit| !hit.is_miss()));
    assert!(found.iter().all(|hit| hit.color == Vec3::X || hit.color == Vec3::Z));
}

#[test]
fn small_points_near_a_wide_disc_do_not_colour_it() {
    let mut cloud = PointCloud::default();
    let (mut radii, mut colors) = (Vec::new(), Vec::new());
    for (x, y) in (-4..4).flat_map(|x| (-4..4).map(move |y| (x as f32, y as f32))) {
        cloud.positions.extend([Vec3::new(x, y, 0.0), Vec3::new(x + 0.5, y + 0.5, -0.3)]);
        radii.extend([1.5, 0.02]);
        colors.extend([[255, 0, 0], [0, 0, 255]]);
    }
    cloud.normals = Some(vec![Vec3::Z; radii.len()]);
    cloud.radii = Some(radii);
    let mut points = scenes::colored(&scenes::points(cloud, SurfaceKind::Smooth), colors);
    for blends_colors in [false, true] {
        points.blends_colors = blends_colors;
        let flat = FlatCloud::new(&points, &NoProgress).unwrap();
        let ray = |i: usize| Ray::new(Vec3::new(0.01 * i as f32 - 1.0, 0.5, 3.0), -Vec3::Z);
        let rays: Vec<Ray> = (0..200).map(ray).collect();
        for hit in hits(&flat, &rays) {
            assert!(hit.color.distance(Vec3::X) < 1e-6, "{hit:?}");
        }
    }
}

/// Distance between the points of `sheet_with_slit`.
const SLIT_SPACING: f32 = 0.05;

/// Returns a sheet of points at Z = 0 that faces up, with a slit along Y at X = 0, and with `has_back` a sheet at Z = -1
/// that faces down.
fn sheet_with_slit(width: f32, has_back: bool) -> CloudGeometry {
    let mut cloud = PointCloud::default();
    let (mut normals, mut radii) = (Vec::new(), Vec::new());
    let mut add = |x: f32, y: i32, height: f32, normal: Vec3| {
        cloud.positions.push(Vec3::new(x, y as f32 * SLIT_SPACING, height));
        normals.push(normal);
        radii.push(1.5 * SLIT_SPACING);
    };
    for (x, y) in (0..20).flat_map(|x| (-20..=20).map(move |y| (x as f32 * SLIT_SPACING, y))) {
        add(-x, y, 0.0, Vec3::Z);
        add(width + x, y, 0.0, Vec3::Z);
        if has_back {
            add(-x, y, -1.0, -Vec3::Z);
            add(x + SLIT_SPACING, y, -1.0, -Vec3::Z);
        }
    }
    (cloud.normals, cloud.radii) = (Some(normals), Some(radii));
    scenes::points(cloud, SurfaceKind::Smooth)
}

/// Returns the heights at which rays straight down at `x` end.
fn heights_at(sheet: &CloudGeometry, x: f32) -> Vec<f32> {
    let flat = FlatCloud::new(sheet, &NoProgress).unwrap();
    let ray = |i: i32| Ray::new(Vec3::new(x, 0.001 * i as f32, 3.0), -Vec3::Z);
    let rays: Vec<Ray> = (-200..200).map(ray).collect();
    hits(&flat, &rays).iter().map(|hit| 3.0 - hit.distance).collect()
}

#[test]
fn rays_end_at_slits_where_front_sides_are_known() {
    // The points on the other side of the slit are too far away to enclose a hit.
    let width = 0.25;
    let in_slit = 1.2 * SLIT_SPACING;
    let mut sheet = sheet_with_slit(width, true);
    let through = heights_at(&sheet, in_slit);
    assert!(through.iter().all(|z| (z + 1.0).abs() < 0.01), "{through:?}");
    sheet.has_front_sides = true;
    let closed = heights_at(&sheet, in_slit);
    assert!(closed.iter().all(|z| z.abs() < 0.01), "{closed:?}");
    let aslant = Vec3::new(0.0, 1.8, -1.0);
    let ray = |i: i32| {
        let in_sheet = Vec3::new(in_slit, -0.9 + 0.0002 * i as f32, 0.0);
        Ray::new(in_sheet - aslant, aslant)
    };
    let rays: Vec<Ray> = (-200..200).map(ray).collect();
    let flat = FlatCloud::new(&sheet, &NoProgress).unwrap();
    let closed = hits(&flat, &rays);
    assert!(closed.iter().all(|hit| (hit.distance - 1.0).abs() < 0.01), "{closed:?}");
    let beyond = heights_at(&sheet, 20.2 * SLIT_SPACING + width);
    assert!(beyond.iter().all(|z| *z == f32::NEG_INFINITY), "{beyond:?}");
    // Nothing lies behind the slit of a single sheet, which may be its true edge.
    let mut single = sheet_with_slit(width, false);
    single.has_front_sides = true;
    let through = heights_at(&single, in_slit);
    assert!(through.iter().all(|z| *z == f32::NEG_INFINITY), "{through:?}");
}

#[test]
fn slits_close_before_whatever_else_is_behind_them() {
    let mut sheet = sheet_with_slit(0.25, true);
    sheet.has_front_sides = true;
    let between = scenes::floor(-0.5, 1.0);
    let mut geometries = vec![
        (Geometry::Points(sheet.clone()), Material::MATTE),
        (Geometry::Triangles(between), Material::MATTE),
    ];
    for _ in 0..2 {
        geometries.reverse();
        let graph = scenes::graph(geometries.clone());
        let flat =
            FlatScene::new(&Scene { graph, ..scenes::lit(sheet.clone()) }, &NoProgress).unwrap();
        let x = 1.2 * SLIT_SPACING;
        let ray = |i: i32| Ray::new(Vec3::new(x, 0.001 * i as f32, 3.0), -Vec3::Z);
        let rays: Vec<Ray> = (-100..100).map(ray).collect();
        let mut hits = vec![SceneHit::MISS; rays.len()];
        scene_hits(&flat, Simd::detect(), InstanceFilter::All, &rays, &mut hits);
        assert!(hits.iter().all(|hit| (hit.distance - 3.0).abs() < 0.01), "{:?}", hits[0]);
    }
}

#[test]
fn rays_end_in_corners_whose_points_leave_a_gap() {
    // A floor and a wall with front sides unknown; each ends before the corner along Y at X = Z = 0.
    let gap = 1.3 * SLIT_SPACING;
    let mut cloud = PointCloud::default();
    let (mut normals, mut radii) = (Vec::new(), Vec::new());
    for (i, y) in (0..20).flat_map(|i| (-20..=20).map(move |y| (i as f32 * SLIT_SPACING, y))) {
        let y = y as f32 * SLIT_SPACING;
        cloud.positions.extend([Vec3::new(gap + i, y, 0.0), Vec3::new(0.0, y, gap + i)]);
        normals.extend([Vec3::Z, Vec3::X]);
        radii.extend([1.6 * SLIT_SPACING; 2]);
    }
    (cloud.normals, cloud.radii) = (Some(normals), Some(radii));
    let flat = FlatCloud::new(&scenes::points(cloud, SurfaceKind::Smooth), &NoProgress).unwrap();
    let ends = |direction: Vec3| {
        let ray = |i: i32| Ray::new(Vec3::new(0.0, 0.001 * i as f32, 0.0) - direction, direction);
        let rays: Vec<Ray> = (-200..200).map(ray).collect();
        hits(&flat, &rays).iter().map(|hit| hit.distance).collect::<Vec<f32>>()
    };
    let into_corner = ends(Vec3::new(-1.0, 0.0, -1.0).normalize());
    assert!(into_corner.iter().all(|distance| (distance - 1.0).abs() < gap), "{into_corner:?}");
    let beside_the_rims = ends(Vec3::new(-1.0, 0.0, 1.0).normalize());
    assert!(
        beside_the_rims.iter().all(|distance| *distance == f32::INFINITY),
        "{beside_the_rims:?}"
    );
}
