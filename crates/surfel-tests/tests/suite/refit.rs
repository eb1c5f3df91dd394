//! Refitting trees to moved points: the bytes are the same if no point has moved, the hits are right if some
//! have, and a tree that no longer suits its points is reported.

use crate::bad_clouds::flat;
use crate::brute_force::BruteForce;
use surfel_core::flat::{FlatCloud, FlatTriangles, MAX_COST_RATIO, Refit};
use surfel_core::math::{Quat, Random, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::surface::SurfaceKind;
use surfel_tests::clouds;
use surfel_tests::scenes;

const KINDS: [SurfaceKind; 3] = [SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::SplatFit];

fn cloud() -> PointCloud {
    scenes::points(clouds::sphere(5000, 1.0), SurfaceKind::Disc).cloud().clone().into_inner()
}

/// Turns each point about Z by an angle that grows with its height.
fn twisted(mut cloud: PointCloud, turn_rad: f32) -> PointCloud {
    let normals = cloud.normals.iter_mut().flatten();
    for (position, normal) in cloud.positions.iter_mut().zip(normals) {
        let turn = Quat::from_rotation_z(turn_rad * position.z);
        (*position, *normal) = (turn * *position, turn * *normal);
    }
    cloud
}

/// Moves each point at random, by a Gaussian in units of its radius.
fn scattered(mut cloud: PointCloud, by_radii: f32) -> PointCloud {
    let mut random = Random::new(31, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    for (position, radius) in cloud.positions.iter_mut().zip(cloud.radii.iter().flatten()) {
        *position += by_radii * radius * Vec3::new(gaussian(), gaussian(), gaussian());
    }
    cloud
}

fn refit(scene: &mut FlatCloud, cloud: &PointCloud) -> Refit {
    let colors = vec![[188; 3]; cloud.len()];
    scene.points.refit(scenes::columns(cloud, scene.surface, &colors))
}

fn same_bytes(a: &FlatCloud, b: &FlatCloud) -> bool {
    let (a, b) = (&a.points, &b.points);
    a.nodes == b.nodes && a.blocks == b.blocks && a.ids == b.ids && a.cost == b.cost
}

#[test]
fn points_that_have_not_moved_give_the_same_bytes() {
    for kind in KINDS {
        let mut scene = flat(cloud(), kind);
        let before = scene.clone();
        assert_eq!(refit(&mut scene, &cloud()), Refit::Kept { cost_ratio: 1.0 });
        assert!(same_bytes(&scene, &before));
    }
}

#[test]
fn empty_trees_need_no_rebuild() {
    let (none, mut scene) = (cloud().subset(&[]), flat(cloud(), SurfaceKind::Disc));
    let lines = scene.lines.refit(scenes::columns(&none, SurfaceKind::Disc, &[]));
    let triangles = FlatTriangles::new(&[], &[], &NoProgress).unwrap().refit(&[], &[]);
    assert_eq!([lines, triangles], [Refit::Kept { cost_ratio: 1.0 }; 2]);
}

#[test]
fn moved_points_are_hit_where_they_are() {
    let rays = scenes::random_rays(400, 1.2, 32);
    for kind in KINDS {
        let mut scene = flat(cloud(), kind);
        let moved = twisted(cloud(), 0.4);
        assert!(matches!(refit(&mut scene, &moved), Refit::Kept { .. }), "{kind:?}");
        scene.points.validate(kind);
        BruteForce::new(&scene, rays.clone()).check_in_order("twisted");
        // Moving the points back restores every byte.
        refit(&mut scene, &cloud());
        assert!(same_bytes(&scene, &flat(cloud(), kind)));
    }
}

#[test]
fn cost_grows_with_scatter_until_a_rebuild_is_needed() {
    let built = flat(cloud(), SurfaceKind::Disc);
    let mut last = 1.0;
    for by_radii in [0.1, 0.2, 0.3, 0.4] {
        let Refit::Kept { cost_ratio } = refit(&mut built.clone(), &scattered(cloud(), by_radii))
        else {
            panic!("a rebuild is needed at {by_radii}");
        };
        assert!(last < cost_ratio && cost_ratio <= MAX_COST_RATIO, "{cost_ratio} at {by_radii}");
        last = cost_ratio;
    }
    let mut scene = built.clone();
    assert_eq!(refit(&mut scene, &scattered(cloud(), 3.0)), Refit::NeedsRebuild);
    // Moving the points back restores every byte.
    assert_eq!(refit(&mut scene, &cloud()), Refit::Kept { cost_ratio: 1.0 });
    assert!(same_bytes(&scene, &built));
}

#[test]
fn a_block_that_loses_its_precision_needs_a_rebuild() {
    let mut scene = flat(cloud(), SurfaceKind::Disc);
    let mut moved = cloud();
    moved.radii.as_mut().unwrap()[7] *= 0.01;
    assert_eq!(refit(&mut scene, &moved), Refit::NeedsRebuild);
}

#[test]
fn points_that_appear_or_vanish_need_a_rebuild() {
    let mut gone = cloud();
    gone.positions[7].x = f32::NAN;
    let mut scene = flat(cloud(), SurfaceKind::Disc);
    assert_eq!(refit(&mut scene, &gone), Refit::NeedsRebuild);
    let mut scene = flat(gone.clone(), SurfaceKind::Disc);
    assert_eq!(refit(&mut scene, &gone), Refit::Kept { cost_ratio: 1.0 });
    assert_eq!(refit(&mut scene, &cloud()), Refit::NeedsRebuild);
}
