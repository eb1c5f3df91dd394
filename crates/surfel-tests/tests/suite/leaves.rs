//! Scattered points as clusters of leaves: fast searches against brute force, in packets and as single rays.

use crate::materials::{SETTINGS, WHITE_SKY, rgb, scene};
use std::collections::BTreeMap;
use surfel_core::flat::{FlatCloud, FlatGeometry, FlatPoints, FlatScene};
use surfel_core::math::{DAffine3, DVec3, LaneMask, Lanes, PortableLanes, Random, Ray, Vec3};
use surfel_core::points::Structure;
use surfel_core::progress::NoProgress;
use surfel_core::render::Settings;
use surfel_core::scene::{Clip, ClipPlane, CloudGeometry, Geometry, Graph, Light, Material, Morph};
use surfel_core::surface::{Leaves, RayLanes, Shape, SurfaceKind};
use surfel_core::trace::{Simd, SurfaceHit, occlusions, surface_hits};
use surfel_tests::clouds;
use surfel_tests::scenes;

/// Returns ground with a crown above it, which is classified as vegetation.
pub fn tree() -> CloudGeometry {
    let mut cloud = clouds::plane(40, 0.1, 1);
    let n_ground = cloud.len();
    let mut random = Random::new(7, 0);
    let mut within = || Vec3::from_array(std::array::from_fn(|_| random.next_f32() - 0.5));
    cloud.positions.extend((0..900).map(|_| within() + 0.8 * Vec3::Z));
    let n_points = cloud.len();
    let is_ground = |i: &usize| *i < n_ground;
    let structure = |i| if is_ground(&i) { Structure::Surface } else { Structure::Scatter };
    cloud.set_structures(&(0..n_points).map(structure).collect::<Vec<_>>());
    cloud.normals = Some(vec![Vec3::Z; n_points]);
    cloud.radii = Some((0..n_points).map(|i| if is_ground(&i) { 0.1 } else { 0.04 }).collect());
    cloud.classification = Some((0..n_points).map(|i| if is_ground(&i) { 2 } else { 5 }).collect());
    let mut tree = scenes::grey(cloud);
    tree.surface = SurfaceKind::Smooth;
    tree
}

/// Returns the nearest hit of a ray on all leaves: its distance and slot.
fn nearest_leaf(flat: &FlatCloud, ray: &Ray) -> Option<(f32, u32)> {
    let mut nearest: Option<(f32, u32)> = None;
    for (block_idx, block) in flat.scatter.blocks.iter().enumerate() {
        let points = block.points::<PortableLanes>(ray.origin);
        let (distances, is_hit) = Leaves::intersect(&points, &RayLanes::new(ray));
        let lanes = is_hit.bits() & u32::from(block.occupied_lanes());
        for lane in (0..8).filter(|lane| lanes >> lane & 1 == 1) {
            let found = (distances.store()[lane], (8 * block_idx + lane) as u32);
            if found.0 <= ray.t_max && nearest.is_none_or(|nearest| found < nearest) {
                nearest = Some(found);
            }
        }
    }
    nearest
}

#[test]
fn all_searches_find_the_nearest_leaf_before_the_ground() {
    let mut flat = FlatCloud::new(&tree(), &NoProgress).unwrap();
    assert_eq!(flat.scatter_kind(), SurfaceKind::Leaves);
    let side = |i: usize| (i % 64) as f32 / 64.0 - 0.5;
    let target = |i: usize| Vec3::new(side(i), side(i / 64), 0.8);
    let eye = Vec3::new(0.3, -2.0, 2.5);
    let from_eye = (0..64 * 64).map(|i| Ray::new(eye, (target(i) - eye).normalize()));
    let mut random = Random::new(3, 0);
    let mut anywhere = || Vec3::from_array(std::array::from_fn(|_| 4.0 * random.next_f32() - 2.0));
    let scattered = (0..2000).map(|i| {
        let origin = anywhere();
        let ray = Ray::new(origin, (target(7 * i) - origin).normalize_or(Vec3::Z));
        let t_min = 0.01 * (i % 50) as f32;
        Ray { t_min, t_max: if i % 3 == 0 { t_min + 1.0 } else { f32::INFINITY }, ..ray }
    });
    let rays: Vec<Ray> = from_eye.chain(scattered).collect();
    let ground = {
        let scatter = std::mem::take(&mut flat.scatter);
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        surface_hits(&flat, Simd::detect(), &rays, &mut hits);
        flat.scatter = scatter;
        hits
    };
    let expected: Vec<Option<(f32, u32)>> =
        rays.iter().map(|ray| nearest_leaf(&flat, ray)).collect();
    for simd in Simd::available() {
        let mut hits = vec![SurfaceHit::MISS; rays.len()];
        surface_hits(&flat, simd, &rays, &mut hits);
        let mut occluded = vec![false; rays.len()];
        occlusions(&flat, simd, &rays, &mut occluded);
        let mut n_leaves = 0;
        for (i, hit) in hits.iter().enumerate() {
            let name = simd.name();
            match expected[i].filter(|(distance, _)| *distance < ground[i].distance) {
                Some((distance, slot)) => {
                    n_leaves += 1;
                    assert_eq!((hit.distance, hit.slot), (distance, slot), "{name} {i}");
                    assert_eq!(hit.surface, SurfaceKind::Leaves);
                    assert!(hit.normal.dot(rays[i].direction) <= 0.0 && !hit.is_backface);
                    assert!(occluded[i], "{name} {i}");
                }
                None => {
                    assert_eq!(hit.distance, ground[i].distance, "{name} {i}");
                    assert!(occluded[i] != ground[i].is_miss(), "{name} {i}");
                }
            }
        }
        assert!(2000 < n_leaves, "{n_leaves}");
    }
}

/// Returns the mirrors of all clusters, by the indices of their points.
fn mirrors(points: &FlatPoints) -> BTreeMap<u32, Vec3> {
    points.slots().map(|slot| (points.id(slot), points.normal(slot))).collect()
}

#[test]
fn clusters_stay_the_same_where_others_are_clipped() {
    let mut tree = tree();
    let whole = mirrors(&FlatCloud::new(&tree, &NoProgress).unwrap().scatter);
    let plane = ClipPlane { point: 0.9 * DVec3::Z, normal: -DVec3::Z };
    let clip = Clip { plane: Some(plane), ..Clip::default() };
    let kept = tree.clip(&clip, &DAffine3::IDENTITY).unwrap();
    let part = mirrors(&FlatCloud::new(&tree, &NoProgress).unwrap().scatter);
    assert!(300 < part.len() && part.len() == kept.len(), "{} {}", part.len(), kept.len());
    for (id, normal) in part {
        assert_eq!(normal, whole[&kept[id as usize]]);
    }
}

#[test]
fn rays_that_leave_a_leaf_do_not_hit_it_again() {
    let flat = FlatCloud::new(&tree(), &NoProgress).unwrap();
    let mut random = Random::new(5, 0);
    let eye = Vec3::new(0.3, -200.0, 80.0);
    let mut toward = || Vec3::new(random.next_f32() - 0.5, random.next_f32() - 0.5, 0.8);
    let rays: Vec<Ray> = (0..4000).map(|_| Ray::new(eye, (toward() - eye).normalize())).collect();
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    surface_hits(&flat, Simd::detect(), &rays, &mut hits);
    let on_leaf = rays.iter().zip(&hits).filter(|(_, hit)| hit.surface == SurfaceKind::Leaves);
    let on_leaf: Vec<(&Ray, &SurfaceHit)> = on_leaf.filter(|(_, hit)| !hit.is_miss()).collect();
    let back = |(ray, hit): &(&Ray, &SurfaceHit)| {
        let position = ray.at(hit.distance);
        let direction = (hit.normal - 0.9 * ray.direction).normalize();
        let magnitude = position.abs().max(eye.abs()).max_element();
        hit.surface.spawn_ray(position, magnitude, hit.normal, hit.radius, direction)
    };
    let secondary: Vec<Ray> = on_leaf.iter().map(back).collect();
    let mut again = vec![SurfaceHit::MISS; secondary.len()];
    surface_hits(&flat, Simd::detect(), &secondary, &mut again);
    // Other leaves of the same cluster may be in the way, but not the leaf itself.
    let is_itself = |(((_, first), ray), again): (((&Ray, &SurfaceHit), &Ray), &SurfaceHit)| {
        let same = again.slot == first.slot && again.surface == first.surface;
        same && 0.999 < again.normal.dot(first.normal).abs() && again.distance < 1e-3 + ray.t_min
    };
    let pairs = on_leaf.iter().copied().zip(&secondary).zip(&again);
    assert!(1000 < on_leaf.len() && !pairs.into_iter().any(is_itself), "{}", on_leaf.len());
}

/// A tree that is refitted to moved points has their clusters where the points are, each with the leaves that it had.
#[test]
fn clusters_move_with_their_points() {
    let at_rest = tree();
    let move_by = |p: Vec3| Vec3::new(0.3 * p.z, 0.1 * p.x, 0.2 * p.y);
    let offsets = at_rest.cloud().positions.iter().map(|position| move_by(*position)).collect();
    let bent = scenes::changed(&at_rest, |cloud| {
        cloud.morphs = vec![Morph { positions: offsets, ..Morph::default() }];
    });
    let mut scene = scenes::lit(bent);
    scene.graph.nodes[0].morph_weights = vec![0.0];
    let mut played = FlatScene::new(&scene, &NoProgress).unwrap();
    scene.graph.nodes[0].morph_weights = vec![1.0];
    played.update(&scene.graph, &NoProgress).unwrap();
    let FlatGeometry::Cloud(refitted) = &*played.geometries[0] else { panic!("no cloud") };
    assert_eq!(refitted.scatter_kind(), SurfaceKind::Leaves);
    let before = FlatCloud::new(&at_rest, &NoProgress).unwrap();
    assert_eq!(mirrors(&refitted.scatter), mirrors(&before.scatter));
    let positions = &at_rest.cloud().positions;
    for slot in refitted.scatter.slots() {
        let position = positions[refitted.scatter.id(slot) as usize];
        assert!(refitted.scatter.center(slot).distance(position + move_by(position)) < 1e-4);
    }
    let eye = Vec3::new(0.3, -2.0, 2.5);
    let mut random = Random::new(8, 0);
    let mut target = || Vec3::from_array(std::array::from_fn(|_| random.next_f32() - 0.5));
    let rays: Vec<Ray> = (0..4000)
        .map(|_| target() + 0.8 * Vec3::Z)
        .map(|target| Ray::new(eye, (target + move_by(target) - eye).normalize()))
        .collect();
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    surface_hits(refitted, Simd::detect(), &rays, &mut hits);
    let mut n_leaves = 0;
    for (ray, hit) in rays.iter().zip(&hits) {
        let expected = nearest_leaf(refitted, ray);
        if hit.surface == SurfaceKind::Leaves && !hit.is_miss() {
            n_leaves += 1;
            assert_eq!(Some((hit.distance, hit.slot)), expected);
        } else {
            assert!(expected.is_none_or(|(distance, _)| hit.distance <= distance));
        }
    }
    assert!(2000 < n_leaves, "{n_leaves}");
}

/// Leaves have no inside: light passes through those of glass as through panes, without a colour of their thickness.
#[test]
fn leaves_of_glass_are_panes() {
    let clear = scenes::colored(&tree(), vec![[255; 3]; tree().cloud().len()]);
    let far_from_its_ground = scenes::changed(&clear, |cloud| {
        let ground = cloud.positions.iter_mut().filter(|position| position.z < 0.2);
        ground.for_each(|position| position.x += 1000.0);
    });
    let dark = Material { attenuation_color: Vec3::ZERO, ..Material::GLASS };
    let dark = Material { attenuation_distance: 0.01, ..dark };
    let graph = Graph::from_geometry(Geometry::Points(far_from_its_ground), dark);
    let settings = Settings { width: 48, height: 48, max_depth: 200, ..SETTINGS };
    let lights = vec![Light::Sky(WHITE_SKY)];
    let image = scenes::render(&scene(graph, lights, scenes::from_above(1.0)), &settings);
    let covered: Vec<f32> = image.color.iter().filter(|p| 0.99 < p[3]).map(|p| rgb(*p).y).collect();
    let mean = covered.iter().sum::<f32>() / covered.len() as f32;
    assert!(300 < covered.len() && (mean - 1.0).abs() < 0.01, "{} {mean}", covered.len());
}
